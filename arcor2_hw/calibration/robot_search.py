"""The search for a robot in a depth picture: from starts around the assumed pose; what the picture says of each end."""

import itertools
import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.depth import LEAST_POINTS, DepthView, plane_thickness, planes
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.registration import GRAZING, Fit, Model, Stage, approach, refine, rotation
from arcor2_hw.calibration.surface import RobotSurface

Floats = npt.NDArray[np.float64]

FAR: Final = (Stage(0.06, 8), Stage(0.03, 7), Stage(0.015, 7))
NEAR: Final = (Stage(0.02, 8), Stage(0.01, 12))
FITTING: Final = 3.0
"""Of the distances' standard deviation: what lies farther off is not the robot. Within these bounds, m:"""
REACH: Final = (0.004, 0.012)
FEW_POINTS: Final = 1_500
"""Of the cloud, for the way from a start."""
MOST_POINTS: Final = 20_000
"""Of the cloud, for the result."""
ENOUGH: Final = 7
"""Starts after which no more are made when all of them, one along and about each axis, ended at one place."""
CELL: Final = 0.03
"""m, of the grid on which is decided what of the cloud may be the robot."""
FEW_RAYS: Final = 12_000
TILES: Final = 40
"""Of the picture's width, each counted as one independent measurement."""
TOLERANCE: Final = (0.008, 0.006)
"""A depth confirms the model when it differs by no more than the first, m, and the second times its square."""
APART: Final = (0.004, 0.012)
"""m and rad beyond which two ends of the search are different ones."""
FEW_IN_TILE: Final = 8
"""Rays of a tile below which its mean says nothing."""


class Compared(NamedTuple):
    """Model and picture, as parts of the rays on which the model would be seen and the picture has a depth."""

    confirmed: float
    occluded: float
    contradicted: float
    rays: int
    uneven: float = 0.0
    """m: rms over tiles of the picture of how far the model's surface is from what is seen there on the average."""

    @property
    def score(self) -> float:
        """Give what is the larger the better an end of the search is."""
        return self.confirmed - self.contradicted


class End(NamedTuple):
    """Where starts of the search ended, how many of them, and what the picture says of it."""

    fit: Fit
    compared: Compared
    starts: int


class Search:
    """The cloud near the model, and what is found from the starts around the assumed pose."""

    def __init__(
        self, surface: RobotSurface, view: DepthView, start: Floats, within: float, angle_within: float
    ) -> None:
        self._surface, self._view, self._start = surface, view, start
        self._within, self._angle_within = within, angle_within
        self._model = Model(surface)
        self._random = np.random.default_rng(0)  # the same picture gives the same result
        rows, columns = np.nonzero(view.depth)
        cloud = view.points()
        low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
        margin = self._within + self._angle_within * float(np.linalg.norm(np.maximum(-low, high)))
        based = cloud @ start[:3, :3].T + start[:3, 3]
        chosen = np.flatnonzero(((based > low - margin) & (based < high + margin)).all(axis=1))
        near = np.zeros(len(cloud), dtype=np.bool_)
        near[chosen[self._may_be(based[chosen])]] = True
        for normal, offset in planes(cloud[~near], self._random):  # a table, a wall: robots stand on them
            near &= np.abs(cloud @ normal - offset) > plane_thickness(cloud)
        chosen = np.flatnonzero(near)
        if len(chosen) < LEAST_POINTS:
            raise CalibrationRefused(
                f"The camera sees hardly anything where {surface.name} is taken to stand. Does it look there, and are"
                " its pose and the robot's right to a few centimetres?",
                f"{len(chosen)} of {len(cloud)} points are near the model; {LEAST_POINTS} are the least",
                Reason.NO_OVERLAP,
            )
        if len(chosen) > MOST_POINTS:
            chosen = self._random.choice(chosen, MOST_POINTS, replace=False)
        self._cloud = cloud[chosen]
        self._tile = max(1, view.depth.shape[1] // TILES)
        self.tiles = (rows[chosen] // self._tile) * (TILES + 2) + columns[chosen] // self._tile
        self.starts = 0

    def _may_be(self, points: Floats) -> npt.NDArray[np.bool_]:
        """Tell which points (n, 3, in the base frame) may be the robot's; each cell of a grid is asked once."""
        if not len(points):
            return np.zeros(0, dtype=np.bool_)
        corner = points.min(axis=0)
        cells = ((points - corner) / CELL).astype(np.int64)
        counts = cells.max(axis=0) + 1
        flat, where = np.unique(np.ravel_multi_index(tuple(cells.T), tuple(counts)), return_inverse=True)
        centres = corner + (np.stack(np.unravel_index(flat, tuple(counts)), axis=-1) + 0.5) * CELL
        allowed = self._within + self._angle_within * np.linalg.norm(centres, axis=1) + CELL
        return np.asarray((self._model.distance(centres.astype(np.float64)) < allowed)[where.reshape(-1)])

    def ends(self) -> list[End]:
        """Search from all starts; give the different ends, the best first. Raises CalibrationRefused: there is none."""
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
            if found[0][1] == self.starts == ENOUGH:  # they came from all sides to one place
                break
        compared = [(fit, count, self.compare(fit.base_from_camera, FEW_RAYS)) for fit, count in found]
        compared.sort(key=lambda each: -each[2].score)
        ends: list[End] = []
        for fit, count, _ in compared[:4]:
            finer = refine(self._model, some, fit.base_from_camera, NEAR)
            if finer is None:
                continue
            same = next((i for i, end in enumerate(ends) if _near(finer, end.fit, 1.0)), None)
            if same is None:
                ends.append(End(finer, self.compare(finer.base_from_camera, FEW_RAYS), count))
            else:
                ends[same] = ends[same]._replace(starts=ends[same].starts + count)
        if not ends:
            raise self._unlike(f"none of {self.starts} starts came to an end")
        return sorted(ends, key=lambda end: -end.compared.score)

    def last(self, fit: Fit) -> Fit:
        """Give the result from all points. Raises CalibrationRefused: nothing is near."""
        best = refine(self._model, self._cloud, fit.base_from_camera, (Stage(REACH[1], 12),))
        if best is not None:
            sigma = 1.4826 * float(np.median(np.abs(best.errors)))
            reach = float(np.clip(FITTING * sigma, *REACH))
            best = refine(self._model, self._cloud, best.base_from_camera, (Stage(reach, 25),))
        if best is None:
            raise self._unlike("nothing near enough was left in the end")
        return best

    def _unlike(self, detail: str) -> CalibrationRefused:
        return CalibrationRefused(
            f"What the camera sees near the assumed place of {self._surface.name} does not look like it.",
            detail,
            Reason.NO_OVERLAP,
        )

    def compare(self, base_from_camera: Floats, most_rays: int) -> Compared:
        """Compare model and picture."""
        stride = self._stride(most_rays)
        rays = self._view.rays[::stride, ::stride].reshape(-1, 3)
        seen = self._view.seen[::stride, ::stride].reshape(-1)
        expected, normals = self._model.render(base_from_camera, rays)
        both = np.isfinite(expected) & (seen > 0)
        count = int(np.count_nonzero(both))
        if not count:
            return Compared(0.0, 0.0, 0.0, 0)
        farther = seen[both] - expected[both]
        allowed = TOLERANCE[0] + TOLERANCE[1] * expected[both] ** 2
        nearer, beyond = float(np.mean(farther < -allowed)), float(np.mean(farther > allowed))
        slope = np.abs(np.einsum("ij,ij->i", normals[both], rays[both] @ base_from_camera[:3, :3].T))
        confirmed = (np.abs(farther) <= allowed) & (slope > 2.0 * GRAZING)
        rows, columns = np.divmod(np.flatnonzero(both)[confirmed], self._view.seen[::stride, ::stride].shape[1])
        tile = max(1, self._tile // stride)
        uneven = _uneven((farther * slope)[confirmed], (rows // tile) * (TILES + 2) + columns // tile)
        return Compared(1.0 - nearer - beyond, nearer, beyond, count, uneven)

    def _stride(self, most_rays: int) -> int:
        return max(1, math.ceil(math.sqrt(self._view.depth.size / most_rays)))

    def _rays(self, most_rays: int) -> Floats:
        stride = self._stride(most_rays)
        return self._view.rays[::stride, ::stride].reshape(-1, 3)

    def _offsets(self) -> list[Floats]:
        """Give the starts, as motions in the base frame: none, and to both sides along and about every axis."""
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


def _near(one: Fit, other: Fit, times: float) -> bool:
    between = one.base_from_camera @ np.linalg.inv(other.base_from_camera)
    at_middle = between[:3, :3] @ one.centre + between[:3, 3] - one.centre
    return float(np.linalg.norm(at_middle)) < times * APART[0] and angle_of(between[:3, :3]) < times * APART[1]


def angle_of(matrix: Floats) -> float:
    """Give the angle of a rotation matrix, rad, 0..pi."""
    sine = np.linalg.norm([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    return float(math.atan2(float(sine), float(np.trace(matrix)) - 1.0))
