"""Where a robot stands, from an RGB-D camera: the depth picture registered onto the robot's model.

The robot's surface in its measured joint state is rendered from the camera; the averaged and filtered cloud is
registered onto what can be seen of it, point to plane with Tukey's kernel, from several starts; what comes out is
compared with the picture once more, pixel by pixel, and refused where the two disagree.
"""

import itertools
import math
import time
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.depth import LEAST_POINTS, DepthPictures, DepthView, look, plane_thickness, planes
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.registration import GRAZING, Fit, Model, Stage, approach, refine, rotation
from arcor2_hw.calibration.results import Grade, RobotPose
from arcor2_hw.calibration.surface import RobotSurface
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import InvalidData

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
CELL: Final = 0.03
"""m, of the grid on which is decided what of the cloud may be the robot."""
FEW_RAYS: Final = 12_000
MANY_RAYS: Final = 60_000
TILES: Final = 40
"""Of the picture's width, each counted as one independent measurement."""
TOLERANCE: Final = (0.008, 0.006)
"""A depth confirms the model when it differs by no more than the first, m, and the second times its square."""
APART: Final = (0.004, 0.012)
"""m and rad beyond which two ends of the search are different ones."""
ALIKE: Final = 0.93
"""Of the best end's score that makes another one as good."""
FEW_IN_TILE: Final = 8
"""Rays of a tile below which its mean says nothing."""
UNEVEN: Final = (0.0025, 0.012)
"""m of unevenness up to which a result is good, and from which on it is none."""
LEAST_KNOWN: Final = 0.05
"""Of a motion in the worst direction that distances have to show."""
LEAST_AGREED: Final = 2
FLOOR: Final = (3e-4, math.radians(0.04))
"""Standard deviation, m and rad, that no number of points takes away: what noise does at curved surfaces and edges."""
GOOD: Final = (0.0015, math.radians(0.25))
"""Standard deviation, m and rad, up to which a result is good."""
SETTLED: Final = 2e-4
"""m: a last step that was longer has not come to an end."""


@dataclass(frozen=True)
class RobotPoseOptions:
    """How far to look for the robot (m, rad) and what to demand of a result.

    within and angle_within: how far the assumed pose may be off. least_fitness: part of the visible surface that the
    picture has to confirm, 0..1; most_contradicted: part of it through which the picture sees something farther away.
    most_deviation (m) and most_angle_deviation (rad): standard deviation of the worst known direction beyond which a
    view is refused. Raises InvalidData for numbers that make no sense.
    """

    within: float = 0.08
    angle_within: float = 0.14
    least_fitness: float = 0.5
    most_contradicted: float = 0.1
    most_deviation: float = 0.005
    most_angle_deviation: float = 0.015

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            if not 0.0 < getattr(self, name) <= 1.0:
                raise InvalidData(f"{name} of a robot's pose is more than 0 and at most 1, not {getattr(self, name)}.")


class _Compared(NamedTuple):
    """Model and picture, as parts of the rays on which the model would be seen and the picture has a depth."""

    confirmed: float
    occluded: float
    contradicted: float
    rays: int
    uneven: float = 0.0
    """m: rms over tiles of the picture of how far the model's surface is from what is seen there on the average."""

    @property
    def score(self) -> float:
        return self.confirmed - self.contradicted


def find_robot_pose(
    surface: RobotSurface,
    depth: DepthPictures,
    parameters: CameraParameters,
    camera_pose: Pose,
    assumed: Pose,
    options: RobotPoseOptions | None = None,
) -> RobotPose:
    """Find the pose of a robot's base in the world.

    Args:
        surface: of the robot in the joint state in which the picture was taken.
        depth: of the colour camera's view, one picture or several of which the mean is taken.
        parameters: of the lens, for the size of the pictures.
        camera_pose: world_from_camera, of the optical frame (x right, y down, z forward).
        assumed: world_from_base, at most `options.within` and `options.angle_within` off.
        options: limits.

    Raises:
        InvalidData: a depth picture of the wrong size or kind, parameters that are none.
        CalibrationRefused: too few points, no overlap, not converged, ambiguous, or a direction is left free.
    """
    began = time.monotonic()
    limits = options or RobotPoseOptions()
    world_from_camera = camera_pose.matrix()
    start = np.linalg.inv(assumed.matrix()) @ world_from_camera
    view = look(depth, parameters)
    search = _Search(surface, view, start, limits)
    ends = search.ends()
    best = search.last(ends[0].fit)
    compared = search.compare(best.base_from_camera, MANY_RAYS)
    _refuse_disagreement(surface, compared, best, limits)
    _refuse_unsettled(surface, best, start, limits)
    covariance = best.covariance(search.tiles) + np.diag([FLOOR[0] ** 2] * 3 + [FLOOR[1] ** 2] * 3)
    deviations = tuple(
        float(np.sqrt(np.linalg.eigvalsh(part)[-1])) for part in (covariance[:3, :3], covariance[3:, 3:])
    )
    known = best.least_known()
    if known < LEAST_KNOWN or deviations[0] > limits.most_deviation or deviations[1] > limits.most_angle_deviation:
        raise CalibrationRefused(
            f"The camera's view leaves a motion of {surface.name} open: another joint state or another place of the"
            " camera, from which more of it is seen, settles it.",
            f"standard deviation {deviations[0] * 1e3:.1f} mm, {math.degrees(deviations[1]):.2f}°; known {known:.3f}",
            Reason.UNOBSERVABLE,
        )
    pose = Pose.from_matrix(world_from_camera @ np.linalg.inv(best.base_from_camera))
    moved, turned = pose.position.distance_to(assumed.position), pose.orientation.angle_to(assumed.orientation)
    _refuse_ambiguous(surface, ends)
    agreed = ends[0].starts
    good = (
        deviations[0] <= GOOD[0]
        and deviations[1] <= GOOD[1]
        and compared.uneven <= UNEVEN[0]
        and compared.contradicted <= limits.most_contradicted / 2.0
    )
    return RobotPose(
        pose=pose,
        grade=Grade.GOOD if good else Grade.USABLE,
        verdict=_verdict(surface.name, compared, deviations, moved, turned),
        fitness=compared.confirmed,
        occluded=compared.occluded,
        uneven=compared.uneven,
        residual=best.residual,
        points=int(np.count_nonzero(best.weights)),
        covariance=covariance.tolist(),
        position_deviation=deviations[0],
        orientation_deviation=deviations[1],
        moved=moved,
        turned=turned,
        starts=search.starts,
        agreed=agreed,
        seconds=time.monotonic() - began,
    )


class _End(NamedTuple):
    """Where starts of the search ended, how many of them, and what the picture says of it."""

    fit: Fit
    compared: _Compared
    starts: int


class _Search:
    """The cloud near the model, and what is found from the starts around the assumed pose."""

    def __init__(self, surface: RobotSurface, view: DepthView, start: Floats, limits: RobotPoseOptions) -> None:
        self._surface, self._view, self._start, self._limits = surface, view, start, limits
        self._model = Model(surface)
        self._random = np.random.default_rng(0)  # the same picture gives the same result
        rows, columns = np.nonzero(view.depth)
        cloud = view.points()
        low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
        margin = limits.within + limits.angle_within * float(np.linalg.norm(np.maximum(-low, high)))
        based = cloud @ start[:3, :3].T + start[:3, 3]
        chosen = np.flatnonzero(((based > low - margin) & (based < high + margin)).all(axis=1))
        near = np.zeros(len(cloud), dtype=np.bool_)
        near[chosen[self._within(based[chosen], limits)]] = True
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

    def _within(self, points: Floats, limits: RobotPoseOptions) -> npt.NDArray[np.bool_]:
        """Tell which points (n, 3, in the base frame) may be the robot's; each cell of a grid is asked once."""
        if not len(points):
            return np.zeros(0, dtype=np.bool_)
        corner = points.min(axis=0)
        cells = ((points - corner) / CELL).astype(np.int64)
        counts = cells.max(axis=0) + 1
        flat, where = np.unique(np.ravel_multi_index(tuple(cells.T), tuple(counts)), return_inverse=True)
        centres = corner + (np.stack(np.unravel_index(flat, tuple(counts)), axis=-1) + 0.5) * CELL
        allowed = limits.within + limits.angle_within * np.linalg.norm(centres, axis=1) + CELL
        return np.asarray((self._model.distance(centres.astype(np.float64)) < allowed)[where.reshape(-1)])

    def ends(self) -> list[_End]:
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
        compared = [(fit, count, self.compare(fit.base_from_camera, FEW_RAYS)) for fit, count in found]
        compared.sort(key=lambda each: -each[2].score)
        ends: list[_End] = []
        for fit, count, _ in compared[:4]:
            finer = refine(self._model, some, fit.base_from_camera, NEAR)
            if finer is None:
                continue
            same = next((i for i, end in enumerate(ends) if _near(finer, end.fit, 1.0)), None)
            if same is None:
                ends.append(_End(finer, self.compare(finer.base_from_camera, FEW_RAYS), count))
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

    def compare(self, base_from_camera: Floats, most_rays: int) -> _Compared:
        """Compare model and picture."""
        stride = self._stride(most_rays)
        rays = self._view.rays[::stride, ::stride].reshape(-1, 3)
        seen = self._view.seen[::stride, ::stride].reshape(-1)
        expected, normals = self._model.render(base_from_camera, rays)
        both = np.isfinite(expected) & (seen > 0)
        count = int(np.count_nonzero(both))
        if not count:
            return _Compared(0.0, 0.0, 0.0, 0)
        farther = seen[both] - expected[both]
        allowed = TOLERANCE[0] + TOLERANCE[1] * expected[both] ** 2
        nearer, beyond = float(np.mean(farther < -allowed)), float(np.mean(farther > allowed))
        slope = np.abs(np.einsum("ij,ij->i", normals[both], rays[both] @ base_from_camera[:3, :3].T))
        confirmed = (np.abs(farther) <= allowed) & (slope > 2.0 * GRAZING)
        rows, columns = np.divmod(np.flatnonzero(both)[confirmed], self._view.seen[::stride, ::stride].shape[1])
        tile = max(1, self._tile // stride)
        uneven = _uneven((farther * slope)[confirmed], (rows // tile) * (TILES + 2) + columns // tile)
        return _Compared(1.0 - nearer - beyond, nearer, beyond, count, uneven)

    def _stride(self, most_rays: int) -> int:
        return max(1, math.ceil(math.sqrt(self._view.depth.size / most_rays)))

    def _rays(self, most_rays: int) -> Floats:
        stride = self._stride(most_rays)
        return self._view.rays[::stride, ::stride].reshape(-1, 3)

    def _offsets(self) -> list[Floats]:
        """Give the starts, as motions in the base frame: none, and to both sides along and about every axis."""
        offsets = [np.eye(4)]
        for axis, sign in itertools.product(np.eye(3), (1.0, -1.0)):
            along, about = np.eye(4), np.eye(4)
            along[:3, 3] = sign * 0.6 * self._limits.within * axis
            about[:3, :3] = rotation(sign * 0.6 * self._limits.angle_within * axis)
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
    return float(np.linalg.norm(at_middle)) < times * APART[0] and _angle(between[:3, :3]) < times * APART[1]


def _angle(matrix: Floats) -> float:
    sine = np.linalg.norm([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    return float(math.atan2(float(sine), float(np.trace(matrix)) - 1.0))


def _refuse_disagreement(surface: RobotSurface, found: _Compared, fit: Fit, limits: RobotPoseOptions) -> None:
    figures = (
        f"confirmed {found.confirmed:.0%}, hidden {found.occluded:.0%}, contradicted {found.contradicted:.0%} of"
        f" {found.rays} rays; residual {fit.residual * 1e3:.1f} mm, uneven by {found.uneven * 1e3:.1f} mm"
    )
    if found.contradicted > limits.most_contradicted or found.uneven > UNEVEN[1]:
        raise CalibrationRefused(
            f"The camera sees through where {surface.name} would be: it stands elsewhere, its joints are others than"
            " told, or the model is of another robot.",
            figures,
            Reason.NOT_CONVERGED,
        )
    if found.confirmed < limits.least_fitness:
        raise CalibrationRefused(
            f"Too little of {surface.name} was recognised: something stands before it, it stands elsewhere, or the"
            " model is of another robot.",
            figures,
            Reason.NOT_CONVERGED,
        )


def _refuse_unsettled(surface: RobotSurface, best: Fit, start: Floats, limits: RobotPoseOptions) -> None:
    if best.moved > SETTLED:
        raise CalibrationRefused(
            f"The search for {surface.name} did not settle.",
            f"the last step was {best.moved * 1e3:.2f} mm",
            Reason.NOT_CONVERGED,
        )
    off = best.base_from_camera @ np.linalg.inv(start)
    moved, turned = float(np.linalg.norm(off[:3, 3])), _angle(off[:3, :3])
    if moved > 1.5 * limits.within or turned > 1.5 * limits.angle_within:
        raise CalibrationRefused(
            f"{surface.name} was found {moved * 1e3:.0f} mm and {math.degrees(turned):.1f}° from where it was taken to"
            " stand, farther than was searched: put it nearer in the scene, and calibrate again.",
            f"searched: {limits.within * 1e3:.0f} mm and {math.degrees(limits.angle_within):.1f}°",
            Reason.NOT_CONVERGED,
        )


def _refuse_ambiguous(surface: RobotSurface, ends: list[_End]) -> None:
    best, *others = ends
    for other in others:
        if other.compared.score >= ALIKE * best.compared.score and other.fit.residual <= 1.3 * best.fit.residual:
            between = other.fit.base_from_camera @ np.linalg.inv(best.fit.base_from_camera)
            at_middle = between[:3, :3] @ best.fit.centre + between[:3, 3] - best.fit.centre
            raise CalibrationRefused(
                f"Two poses of {surface.name} explain the picture equally well,"
                f" {np.linalg.norm(at_middle) * 1e3:.0f} mm and {math.degrees(_angle(between[:3, :3])):.1f}° apart:"
                " another joint state or another place of the camera tells them apart.",
                f"scores {best.compared.score:.3f} and {other.compared.score:.3f}",
                Reason.AMBIGUOUS,
            )


def _verdict(name: str, found: _Compared, deviations: tuple[float, ...], moved: float, turned: float) -> str:
    sentence = (
        f"{name} stands {moved * 1e3:.0f} mm and {math.degrees(turned):.1f}° from where it was taken to; this is known"
        f" to {deviations[0] * 1e3:.1f} mm and {math.degrees(deviations[1]):.2f}°."
        f" The picture confirms {found.confirmed:.0%} of what should be seen."
    )
    if found.uneven > UNEVEN[0]:
        sentence += f" Parts of it are {found.uneven * 1e3:.0f} mm off: are the joints and the model the robot's?"
    if found.occluded > 0.2:
        sentence += f" {found.occluded:.0%} is hidden by something else."
    return sentence
