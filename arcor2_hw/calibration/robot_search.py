"""The search for a robot in a depth image from starts around the assumed pose, and the comparison with the image."""

import itertools
import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.depth import MIN_POINTS, DepthView, plane_thickness, planes
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.registration import MIN_INCIDENCE_COSINE, Fit, Model, Stage, approach, refine, rotation
from arcor2_hw.calibration.surface import RobotSurface

Floats = npt.NDArray[np.float64]

FAR: Final = (Stage(0.06, 8), Stage(0.03, 7), Stage(0.015, 7))
NEAR: Final = (Stage(0.02, 8), Stage(0.01, 12))
OUTLIER_FACTOR: Final = 3.0
"""Multiple of the standard deviation of the distances beyond which a point is not part of the robot."""
REACH: Final = (0.004, 0.012)
FEW_POINTS: Final = 1_500
"""Number of points of the cloud used in the search."""
MAX_POINTS: Final = 20_000
"""Number of points of the cloud used for the result."""
AGREEING_STARTS: Final = 7
"""Number of starts after which the search ends when all of them, along and about each axis, ended at one pose."""
CELL: Final = 0.03
"""Grid cell size for pre-filtering the point cloud, m."""
FEW_RAYS: Final = 12_000
TILES: Final = 40
"""Number of tiles across the image, each counted as one independent measurement."""
TOLERANCE: Final = (0.008, 0.006)
"""Difference up to which a depth confirms the model: constant in m, and a factor of its square in 1/m."""
DISTINCT_POSES: Final = (0.004, 0.012)
"""Differences beyond which two results are different, m and rad."""
FEW_IN_TILE: Final = 8
"""Number of rays of a tile below which its mean is not used."""


class Agreement(NamedTuple):
    """Comparison of model and image, as fractions of the rays that hit the model and have a depth."""

    confirmed: float
    occluded: float
    contradicted: float
    rays: int
    uneven: float = 0.0
    """Root mean square over tiles of the mean distance between model and image, m."""

    @property
    def score(self) -> float:
        """Return the score of a result; larger is better."""
        return self.confirmed - self.contradicted


class SearchResult(NamedTuple):
    """A result of the search, the number of starts that reached it, and its comparison with the image."""

    fit: Fit
    compared: Agreement
    starts: int


class Search:
    """The cloud near the model, and the results from the starts around the assumed pose."""

    def __init__(
        self, surface: RobotSurface, view: DepthView, start: Floats, within: float, angle_within: float
    ) -> None:
        self._surface, self._view, self._start = surface, view, start
        self._within, self._angle_within = within, angle_within
        self._model = Model(surface)
        self._random = np.random.default_rng(0)  # the same image gives the same result
        rows, columns = np.nonzero(view.depth)
        cloud = view.points()
        low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
        margin = self._within + self._angle_within * float(np.linalg.norm(np.maximum(-low, high)))
        based = cloud @ start[:3, :3].T + start[:3, 3]
        chosen = np.flatnonzero(((based > low - margin) & (based < high + margin)).all(axis=1))
        near = np.zeros(len(cloud), dtype=np.bool_)
        near[chosen[self._may_be(based[chosen])]] = True
        for normal, offset in planes(cloud[~near], self._random):  # robots are mounted on tables or walls
            near &= np.abs(cloud @ normal - offset) > plane_thickness(cloud)
        chosen = np.flatnonzero(near)
        if len(chosen) < MIN_POINTS:
            raise CalibrationRefused(
                "The camera sees hardly anything at the expected place of {name}. Check where the "
                "camera looks, and whether its pose and that of the robot are correct to a few centimetres.",
                f"{len(chosen)} of {len(cloud)} points are near the model; at least {MIN_POINTS} are needed",
                Reason.NO_OVERLAP,
                name=surface.name,
            )
        if len(chosen) > MAX_POINTS:
            chosen = self._random.choice(chosen, MAX_POINTS, replace=False)
        self._cloud = cloud[chosen]
        self._tile = max(1, view.depth.shape[1] // TILES)
        self.tiles = (rows[chosen] // self._tile) * (TILES + 2) + columns[chosen] // self._tile
        self.starts = 0

    def _may_be(self, points: Floats) -> npt.NDArray[np.bool_]:
        """Return which points (n, 3, in the base frame) may be part of the robot; each grid cell is checked once."""
        if not len(points):
            return np.zeros(0, dtype=np.bool_)
        corner = points.min(axis=0)
        cells = ((points - corner) / CELL).astype(np.int64)
        counts = cells.max(axis=0) + 1
        flat, where = np.unique(np.ravel_multi_index(tuple(cells.T), tuple(counts)), return_inverse=True)
        centres = corner + (np.stack(np.unravel_index(flat, tuple(counts)), axis=-1) + 0.5) * CELL
        allowed = self._within + self._angle_within * np.linalg.norm(centres, axis=1) + CELL
        return np.asarray((self._model.distance(centres.astype(np.float64)) < allowed)[where.reshape(-1)])

    def ends(self) -> list[SearchResult]:
        """Search from all starts and return the distinct results, best first.

        Raises:
            CalibrationRefused: Nothing was found.
        """
        few = self._cloud[self._random.permutation(len(self._cloud))[:FEW_POINTS]]
        some = self._cloud[self._random.permutation(len(self._cloud))[: 6 * FEW_POINTS]]
        rays = self._rays(FEW_RAYS)
        found: list[tuple[Fit, int]] = []
        for offset in self._offsets():
            self.starts += 1
            fit = approach(self._model, few, rays, offset @ self._start, FAR)
            if fit is None:
                continue
            same = next((i for i, (other, _) in enumerate(found) if _near(fit, other, 3.0)), None)
            if same is None:
                found.append((fit, 1))
            else:
                found[same] = found[same][0], found[same][1] + 1
            if found[0][1] == self.starts == AGREEING_STARTS:  # starts from all sides reached one pose
                break
        compared = [(fit, count, self.compare(fit.base_from_camera, FEW_RAYS)) for fit, count in found]
        compared.sort(key=lambda each: -each[2].score)
        ends: list[SearchResult] = []
        for fit, count, _ in compared[:4]:
            finer = refine(self._model, some, fit.base_from_camera, NEAR)
            if finer is None:
                continue
            same = next((i for i, end in enumerate(ends) if _near(finer, end.fit, 1.0)), None)
            if same is None:
                ends.append(SearchResult(finer, self.compare(finer.base_from_camera, FEW_RAYS), count))
            else:
                ends[same] = ends[same]._replace(starts=ends[same].starts + count)
        if not ends:
            raise self._unlike(f"none of {self.starts} starts converged")
        return sorted(ends, key=lambda end: -end.compared.score)

    def last(self, fit: Fit) -> Fit:
        """Return the result from all points.

        Raises:
            CalibrationRefused: No point is near enough.
        """
        best = refine(self._model, self._cloud, fit.base_from_camera, (Stage(REACH[1], 12),))
        if best is not None:
            sigma = 1.4826 * float(np.median(np.abs(best.errors)))
            reach = float(np.clip(OUTLIER_FACTOR * sigma, *REACH))
            best = refine(self._model, self._cloud, best.base_from_camera, (Stage(reach, 25),))
        if best is None:
            raise self._unlike("no points near enough were left at the end")
        return best

    def _unlike(self, detail: str) -> CalibrationRefused:
        return CalibrationRefused(
            "The shape that the camera sees at the expected place of {name} does not match its model.",
            detail,
            Reason.NO_OVERLAP,
            name=self._surface.name,
        )

    def compare(self, base_from_camera: Floats, most_rays: int) -> Agreement:
        """Compare model and image."""
        stride = self._stride(most_rays)
        rays = self._view.rays[::stride, ::stride].reshape(-1, 3)
        seen = self._view.seen[::stride, ::stride].reshape(-1)
        expected, normals = self._model.render(base_from_camera, rays)
        both = np.isfinite(expected) & (seen > 0)
        count = int(np.count_nonzero(both))
        if not count:
            return Agreement(0.0, 0.0, 0.0, 0)
        farther = seen[both] - expected[both]
        allowed = TOLERANCE[0] + TOLERANCE[1] * expected[both] ** 2
        nearer, beyond = float(np.mean(farther < -allowed)), float(np.mean(farther > allowed))
        slope = np.abs(np.einsum("ij,ij->i", normals[both], rays[both] @ base_from_camera[:3, :3].T))
        confirmed = (np.abs(farther) <= allowed) & (slope > 2.0 * MIN_INCIDENCE_COSINE)
        rows, columns = np.divmod(np.flatnonzero(both)[confirmed], self._view.seen[::stride, ::stride].shape[1])
        tile = max(1, self._tile // stride)
        uneven = _uneven((farther * slope)[confirmed], (rows // tile) * (TILES + 2) + columns // tile)
        return Agreement(1.0 - nearer - beyond, nearer, beyond, count, uneven)

    def _stride(self, most_rays: int) -> int:
        return max(1, math.ceil(math.sqrt(self._view.depth.size / most_rays)))

    def _rays(self, most_rays: int) -> Floats:
        stride = self._stride(most_rays)
        return self._view.rays[::stride, ::stride].reshape(-1, 3)

    def _offsets(self) -> list[Floats]:
        """Return the starts as motions in the base frame: none, and to both sides along and about every axis."""
        offsets = [np.eye(4)]
        for sign, axis in itertools.product((1.0, -1.0), np.eye(3)):
            along, about = np.eye(4), np.eye(4)
            along[:3, 3] = sign * 0.6 * self._within * axis
            about[:3, :3] = rotation(-sign * 0.6 * self._angle_within * axis)
            offsets += [along, about]
        return offsets


def _uneven(distances: Floats, tiles: npt.NDArray[np.intp]) -> float:
    _, where, counts = np.unique(tiles, return_inverse=True, return_counts=True)
    if not len(counts):
        return 0.0
    means = np.bincount(where, distances) / counts
    many = counts >= FEW_IN_TILE
    return float(np.sqrt(np.average(means[many] ** 2, weights=counts[many]))) if many.any() else 0.0


def _near(first: Fit, second: Fit, times: float) -> bool:
    between = first.base_from_camera @ np.linalg.inv(second.base_from_camera)
    at_middle = between[:3, :3] @ first.centre + between[:3, 3] - first.centre
    return (
        float(np.linalg.norm(at_middle)) < times * DISTINCT_POSES[0]
        and angle_of(between[:3, :3]) < times * DISTINCT_POSES[1]
    )


def angle_of(matrix: Floats) -> float:
    """Return the angle of a rotation matrix, rad, 0 to pi."""
    sine = np.linalg.norm([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    return float(math.atan2(float(sine), float(np.trace(matrix)) - 1.0))
