"""The pose of a robot from an RGB-D camera: depth images registered onto the robot's model.

The robot's surface at its measured joint values is rendered from the camera. The averaged and filtered cloud is
registered onto its visible part, point to plane with Tukey's kernel, from several starts. The result is compared with
the image pixel by pixel, and refused where the two disagree.
"""

import math
import time
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.depth import DepthPictures, depth_view
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.registration import Fit
from arcor2_hw.calibration.results import Grade, RobotPose
from arcor2_hw.calibration.robot_search import Agreement, Search, SearchResult, angle_of
from arcor2_hw.calibration.surface import RobotSurface
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message

Floats = npt.NDArray[np.float64]

MANY_RAYS: Final = 60_000
AMBIGUOUS_RATIO: Final = 0.93
"""Fraction of the best score from which another result counts as equally good."""
UNEVEN: Final = (0.0015, 0.012)
"""Unevenness up to which a result is good, and from which it is refused, m."""
MIN_VISIBILITY: Final = 0.05
"""Minimum visibility of a motion in the worst direction, see `Fit.least_known`."""
MIN_DEVIATIONS: Final = (4e-4, math.radians(0.05))
"""Minimum standard deviations, m and rad.

They cover errors that more points do not reduce: curved surfaces, edges, and a lens known to 0.05 %.
"""
GOOD: Final = (0.0015, math.radians(0.25))
"""Standard deviations up to which a result is good, m and rad."""
MAX_LAST_STEP: Final = 2e-4
"""Length of the last step above which the search did not converge, m."""


@dataclass(frozen=True)
class RobotPoseOptions:
    """Limits of the search and of the result.

    Attributes:
        within: Maximum distance from the assumed pose, m.
        angle_within: Maximum angle from the assumed pose, rad.
        least_fitness: Minimum fraction of the visible surface that the image confirms, 0 to 1.
        most_contradicted: Maximum fraction of the surface through which the image shows something farther away.
        most_deviation: Maximum standard deviation of the position in the worst direction, m.
        most_angle_deviation: Maximum standard deviation of the orientation in the worst direction, rad.

    Raises:
        InvalidData: A value is out of range.
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
                raise InvalidData(
                    "{name} of a robot's pose must be above 0 and at most 1, not {value}.",
                    name=name,
                    value=getattr(self, name),
                )


def find_robot_pose(
    surface: RobotSurface,
    depth: DepthPictures,
    parameters: CameraParameters,
    camera_pose: Pose,
    assumed: Pose,
    options: RobotPoseOptions | None = None,
) -> RobotPose:
    """Find the pose of a robot's base in the world, from one joint state.

    The grade is never better than usable: a joint or a model that is slightly wrong moves the base by centimetres and
    may still fit the image. `find_robot_pose_of_states` checks them.

    Args:
        surface: The robot at the joint values of the image.
        depth: One depth image in the view of the colour camera, or several that are averaged.
        parameters: Parameters of the lens for this image size.
        camera_pose: world_from_camera, of the optical frame (x right, y down, z forward).
        assumed: world_from_base, at most `options.within` and `options.angle_within` off.
        options: Limits.

    Raises:
        InvalidData: A depth image has the wrong size or kind, or parameters are invalid.
        CalibrationRefused: Too few points, no overlap, not converged, ambiguous, or a direction is undetermined.
    """
    began = time.monotonic()
    limits = options or RobotPoseOptions()
    world_from_camera = camera_pose.matrix()
    start = np.linalg.inv(assumed.matrix()) @ world_from_camera
    view = depth_view(depth, parameters)
    search = Search(surface, view, start, limits.within, limits.angle_within)
    ends = search.ends()
    best = search.last(ends[0].fit)
    compared = search.compare(best.base_from_camera, MANY_RAYS)
    _refuse_disagreement(surface, compared, best, limits)
    covariance = best.covariance(search.tiles) + np.diag([MIN_DEVIATIONS[0] ** 2] * 3 + [MIN_DEVIATIONS[1] ** 2] * 3)
    deviations = tuple(
        float(np.sqrt(np.linalg.eigvalsh(part)[-1])) for part in (covariance[:3, :3], covariance[3:, 3:])
    )
    known = best.least_known()
    if known < MIN_VISIBILITY or deviations[0] > limits.most_deviation or deviations[1] > limits.most_angle_deviation:
        raise CalibrationRefused(
            "The view of the camera leaves a motion of {name} undetermined. Move the robot or the "
            "camera so that more of it is visible.",
            f"standard deviation {deviations[0] * 1e3:.1f} mm, {math.degrees(deviations[1]):.2f}°; known {known:.3f}",
            Reason.UNOBSERVABLE,
            name=surface.name,
        )
    _refuse_unsettled(surface, best, start, limits)
    pose = Pose.from_matrix(world_from_camera @ np.linalg.inv(best.base_from_camera))
    moved, turned = pose.position.distance_to(assumed.position), pose.orientation.angle_to(assumed.orientation)
    _refuse_ambiguous(surface, ends)
    agreed = ends[0].starts
    verdict = _verdict(surface.name, compared, deviations, moved, turned)
    return RobotPose(
        pose=pose,
        grade=Grade.USABLE,
        verdict=verdict.text,
        **verdict.translation(),
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


def _refuse_disagreement(surface: RobotSurface, found: Agreement, fit: Fit, limits: RobotPoseOptions) -> None:
    figures = (
        f"confirmed {found.confirmed:.0%}, hidden {found.occluded:.0%}, contradicted {found.contradicted:.0%} of"
        f" {found.rays} rays; residual {fit.residual * 1e3:.1f} mm, uneven by {found.uneven * 1e3:.1f} mm"
    )
    if found.contradicted > limits.most_contradicted or found.uneven > UNEVEN[1]:
        raise CalibrationRefused(
            "The camera sees through the expected place of {name}: check its pose, its joint values and its model.",
            figures,
            Reason.NOT_CONVERGED,
            name=surface.name,
        )
    if found.confirmed < limits.least_fitness:
        raise CalibrationRefused(
            "Too little of {name} was recognized. Check whether it is covered, and check its pose and its model.",
            figures,
            Reason.NOT_CONVERGED,
            name=surface.name,
        )


def _refuse_unsettled(surface: RobotSurface, best: Fit, start: Floats, limits: RobotPoseOptions) -> None:
    if best.moved > MAX_LAST_STEP:
        raise CalibrationRefused(
            "The search for {name} did not converge.",
            f"the last step was {best.moved * 1e3:.2f} mm",
            Reason.NOT_CONVERGED,
            name=surface.name,
        )
    off = best.base_from_camera @ np.linalg.inv(start)
    moved, turned = float(np.linalg.norm(off[:3, 3])), angle_of(off[:3, :3])
    if moved > 1.5 * limits.within or turned > 1.5 * limits.angle_within:
        raise CalibrationRefused(
            "{name} was found {moved:.0f} mm and {turned:.1f}° from its pose in the scene, outside of the search "
            "range. Correct its pose in the scene, then calibrate again.",
            f"searched: {limits.within * 1e3:.0f} mm and {math.degrees(limits.angle_within):.1f}°",
            Reason.NOT_CONVERGED,
            name=surface.name,
            moved=moved * 1000.0,
            turned=math.degrees(turned),
        )


def _refuse_ambiguous(surface: RobotSurface, ends: list[SearchResult]) -> None:
    best, *others = ends
    for other in others:
        if (
            other.compared.score >= AMBIGUOUS_RATIO * best.compared.score
            and other.fit.residual <= 1.3 * best.fit.residual
        ):
            between = other.fit.base_from_camera @ np.linalg.inv(best.fit.base_from_camera)
            at_middle = between[:3, :3] @ best.fit.centre + between[:3, 3] - best.fit.centre
            raise CalibrationRefused(
                "Two poses of {name} explain the image equally well, "
                "{norm:.0f} mm and {between:.1f}° "
                "apart. Move the robot or the camera, then try again.",
                f"scores {best.compared.score:.3f} and {other.compared.score:.3f}",
                Reason.AMBIGUOUS,
                name=surface.name,
                norm=np.linalg.norm(at_middle) * 1000.0,
                between=math.degrees(angle_of(between[:3, :3])),
            )


def _verdict(name: str, found: Agreement, deviations: tuple[float, ...], moved: float, turned: float) -> Message:
    parts = [
        Message.of(
            "{name} is {moved:.0f} mm and {turned:.1f}° from its assumed pose, known to {position:.1f} mm and"
            " {orientation:.2f}°. The picture confirms {confirmed:.0%} of the visible surface.",
            name=name,
            moved=moved * 1e3,
            turned=math.degrees(turned),
            position=deviations[0] * 1e3,
            orientation=math.degrees(deviations[1]),
            confirmed=found.confirmed,
        )
    ]
    if found.uneven > UNEVEN[0]:
        parts.append(
            Message.of(
                "Parts of it are {uneven:.0f} mm off: check its joints and its model.", uneven=found.uneven * 1e3
            )
        )
    if found.occluded > 0.2:
        parts.append(Message.of("{occluded:.0%} is hidden.", occluded=found.occluded))
    parts.append(Message.of("One joint state does not check the joints and the model: compare several."))
    return Message.joined(parts)
