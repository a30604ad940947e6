"""Find the next part in a crate: from a depth image to a pose with its quality."""

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
from .segmentation import Crate, Pixels, clusters, segment, surfaces

Floats = npt.NDArray[np.float64]

MIN_AREA: Final = 0.25
"""Smallest visible area of an object, relative to the smallest side of the part."""
TOO_LARGE: Final = 1.3
"""Ratio of visible area to that of one part above which it is more than one part."""
COVERED: Final = 0.8
"""Visible fraction of a part from which a larger cluster is taken for more than one part."""
MIN_SEEN: Final = 0.3
"""Fraction of the crate that must be visible."""
MAX_CANDIDATES: Final = 12
"""Largest number of clusters, and of pieces of a cluster, that are registered."""


class EmptyCrate(NamedTuple):
    """A crate: its name, for errors, and its inner dimensions, m."""

    name: str
    length: float
    width: float
    height: float


class DetectedPart(NamedTuple):
    """The next part: its pose in the frame of the crate, 4 × 4, and how well it fits."""

    pose: Floats
    fit: Fit


class View(NamedTuple):
    """A depth image (uint16, mm), its camera parameters, and the camera's pose in the frame of the crate, 4 × 4."""

    depth: npt.NDArray[np.uint16]
    parameters: CameraParameters
    camera: Floats


def see(view: View, crate: EmptyCrate, tolerance: float) -> Crate:
    """Segment the inside of the crate. Raises NoDepth when too little of it is visible."""
    points = cloud(view.depth, view.parameters)
    points = points @ view.camera[:3, :3].T.astype(np.float32) + view.camera[:3, 3].astype(np.float32)
    seen = segment(points, crate.length, crate.width, crate.height, tolerance)
    expected = _pixels_of(view, crate)
    if expected < 100 or seen.inside.sum() < MIN_SEEN * expected:
        raise NoDepth(
            "{crate} is not visible. Check the view of the camera and the poses of camera and crate.",
            f"{int(seen.inside.sum())} of {expected:.0f} points",
            crate=crate.name,
        )
    return seen


def _pixels_of(view: View, crate: EmptyCrate) -> float:
    """Return how many pixels the floor of the empty crate would cover."""
    distance = float(view.camera[2, 3])
    across = abs(float(view.camera[2, 2]))
    if distance <= 0.0:
        return 0.0
    return view.parameters.fx * view.parameters.fy * crate.length * crate.width * across**3 / distance**2


def _objects(seen: Crate, view: View, model: Model, tolerance: float) -> list[Pixels]:
    return [each for each in clusters(seen, tolerance) if _area(each, view) > MIN_AREA * model.faces[0]]


def has_parts(view: View, crate: EmptyCrate, model: Model, tolerance: float) -> bool:
    """Return whether the crate contains an object as large as a part. Raises NoDepth when the crate is not visible."""
    return bool(_objects(see(view, crate, tolerance), view, model, tolerance))


def find(
    view: View,
    crate: EmptyCrate,
    model: Model,
    tolerance: float,
    min_quality: float,
    go_on: Callable[[], None] = lambda: None,
) -> DetectedPart:
    """Find the highest part that fits well.

    Args:
        view: The depth image.
        crate: The crate.
        model: The part.
        tolerance: Largest distance of a point from the surface of its part, m.
        min_quality: Smallest quality of a part, 0 to 1.
        go_on: Called before each candidate is registered; it may raise to end the search.

    Raises:
        Empty: The crate is empty.
        PartsTouch: Touching parts cannot be distinguished.
        BadFit: No object fits well enough.
        NoDepth: The crate is not visible.
    """
    seen = see(view, crate, tolerance)
    objects = _objects(seen, view, model, tolerance)
    if not objects:
        raise Empty("{crate} is empty", crate=crate.name)
    beams = rays(view.parameters, view.depth.shape[1], view.depth.shape[0])
    smallest, largest = model.faces
    best: Fit | None = None
    too_large = False
    for pixels in sorted(objects, key=lambda each: -_top(seen, each))[:MAX_CANDIDATES]:
        go_on()
        fit = register(seen, pixels, model, view.camera, beams, tolerance)
        if fit.quality < min_quality:
            pieces = [each for each in surfaces(seen, pixels) if _area(each, view) > MIN_AREA * smallest]
            for piece in sorted(pieces, key=lambda each: -_top(seen, each))[:MAX_CANDIDATES]:
                go_on()
                if piece.sum() < pixels.sum() and _area(piece, view) <= TOO_LARGE * largest:
                    fit = max(fit, register(seen, piece, model, view.camera, beams, tolerance), key=_quality)
                    if fit.quality >= min_quality:
                        break
        if fit.quality >= min_quality:
            pose = fit.pose.copy()
            if model.box:
                pose[:3, :3] = upright(pose[:3, :3])
            return DetectedPart(pose, fit)
        too_large = too_large or (fit.larger > TOO_LARGE and fit.covered > COVERED)
        best = fit if best is None else max(best, fit, key=_quality)
    assert best is not None
    detail = f"best quality {best.quality:.2f} (explained {best.explained:.2f}, covered {best.covered:.2f})"
    if too_large:
        raise PartsTouch(
            "{crate}: an object is larger than one part: parts touch, or it is another object", detail, crate=crate.name
        )
    raise BadFit(
        "{crate}: no object fits the part: best quality {quality:.2f}, {min_quality:g} required",
        detail,
        crate=crate.name,
        quality=best.quality,
        min_quality=min_quality,
    )


def _quality(fit: Fit) -> float:
    return fit.quality


def _top(crate: Crate, pixels: Pixels) -> float:
    return float(np.percentile(crate.height[pixels], 90))


def _area(pixels: Pixels, view: View) -> float:
    """Return the visible area perpendicular to the line of sight, m²."""
    z = view.depth[pixels].astype(np.float64) * 0.001
    return float((z * z).sum() / (view.parameters.fx * view.parameters.fy))
