"""Search for the pose in which a tool points straight down with the smallest joint changes."""

import asyncio
import math
from typing import Final

import structlog

from arcor2_hw.data.geometry import Orientation, Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.rpc import InverseKinematicsArgs, SetEefPerpendicularToWorldArgs
from arcor2_server.errors import RequestRefused
from arcor2_server.hosts.process import CellError
from arcor2_server.online.motion import RobotMotion
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.workspace.robots import optional

log = structlog.get_logger(__name__)

DOWN: Final = Orientation(1, 0, 0, 0)
"""Orientation of a tool whose z axis points down."""
CHECKED_YAWS: Final = 360
"""Number of checked angles about the vertical."""
SEARCH_TIMEOUT: Final = 10.0
"""Time limit of the search, s. A slow controller answers fifty requests per second."""
_POSE_INDEPENDENT: Final = frozenset({"connection_lost", "device_timeout", "not_connected", "not_implemented"})
"""Codes of errors that do not depend on the pose. They end the search."""


def yaw_of(tool: Orientation) -> float:
    """Return the rotation of DOWN about the vertical that is nearest to `tool`, rad."""
    turned = tool * DOWN.inverted()
    return 2 * math.atan2(turned.z, turned.w)


def yaws(first: float) -> list[float]:
    """Return the angles to check, rad, ordered by distance from the first one."""
    step = 2 * math.pi / CHECKED_YAWS
    return [first + step * ((number + 1) // 2) * (1 if number % 2 else -1) for number in range(CHECKED_YAWS)]


def joint_change(before: list[Joint], after: list[Joint]) -> float:
    """Return the sum of the absolute changes of the joints in both lists, rad or m."""
    values = {joint.name: joint.value for joint in before}
    return sum(abs(joint.value - values[joint.name]) for joint in after if joint.name in values)


async def find_perpendicular_pose(
    online: OnlineScene, motion: RobotMotion, args: SetEefPerpendicularToWorldArgs
) -> Pose:
    """Return the reachable pose at the present position with the tool down and the smallest joint changes.

    Raises:
        RequestRefused: no such pose is reachable.
        CellError: the robot cannot answer.
    """
    arm_id = optional(args.arm_id)
    present = await online.end_effector_pose(args.robot_id, args.end_effector_id, arm_id)
    start_joints = await online.robot_joints(args.robot_id, arm_id)
    clock = asyncio.get_running_loop().time
    deadline = clock() + SEARCH_TIMEOUT
    best: tuple[float, Pose] | None = None
    refusal: CellError | str = ""
    for yaw in yaws(yaw_of(present.orientation)):
        pose = Pose(present.position, Orientation.from_rotation_vector(0, 0, yaw) * DOWN)
        request = InverseKinematicsArgs(
            args.robot_id,
            args.end_effector_id,
            pose,
            start_joints=start_joints,
            avoid_collisions=args.safe,
            arm_id=args.arm_id,
        )
        try:
            joints = await motion.solve_inverse(request)
        except CellError as error:
            if error.code in _POSE_INDEPENDENT:
                raise
            refusal = error
        else:
            change = joint_change(start_joints, joints)
            if best is None or change < best[0]:
                best = change, pose
        if clock() > deadline:
            log.warning("search for an angle ended early", robot=args.robot_id, within=SEARCH_TIMEOUT)
            break
    if best is None:
        raise RequestRefused("The tool cannot point straight down here: {refusal}", refusal=refusal)
    return best[1]
