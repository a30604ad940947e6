"""Where a robot stands, from an RGB-D camera: the depth picture registered onto the robot's model.

The robot's surface in its measured joint state is rendered from the camera; the averaged and filtered cloud is
registered onto what can be seen of it, point to plane with Tukey's kernel, from several starts; what comes out is
compared with the picture once more, pixel by pixel, and refused where the two disagree.
"""

import math
import time
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.depth import DepthPictures, look
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.registration import Fit
from arcor2_hw.calibration.results import Grade, RobotPose
from arcor2_hw.calibration.robot_search import Compared, End, Search, angle_of
from arcor2_hw.calibration.surface import RobotSurface
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import InvalidData

Floats = npt.NDArray[np.float64]

MANY_RAYS: Final = 60_000
ALIKE: Final = 0.93
"""Of the best end's score that makes another one as good."""
UNEVEN: Final = (0.0015, 0.012)
"""m of unevenness up to which a result is good, and from which on it is none."""
LEAST_KNOWN: Final = 0.05
"""Of a motion in the worst direction that distances have to show."""
FLOOR: Final = (4e-4, math.radians(0.05))
"""Standard deviation, m and rad, that no number of points takes away: what noise does at curved surfaces and edges, and
a lens that is known to 0.05 %."""
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
    search = Search(surface, view, start, limits.within, limits.angle_within)
    ends = search.ends()
    best = search.last(ends[0].fit)
    compared = search.compare(best.base_from_camera, MANY_RAYS)
    _refuse_disagreement(surface, compared, best, limits)
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
    _refuse_unsettled(surface, best, start, limits)
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


def _refuse_disagreement(surface: RobotSurface, found: Compared, fit: Fit, limits: RobotPoseOptions) -> None:
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
    moved, turned = float(np.linalg.norm(off[:3, 3])), angle_of(off[:3, :3])
    if moved > 1.5 * limits.within or turned > 1.5 * limits.angle_within:
        raise CalibrationRefused(
            f"{surface.name} was found {moved * 1e3:.0f} mm and {math.degrees(turned):.1f}° from where it was taken to"
            " stand, farther than was searched: put it nearer in the scene, and calibrate again.",
            f"searched: {limits.within * 1e3:.0f} mm and {math.degrees(limits.angle_within):.1f}°",
            Reason.NOT_CONVERGED,
        )


def _refuse_ambiguous(surface: RobotSurface, ends: list[End]) -> None:
    best, *others = ends
    for other in others:
        if other.compared.score >= ALIKE * best.compared.score and other.fit.residual <= 1.3 * best.fit.residual:
            between = other.fit.base_from_camera @ np.linalg.inv(best.fit.base_from_camera)
            at_middle = between[:3, :3] @ best.fit.centre + between[:3, 3] - best.fit.centre
            raise CalibrationRefused(
                f"Two poses of {surface.name} explain the picture equally well,"
                f" {np.linalg.norm(at_middle) * 1e3:.0f} mm and {math.degrees(angle_of(between[:3, :3])):.1f}° apart:"
                " another joint state or another place of the camera tells them apart.",
                f"scores {best.compared.score:.3f} and {other.compared.score:.3f}",
                Reason.AMBIGUOUS,
            )


def _verdict(name: str, found: Compared, deviations: tuple[float, ...], moved: float, turned: float) -> str:
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
