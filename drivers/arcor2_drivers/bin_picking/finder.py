"""Finding the next part in a crate: from a depth picture to a pose with its quality, or why there is none."""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.exceptions import NoDepth
from arcor2_hw.objects.frame import cloud, rays

from .errors import BadFit, Empty, PartsTouch
from .models import Model
from .poses import upright
from .registration import Fit, register
from .segmentation import Crate, Pixels, clusters, look_into, surfaces

Floats = npt.NDArray[np.float64]

LEAST_AREA: Final = 0.25
"""Of the part's smallest side, the area that has to be seen of something to be looked at."""
TOO_LARGE: Final = 1.3
"""Of what is seen of one part, the area beyond which it is more than one."""
COVERED: Final = 0.8
"""Of a part, what has to be seen to say that more lies there than this one."""
LEAST_SEEN: Final = 0.3
"""Of the crate, the part that has to be seen."""
MOST_CANDIDATES: Final = 12


class Crated(NamedTuple):
    """A crate's inside, m."""

    length: float
    width: float
    height: float


class Found(NamedTuple):
    """The next part: its pose in the crate's frame, 4 × 4, and how well it fits."""

    pose: Floats
    fit: Fit


class View(NamedTuple):
    """A depth picture (uint16, mm), its lens, and the pose of the camera in the crate's frame, 4 × 4."""

    depth: npt.NDArray[np.uint16]
    parameters: CameraParameters
    camera: Floats


def see(view: View, crate: Crated, tolerance: float) -> Crate:
    """Look into the crate. Raises NoDepth when too little of it is seen."""
    points = cloud(view.depth, view.parameters)
    points = points @ view.camera[:3, :3].T.astype(np.float32) + view.camera[:3, 3].astype(np.float32)
    seen = look_into(points, *crate, tolerance)
    expected = _pixels_of(view, crate)
    if expected < 100 or seen.inside.sum() < LEAST_SEEN * expected:
        raise NoDepth(
            "the crate is not seen: the camera looks elsewhere, something is between, or one of the poses is wrong",
            f"{int(seen.inside.sum())} of {expected:.0f} points",
        )
    return seen


def _pixels_of(view: View, crate: Crated) -> float:
    """Return how many pixels the floor of the crate would fill."""
    distance = float(view.camera[2, 3])
    across = abs(float(view.camera[2, 2]))
    if distance <= 0.0:
        return 0.0
    return view.parameters.fx * view.parameters.fy * crate.length * crate.width * across**3 / distance**2


def _things(seen: Crate, view: View, model: Model, tolerance: float) -> list[Pixels]:
    return [each for each in clusters(seen, tolerance) if _area(each, view) > LEAST_AREA * model.faces[0]]


def lies_there(view: View, crate: Crated, model: Model, tolerance: float) -> bool:
    """Return whether something as large as a part lies in the crate. Raises NoDepth when the crate is not seen."""
    return bool(_things(see(view, crate, tolerance), view, model, tolerance))


def find(
    view: View,
    crate: Crated,
    model: Model,
    tolerance: float,
    min_quality: float,
    go_on: Callable[[], None] = lambda: None,
) -> Found:
    """Find the part that lies highest and fits well.

    go_on: called before each candidate is registered, and may raise to end the search.
    Raises Empty when nothing lies there, PartsTouch, BadFit; NoDepth when the crate is not seen.
    """
    seen = see(view, crate, tolerance)
    wholes = _things(seen, view, model, tolerance)
    if not wholes:
        raise Empty("the crate is empty")
    beams = rays(view.parameters, view.depth.shape[1], view.depth.shape[0])
    smallest, largest = model.faces
    best: Fit | None = None
    too_large = False
    for pixels in sorted(wholes, key=lambda each: -_top(seen, each))[:MOST_CANDIDATES]:
        go_on()
        fit = register(seen, pixels, model, view.camera, beams, tolerance)
        if fit.quality < min_quality:
            pieces = [each for each in surfaces(seen, pixels) if _area(each, view) > LEAST_AREA * smallest]
            for piece in sorted(pieces, key=lambda each: -_top(seen, each))[:MOST_CANDIDATES]:
                go_on()
                if piece.sum() < pixels.sum() and _area(piece, view) <= TOO_LARGE * largest:
                    fit = max(fit, register(seen, piece, model, view.camera, beams, tolerance), key=_quality)
                    if fit.quality >= min_quality:
                        break
        if fit.quality >= min_quality:
            pose = fit.pose.copy()
            if model.box:
                pose[:3, :3] = upright(pose[:3, :3])
            return Found(pose, fit)
        too_large = too_large or (fit.larger > TOO_LARGE and fit.covered > COVERED)
        best = fit if best is None else max(best, fit, key=_quality)
    assert best is not None
    told = f"best quality {best.quality:.2f} (explained {best.explained:.2f}, covered {best.covered:.2f})"
    if too_large:
        raise PartsTouch("what lies there is larger than one part: parts touch, or something else lies there", told)
    raise BadFit(
        "what lies there does not fit the part: quality {quality:.2f}, {min_quality:g} asked for",
        told,
        quality=best.quality,
        min_quality=min_quality,
    )


def _quality(fit: Fit) -> float:
    return fit.quality


def _top(crate: Crate, pixels: Pixels) -> float:
    return float(np.percentile(crate.height[pixels], 90))


def _area(pixels: Pixels, view: View) -> float:
    """Return the area that is seen, m², as if it stood across the line of sight."""
    z = view.depth[pixels].astype(np.float64) * 0.001
    return float((z * z).sum() / (view.parameters.fx * view.parameters.fy))
