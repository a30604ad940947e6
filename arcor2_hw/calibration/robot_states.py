"""The pose of a robot from depth images of several joint states, which check its joints and its model.

The base does not move between the states. A joint that is off, or the model of a similar robot, shifts the computed
base differently in each state, so poses that agree confirm both.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from arcor2_hw.calibration.depth import DepthPictures
from arcor2_hw.calibration.lens_check import is_misfit
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.results import Grade, RobotPose
from arcor2_hw.calibration.rigid import inverted, motion, rotation_vector, turned
from arcor2_hw.calibration.robot_pose import GOOD, UNEVEN, RobotPoseOptions, find_robot_pose
from arcor2_hw.calibration.surface import RobotSurface
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message

Floats = npt.NDArray[np.float64]

ENOUGH_STATES: Final = 3
"""Number of joint states from which a result can be good."""
MAX_STATES: Final = 20
FARTHEST: Final = (0.005, math.radians(0.7))
"""Distances of a state's pose from the mean above which a result is refused, m and rad."""


class JointState(NamedTuple):
    """The robot's surface at the joint values of a state, and the depth images of this state."""

    surface: RobotSurface
    depth: DepthPictures


def find_robot_pose_of_states(
    states: Sequence[JointState],
    parameters: CameraParameters,
    camera_pose: Pose,
    assumed: Pose,
    options: RobotPoseOptions | None = None,
) -> RobotPose:
    """Find the pose of a robot's base in the world, and check its joints and its model.

    The poses of all states are averaged, weighted by their covariances, and compared by a chi-square test. Their
    differences are added to the covariance. With one state, the result is that of `find_robot_pose`.

    Args:
        states: Joint states that differ in all joints, better three or more, with the same base and camera.
        parameters: As in `find_robot_pose`.
        camera_pose: As in `find_robot_pose`.
        assumed: As in `find_robot_pose`.
        options: As in `find_robot_pose`.

    Raises:
        InvalidData: As in `find_robot_pose`; also no state, or more than MAX_STATES.
        CalibrationRefused: As in `find_robot_pose`; also implausible (the states contradict each other).

    Source: R. Birge, "The calculation of errors by the method of least squares", Physical Review 40 (1932), for the
    comparison of results with stated deviations.
    """
    if not 1 <= len(states) <= MAX_STATES:
        raise InvalidData("1 to {most} joint states are needed, not {count}.", most=MAX_STATES, count=len(states))
    found = [find_robot_pose(each.surface, each.depth, parameters, camera_pose, assumed, options) for each in states]
    if len(found) == 1:
        return found[0]
    name = states[0].surface.name
    first = found[0].pose.matrix()
    offsets = [_vector(inverted(first) @ each.pose.matrix()) for each in found]
    weights = [np.linalg.inv(np.array(each.covariance)) for each in found]
    averaged = np.linalg.inv(np.sum(weights, axis=0))
    mean = averaged @ np.sum([weight @ offset for weight, offset in zip(weights, offsets, strict=True)], axis=0)
    rest = np.stack(offsets) - mean
    squares = float(sum(one @ weight @ one for one, weight in zip(rest, weights, strict=True)))
    freedom = 6 * (len(found) - 1)
    farthest = [float(np.linalg.norm(part, axis=1).max()) for part in (rest[:, :3], rest[:, 3:])]
    differ = {"distance": farthest[0] * 1e3, "angle": math.degrees(farthest[1])}
    if farthest[0] > FARTHEST[0] or farthest[1] > FARTHEST[1]:
        raise CalibrationRefused(
            "The joint states contradict each other: their poses of {name} differ by {distance:.1f} mm and "
            "{angle:.2f}° from the mean. Check the zero positions of its joints, its model, and that nothing moved "
            "between the images.",
            f"chi square {squares:.0f} with {freedom} degrees of freedom",
            Reason.IMPLAUSIBLE,
            name=name,
            **differ,
        )
    covariance = averaged + rest.T @ rest / (len(found) * (len(found) - 1))
    deviations = [float(np.sqrt(np.linalg.eigvalsh(part)[-1])) for part in (covariance[:3, :3], covariance[3:, 3:])]
    agree = not is_misfit(squares, freedom)
    uneven = max(each.uneven for each in found)
    good = agree and len(found) >= ENOUGH_STATES and uneven <= UNEVEN[0]
    good = good and deviations[0] <= GOOD[0] and deviations[1] <= GOOD[1]
    pose = Pose.from_matrix(first @ motion(turned(mean[3:]), mean[:3]))
    moved, angle = pose.position.distance_to(assumed.position), pose.orientation.angle_to(assumed.orientation)
    parts = [
        Message.of(
            "{name} is {moved:.0f} mm and {turned:.1f}° from its assumed pose, known to {position:.1f} mm and"
            " {orientation:.2f}°. The poses of {count} joint states differ by up to {distance:.1f} mm and {angle:.2f}°"
            " from the mean.",
            name=name,
            moved=moved * 1e3,
            turned=math.degrees(angle),
            position=deviations[0] * 1e3,
            orientation=math.degrees(deviations[1]),
            count=len(found),
            **differ,
        )
    ]
    if not agree or uneven > UNEVEN[0]:
        parts.append(Message.of("Check the zero positions of its joints and its model."))
    elif len(found) < ENOUGH_STATES:
        parts.append(Message.of("Compare {count} or more.", count=ENOUGH_STATES))
    verdict = Message.joined(parts)
    return replace(
        found[0],
        pose=pose,
        grade=Grade.GOOD if good else Grade.USABLE,
        verdict=verdict.text,
        **({"key": UNSET, "values": UNSET} | verdict.translation()),
        fitness=min(each.fitness for each in found),
        occluded=max(each.occluded for each in found),
        uneven=uneven,
        residual=max(each.residual for each in found),
        points=sum(each.points for each in found),
        covariance=covariance.tolist(),
        position_deviation=deviations[0],
        orientation_deviation=deviations[1],
        moved=moved,
        turned=angle,
        agreed=min(each.agreed for each in found),
        seconds=sum(each.seconds for each in found),
    )


def _vector(matrix: Floats) -> Floats:
    """Return position (m) and rotation vector (rad) of a small motion, (6)."""
    return np.concatenate((matrix[:3, 3], rotation_vector(matrix[:3, :3])))
