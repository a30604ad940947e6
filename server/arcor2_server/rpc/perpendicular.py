"""The request that points a tool straight down (protocol, 7.5)."""

import asyncio
import math
from typing import Final

import structlog

from arcor2_hw.data.geometry import Orientation, Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.rpc import InverseKinematicsArgs, SetEefPerpendicularToWorldArgs
from arcor2_server.collaboration.locks import Locks
from arcor2_server.errors import RequestRefused
from arcor2_server.hosts.process import CellError
from arcor2_server.online.motion import (
    RobotMotion,
    require_speed,
)
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.rpc.robot_motion import RobotMotionRequests, pose_motion
from arcor2_server.workspace.robots import optional

log = structlog.get_logger(__name__)

DOWN: Final = Orientation(1, 0, 0, 0)
"""A tool whose z axis points down."""
YAWS: Final = 360
"""Number of checked angles about the vertical."""
SEARCH_WITHIN: Final = 10.0
"""Time limit of the search, s; a slow controller answers fifty requests per second."""
_GONE: Final = frozenset({"connection_lost", "device_timeout", "not_connected", "not_implemented"})
"""Codes of errors that do not depend on the pose; they end the search."""


def yaw_of(tool: Orientation) -> float:
    """Return the angle about the vertical by which a tool has to be turned from DOWN to come nearest to `tool`, rad."""
    turned = tool * DOWN.inverted()
    return 2 * math.atan2(turned.z, turned.w)


def yaws(first: float) -> list[float]:
    """Return the angles to look at, rad, those nearest to the first one first."""
    step = 2 * math.pi / YAWS
    return [first + step * ((number + 1) // 2) * (1 if number % 2 else -1) for number in range(YAWS)]


def joint_change(before: list[Joint], after: list[Joint]) -> float:
    """Return the sum of the changes of all joints that both name, rad or m."""
    values = {joint.name: joint.value for joint in before}
    return sum(abs(joint.value - values[joint.name]) for joint in after if joint.name in values)


class PerpendicularRequests:
    """The request that turns a tool straight down (protocol, 7.5)."""

    def __init__(
        self, locks: Locks, online: OnlineScene, motion: RobotMotion, robot_motion_requests: RobotMotionRequests
    ) -> None:
        self._locks = locks
        self._online = online
        self._motion = motion
        self._robot_motion_requests = robot_motion_requests

    @rpc("SetEefPerpendicularToWorld")
    async def set_eef_perpendicular_to_world(self, context: Context, args: SetEefPerpendicularToWorldArgs) -> None:
        """Turn the tool down where it is, by the angle about the vertical that changes the joints least."""
        arm_id = optional(args.arm_id)
        cell = self._motion.require_robot_online(args.robot_id)
        self._locks.require_held(context.user, args.robot_id)
        require_speed(args.speed)
        await self._motion.require_ready(args.robot_id, "move_to_pose", arm_id)
        for feature in ("inverse_kinematics", "forward_kinematics"):
            self._motion.require_feature(args.robot_id, feature)
        if not context.dry_run:
            await self._motion.take_control(args.robot_id, arm_id)
        present = await cell.end_effector_pose(args.robot_id, args.end_effector_id, arm_id)
        target = await self._nearest(context, args, present)
        await self._motion.require_ready(args.robot_id, "move_to_pose", arm_id)
        if context.dry_run:
            return
        arguments, event_data = pose_motion(args, target)
        arguments |= cell.arm(args.robot_id, arm_id)
        self._robot_motion_requests.begin_motion(
            context, args.robot_id, "move_to_pose", arguments, "RobotMoveToPose", event_data
        )

    async def _nearest(self, context: Context, args: SetEefPerpendicularToWorldArgs, present: Pose) -> Pose:
        """Return the reachable pose with tool down and smallest joint changes; raise RequestRefused if none exists."""
        cell = self._online
        here = await cell.robot_joints(args.robot_id, optional(args.arm_id))
        clock = asyncio.get_running_loop().time
        began = clock()
        best: tuple[float, Pose] | None = None
        refusal = ""
        for yaw in yaws(yaw_of(present.orientation)):
            pose = Pose(present.position, Orientation.from_rotation_vector(0, 0, yaw) * DOWN)
            question = InverseKinematicsArgs(
                args.robot_id,
                args.end_effector_id,
                pose,
                start_joints=here,
                avoid_collisions=args.safe,
                arm_id=args.arm_id,
            )
            try:
                joints = await self._motion.solve_inverse(question)
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
            raise RequestRefused("The tool cannot point straight down here: {refusal}", refusal=refusal)
        return best[1]
