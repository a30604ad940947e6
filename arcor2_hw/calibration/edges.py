"""Corners of a marker from all its edges, also inner ones, measured to a hundredth of a pixel.

The cells of a marker form a chart of straight edges. Across each edge, grey values are sampled at many places, and
the position of the step is measured by the area under it. A homography from the marker to undistorted camera rays is
fitted to all of them at once, so corners are never searched in the image itself. Dark cells can look smaller or
larger than they are, because of the camera's tone curve, stray light or ink. Edges face both ways, so this shift is
estimated together with the homography.
"""

import functools
import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.lens import Array, Lens

PLACES_PER_EDGE: Final = 6
"""Number of places on each edge of a cell."""
_UNIT: Final = np.linspace(-1.0, 1.0, 17)
"""Positions of samples across an edge."""
_WEIGHTS: Final = np.where(np.abs(_UNIT) == 1.0, 0.5, 1.0) * (_UNIT[1] - _UNIT[0])
_CLEAR: Final = 1.8
"""Minimum distance of a place from the end of its edge, as a multiple of the blur."""
_MIN_SHARE: Final = 0.8
"""Minimum share of places with a step from dark to light; with fewer it is another marker, or none."""
_MIN_CONTRAST: Final = 0.02
"""Minimum contrast as a fraction of the grey range."""
_WIDEST: Final = 4.0
"""Maximum search distance on each side of an edge along its normal, px; larger in a blurred image."""
_NARROWEST: Final = 1.5
_ROUNDS: Final = 4
_AS_BEFORE: Final = 0.3
"""Step size below which edges are sampled in the same directions as before, px."""
_SHIFT_DEVIATION: Final = 0.3
"""Prior standard deviation of the shift of edges, px."""
_CORNER_FLOOR: Final = 0.01
"""Standard deviation of a corner by effects common to a whole edge, such as lens model or paper, px."""


@dataclass(frozen=True, eq=False)
class Chart:
    """The edges inside and around a marker, in cells from its middle (x right, y up).

    Attributes:
        points: (n, 2), PLACES_PER_EDGE on each edge.
        across: (n), 0 where the edge is crossed along x, 1 along y.
        towards: (n), 1 or -1, the direction of the light side.
        free: (n), distance to the end of the edge.
        corners: (4, 2), clockwise from the upper left.
    """

    points: Array
    across: npt.NDArray[np.intp]
    towards: Array
    free: Array
    corners: Array


@dataclass(frozen=True, eq=False)
class Measured:
    """A measured marker.

    Attributes:
        corners: (4, 2), px.
        information: (8, 8), inverse of their covariance, px⁻².
        blur: Standard deviation of the edges of the more blurred direction, px; motion blurs only edges that it
            crosses.
        cell: Width of a cell, px.
        shift: Distance by which edges are shifted towards the light side, px.
        contrast: Contrast as a fraction of the range.
    """

    number: int
    corners: Array
    information: Array
    blur: float
    cell: float
    shift: float
    contrast: float


@functools.lru_cache(maxsize=1024)
def chart_of(dictionary: int, number: int) -> Chart:
    """Return the edges of a marker of one of OpenCV's predefined dictionaries."""
    known = cv2.aruco.getPredefinedDictionary(dictionary)
    side = known.markerSize + 2
    light = np.pad(cv2.aruco.generateImageMarker(known, number, side) > 127, 1, constant_values=True)
    half = side / 2
    fractions = (np.arange(PLACES_PER_EDGE) + 0.5) / PLACES_PER_EDGE
    points: list[tuple[float, float]] = []
    across: list[int] = []
    towards: list[float] = []
    free: list[float] = []
    for axis, cells in enumerate((light, light.T)):
        change = cells[:, 1:].astype(np.int8) - cells[:, :-1].astype(np.int8)
        for row, column in zip(*np.nonzero(change), strict=True):
            line = change[:, column]
            first = last = int(row)
            while line[first - 1] == line[row]:
                first -= 1
            while line[last + 1] == line[row]:
                last += 1
            for along in row + fractions:
                at = (column - half, half - (along - 1)) if axis == 0 else (along - 1 - half, half - column)
                points.append((float(at[0]), float(at[1])))
                free.append(float(min(along - first, last + 1 - along)))
            across += [axis] * PLACES_PER_EDGE
            towards += [float(line[row]) * (1.0 if axis == 0 else -1.0)] * PLACES_PER_EDGE
    return Chart(
        np.array(points),
        np.array(across, dtype=np.intp),
        np.array(towards),
        np.array(free),
        np.array([[-half, half], [half, half], [half, -half], [-half, -half]]),
    )


def measure(
    picture: npt.NDArray[np.float32], first: tuple[float, float], lens: Lens, chart: Chart, number: int, corners: Array
) -> Measured | None:
    """Measure a marker whose corners are known to one or two pixels; return None when its edges are not found there.

    Args:
        picture: Brightness 0 to 1 of a part of the image, rows × columns.
        first: Column and row of its first pixel.
        lens: The lens.
        chart: Edges of the marker.
        number: Number of the marker.
        corners: (4, 2), px, clockwise from the upper left.
    """
    model = np.ascontiguousarray(chart.corners, dtype=np.float32)
    rays = np.ascontiguousarray(lens.rays(corners), dtype=np.float32)
    h = np.asarray(cv2.getPerspectiveTransform(model, rays), dtype=np.float64).ravel()[:8]
    shift, blur, moved = 0.0, 1.0, math.inf
    for index in range(_ROUNDS):
        if moved > _AS_BEFORE:
            at, slopes = lens.pixels_and_slopes(_mapped(h, chart.points))
            view = _edge_view(h, chart, slopes)
        else:
            at = lens.pixels(_mapped(h, chart.points))
        step = _crossings(picture, at - first, view, chart.across, blur)
        if step is None:
            return None
        offsets, valid, blurs, contrast = step
        blur = float(np.mean(blurs))
        wanted = np.column_stack((view.by_h, np.ones(len(offsets))))
        residual = offsets - shift
        weights = _tukey(residual, valid)
        prior = np.zeros(9)
        prior[8] = 1.0
        spread = max(float(np.sqrt(np.sum(weights * residual**2) / max(weights.sum(), 1.0))), 0.01)
        balance = (spread / _SHIFT_DEVIATION) ** 2
        # Scale columns of very different size, otherwise the normal equations lose half of their digits.
        scale = np.sqrt(np.sum(wanted**2, axis=0))
        scaled = wanted / scale
        normal = scaled.T @ (scaled * weights[:, None]) + np.diag(prior * balance / scale**2)
        right = scaled.T @ (weights * residual)
        right[8] -= balance * shift / scale[8]
        try:
            change = np.linalg.solve(normal, right) / scale
        except np.linalg.LinAlgError:
            return None
        h = h + change[:8]
        shift += float(change[8])
        moved = float(np.abs(view.by_h @ change[:8]).max())
        if not math.isfinite(moved) or moved > 6.0:
            return None
        if index and moved < 0.01:
            break
    used = int(np.count_nonzero(weights > 0.1))
    if used < max(24, 0.5 * np.count_nonzero(valid)) or abs(shift) > 1.5:
        return None
    freedom = max(used - 9, 1)
    left = residual - wanted @ change
    variance = float(np.sum(weights * left**2)) / freedom
    covariance_h = variance * np.linalg.inv(normal)[:8, :8] / np.outer(scale[:8], scale[:8])
    corner_rays = _mapped(h, chart.corners)
    pixels, corner_slopes = lens.pixels_and_slopes(corner_rays)
    by_corner = np.einsum("nij,njk->nik", corner_slopes, _by_h(h, chart.corners, corner_rays)).reshape(8, 8)
    covariance = by_corner @ covariance_h @ by_corner.T + _CORNER_FLOOR**2 * np.eye(8)
    return Measured(number, pixels, np.linalg.inv(covariance), max(blurs), _median(view.cell), shift, contrast)


def _mapped(h: Array, points: Array) -> Array:
    """Return the rays of points of the marker."""
    q = points @ h[6:8] + 1.0
    return np.column_stack(((points @ h[0:2] + h[2]) / q, (points @ h[3:5] + h[5]) / q))


def _by_h(h: Array, points: Array, rays: Array) -> Array:
    """Return the derivatives of rays with respect to the homography, (n, 2, 8)."""
    q = points @ h[6:8] + 1.0
    one = np.column_stack((points, np.ones(len(points)))) / q[:, None]
    result = np.zeros((len(points), 2, 8))
    result[:, 0, 0:3] = one
    result[:, 1, 3:6] = one
    result[:, :, 6:8] = -rays[:, :, None] * (points / q[:, None])[:, None, :]
    return result


@dataclass(frozen=True, eq=False)
class _EdgeView:
    """Appearance of edges in the image.

    Attributes:
        normals: (n, 2), unit vectors towards the light side.
        ways: (n, 2), the marker's own direction across an edge towards the light side, which never crosses other edges.
        cell: (n), width of a cell along it, px.
        slant: (n), cosine between the two.
        room: (n), distance to the neighbouring edge, px.
        by_h: (n, 8), derivative of the edge position along the normal with respect to the homography.
    """

    normals: Array
    ways: Array
    cell: Array
    slant: Array
    room: Array
    by_h: Array


def _edge_view(h: Array, chart: Chart, slopes: Array) -> _EdgeView:
    points = chart.points
    rays = _mapped(h, points)
    q = points @ h[6:8] + 1.0
    by_x = np.column_stack((h[0] - rays[:, 0] * h[6], h[3] - rays[:, 1] * h[6])) / q[:, None]
    by_y = np.column_stack((h[1] - rays[:, 0] * h[7], h[4] - rays[:, 1] * h[7])) / q[:, None]
    x = np.einsum("nij,nj->ni", slopes, by_x)
    y = np.einsum("nij,nj->ni", slopes, by_y)
    over_x = chart.across[:, None] == 0
    along = np.where(over_x, y, x)
    ways = np.where(over_x, x, y) * chart.towards[:, None]
    cell = np.hypot(ways[:, 0], ways[:, 1])
    length = np.hypot(along[:, 0], along[:, 1])
    ways = ways / cell[:, None]
    normals = np.column_stack((-along[:, 1], along[:, 0])) / length[:, None]
    slant = np.sum(normals * ways, axis=1)
    normals *= np.sign(slant)[:, None]
    slant = np.abs(slant)
    by_pixel = np.einsum("ni,nij->nj", normals, slopes)
    by_h = np.einsum("nj,njk->nk", by_pixel, _by_h(h, points, rays))
    return _EdgeView(normals, ways, cell, slant, chart.free * length * slant, by_h)


def _crossings(
    picture: npt.NDArray[np.float32], at: Array, view: _EdgeView, axes: npt.NDArray[np.intp], blur: float
) -> tuple[Array, npt.NDArray[np.bool_], list[float], float] | None:
    """Measure the offsets of edges along their normals.

    Returns:
        The offsets, their validity, the blur of the edges of each direction, and the contrast.
    """
    reach = np.minimum(np.maximum(0.45 * view.cell, _NARROWEST), max(_WIDEST, 3.0 * blur) / np.maximum(view.slant, 0.3))
    across = reach[:, None] * _UNIT
    map_x = (at[:, 0:1] + view.ways[:, 0:1] * across).astype(np.float32)
    map_y = (at[:, 1:2] + view.ways[:, 1:2] * across).astype(np.float32)
    valid = (view.slant > 0.3) & (view.room > min(_CLEAR * blur, 4.0))
    for ends, last in ((map_x[:, ::16], picture.shape[1] - 1), (map_y[:, ::16], picture.shape[0] - 1)):
        valid &= ((ends >= 0) & (ends <= last)).all(axis=1)
    places = int(np.count_nonzero(valid))
    if places < 24:
        return None
    values = cv2.remap(picture, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float64)
    # Dark and light levels are taken from the whole edge, so that noise does not shift single places.
    counts = np.maximum(valid.reshape(-1, PLACES_PER_EDGE).sum(axis=1), 1) * 2.0
    dark, light = (
        np.repeat(
            ((values[:, a] + values[:, b]) * valid).reshape(-1, PLACES_PER_EDGE).sum(axis=1) / counts, PLACES_PER_EDGE
        )
        for a, b in ((0, 1), (-2, -1))
    )
    difference = light - dark
    contrast = _median(difference[valid])
    if contrast <= _MIN_CONTRAST:
        return None
    valid &= difference > 0.35 * contrast
    if np.count_nonzero(valid) < _MIN_SHARE * places:
        return None
    parts = (values - dark[:, None]) / np.where(valid, difference, 1.0)[:, None]
    offsets = reach * (1.0 - parts @ _WEIGHTS) * view.slant
    share = valid / np.maximum(reach * view.slant, 0.1)
    blurs = []
    for chosen in (valid & (axes == 0), valid & (axes == 1)):
        if (count := np.count_nonzero(chosen)) >= PLACES_PER_EDGE:
            mean = (share * chosen) @ parts
            steepest = float(np.max(mean[2:] - mean[:-2])) / ((_UNIT[2] - _UNIT[0]) * count)
            blurs.append(1.0 / (max(steepest, 1e-3) * math.sqrt(math.tau)))
    return offsets, valid, blurs, contrast


def _tukey(residual: Array, valid: npt.NDArray[np.bool_]) -> Array:
    """Return weights that suppress outliers."""
    if not valid.any():
        return np.zeros(len(residual))
    middle = _median(residual[valid])
    scale = max(1.4826 * _median(np.abs(residual[valid] - middle)), 0.02)
    part = (residual - middle) / (4.685 * scale)
    return np.where(valid & (np.abs(part) < 1), (1 - part**2) ** 2, 0.0)


def _median(values: Array) -> float:
    """Return the (upper) median."""
    return float(np.partition(values, len(values) // 2)[len(values) // 2])
