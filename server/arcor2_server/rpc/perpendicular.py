"""The request that turns a tool straight down (protocol, 7.5)."""

import asyncio
import math
from typing import Final

import structlog

from arcor2_hw.data.geometry import Orientation, Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.rpc import InverseKinematicsArgs, SetEefPerpendicularToWorldArgs
from arcor2_server.errors import RequestRefused
from arcor2_server.hosts.process import CellError
from arcor2_server.online.motion import require_feature, require_ready, require_speed, take_control
from arcor2_server.rpc.editing import optional
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.rpc.robot import begin_motion, pose_motion, require_robot_online, solve_inverse

log = structlog.get_logger(__name__)

DOWN: Final = Orientation(1, 0, 0, 0)
"""A tool whose z axis points down."""
YAWS: Final = 360
"""Angles about the vertical that are looked at."""
SEARCH_WITHIN: Final = 10.0
"""Seconds after which the best of what was looked at is taken; a slow controller answers fifty questions in one."""
_GONE: Final = frozenset({"connection_lost", "device_timeout", "not_connected", "not_implemented"})
"""Codes of errors that say nothing of the pose: asking again is of no use."""


@rpc("SetEefPerpendicularToWorld")
async def set_eef_perpendicular_to_world(context: Context, args: SetEefPerpendicularToWorldArgs) -> None:
    """Turn the tool down where it is, by the angle about the vertical that changes the joints least."""
    services, arm_id = context.services, optional(args.arm_id)
    cell = require_robot_online(context, args.robot_id)
    services.locks.require_held(context.user, args.robot_id)
    require_speed(args.speed)
    await require_ready(services, args.robot_id, "move_to_pose", arm_id)
    for feature in ("inverse_kinematics", "forward_kinematics"):
        require_feature(services, args.robot_id, feature)
    if not context.dry_run:
        await take_control(services, args.robot_id, arm_id)
    present = await cell.end_effector_pose(args.robot_id, args.end_effector_id, arm_id)
    target = await _nearest(context, args, present)
    await require_ready(services, args.robot_id, "move_to_pose", arm_id)
    if context.dry_run:
        return
    arguments, told = pose_motion(args, target)
    arguments |= cell.arm(args.robot_id, arm_id)
    begin_motion(context, args.robot_id, "move_to_pose", arguments, "RobotMoveToPose", told)


def yaw_of(tool: Orientation) -> float:
    """Give the angle about the vertical by which a tool has to be turned from DOWN to come nearest to `tool`, rad."""
    turned = tool * DOWN.inverted()
    return 2 * math.atan2(turned.z, turned.w)


def yaws(first: float) -> list[float]:
    """Give the angles to look at, rad, those nearest to the first one first."""
    step = 2 * math.pi / YAWS
    return [first + step * ((number + 1) // 2) * (1 if number % 2 else -1) for number in range(YAWS)]


async def _nearest(context: Context, args: SetEefPerpendicularToWorldArgs, present: Pose) -> Pose:
    """Give the reachable pose, tool down, with the smallest sum of joint changes; RequestRefused when there is none."""
    cell = context.services.cell
    here = await cell.robot_joints(args.robot_id, optional(args.arm_id))
    clock = asyncio.get_running_loop().time
    began = clock()
    best: tuple[float, Pose] | None = None
    refusal = ""
    for yaw in yaws(yaw_of(present.orientation)):
        pose = Pose(present.position, Orientation.from_rotation_vector(0, 0, yaw) * DOWN)
        question = InverseKinematicsArgs(
            args.robot_id, args.end_effector_id, pose, start_joints=here, avoid_collisions=args.safe, arm_id=args.arm_id
        )
        try:
            joints = await solve_inverse(context, question)
        except CellError as error:
            if error.code in _GONE:
                raise
            refusal = str(error)
        else:
            change = joint_change(here, joints)
            if best is None or change < best[0]:
                best = change, pose
        if clock() - began > SEARCH_WITHIN:
            log.warning("search for an angle ended early", robot=args.robot_id, within=SEARCH_WITHIN)
            break
    if best is None:
        raise RequestRefused(f"The tool cannot point straight down here: {refusal}")
    return best[1]


def joint_change(before: list[Joint], after: list[Joint]) -> float:
    """Give the sum of the changes of all joints that both name, rad or m."""
    values = {joint.name: joint.value for joint in before}
    return sum(abs(joint.value - values[joint.name]) for joint in after if joint.name in values)
