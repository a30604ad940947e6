"""Additional requests to robots and devices of the online scene (docs/protocol.md)."""

from typing import Any, Final

import structlog

from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Orientation, Position
from arcor2_hw.data.operation import HoldKind
from arcor2_hw.data.robot import RobotState, Safety
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import (
    AcknowledgeStopArgs,
    HoldHandTeachingArgs,
    JogFrame,
    JogRobotArgs,
    JogRobotData,
    RetryObjectArgs,
    StopAllData,
    StopKind,
    StreamRobotArgs,
)
from arcor2_hw.data.rpc.operation import FASTEST_STREAM
from arcor2_server.documents import Session
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.service import Execution
from arcor2_server.execution.stop_all import StopAll
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.motion import (
    RobotMotion,
)
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.workspace.robots import optional

log = structlog.get_logger(__name__)

ACKNOWLEDGED_WITHIN: Final = 30.0
"""Seconds: a controller whose safety system is restarted takes 20."""
_FRAMES: Final = {JogFrame.WORLD: "world", JogFrame.ROBOT: "base", JogFrame.TOOL: "tool", JogFrame.USER: "world"}
_AT_ITS_PLACE: Final = {
    Safety.EMERGENCY_STOP: "an emergency stop is released where it was pressed",
    Safety.SAFEGUARD_STOP: "a safeguard stop is released by its guard, which has to be closed",
    Safety.ENABLING_STOP: "it moves again when the enabling device is held",
    Safety.RECOVERY: "it is in recovery and has to be moved out by hand",
}


def _remedy(name: str, safety: Safety, role: Role) -> str:
    """Name the method that leads out of a state; raise RequestRefused when none does, or the role is too low."""
    if (where := _AT_ITS_PLACE.get(safety)) is not None:
        raise RequestRefused("{name} cannot be acknowledged: {place}.", name=name, place=where)
    if safety is Safety.PROTECTIVE_STOP:
        return "acknowledge_protective_stop"
    if safety not in (Safety.FAULT, Safety.VIOLATION):
        raise RequestRefused("{name} has no stop that could be acknowledged.", name=name)
    if role < Role.TECHNICIAN:
        raise RequestRefused(
            "Restarting the safety system of {name} needs the role technician or a higher one.", name=name
        )
    return "restart_safety"


class OperationRequests:
    """Requests about robots and devices in operation that the protocol does not have (docs/protocol.md)."""

    def __init__(
        self,
        types: ObjectTypes,
        session: Session,
        online: OnlineScene,
        execution: Execution,
        motion: RobotMotion,
        stop_all: StopAll,
    ) -> None:
        self._types = types
        self._session = session
        self._online = online
        self._execution = execution
        self._motion = motion
        self._stop_all = stop_all

    # ------------------------------------------------------------------------------------------------ held motion
    @rpc("JogRobot")
    async def jog_robot(self, context: Context, args: JogRobotArgs) -> JogRobotData:
        """Start, renew or end the jogging of a robot with a velocity."""
        user = context.user
        cell = self._motion.require_robot_online(args.robot_id)
        motion = {} if args.valid_ms == 0 else self._velocity(context, args)

        async def allow() -> None:
            self._require_may_be_held(context, args, "jog")
            await self._require_not_by_hand(context, args)

        return JogRobotData(await cell.held.lease(context.client, user, args, HoldKind.JOG, motion, allow))

    @rpc("HoldHandTeaching")
    async def hold_hand_teaching(self, context: Context, args: HoldHandTeachingArgs) -> None:
        """Start, renew or end hand teaching of a robot."""
        user = context.user
        cell = self._motion.require_robot_online(args.robot_id)

        async def allow() -> None:
            self._require_may_be_held(context, args, "hand_teaching")
            await self._require_not_by_hand(context, args)

        await cell.held.lease(context.client, user, args, HoldKind.HAND_TEACHING, {}, allow)

    def _require_may_be_held(self, context: Context, args: JogRobotArgs | HoldHandTeachingArgs, feature: str) -> None:
        """Raise RequestRefused when the robot moves otherwise, is not there, or cannot be held in that way."""
        self._online.arm(args.robot_id, optional(args.arm_id))
        self._motion.require_feature(args.robot_id, feature)
        self._motion.require_not_moving(args.robot_id, held=True)

    async def _require_not_by_hand(self, context: Context, args: JogRobotArgs | HoldHandTeachingArgs) -> None:
        """Raise RequestRefused while HandTeachingMode is on, which lasts until it is switched off."""
        cell = self._online
        robot = cell.robot(args.robot_id)
        if not self._types.robot_meta(robot.type).features.hand_teaching:
            return
        arm = cell.arm(args.robot_id, optional(args.arm_id))
        if await cell.ask(bool, args.robot_id, "get_hand_teaching_mode", arm):
            raise RequestRefused("{name} is being moved by hand.", name=robot.name)

    def _velocity(self, context: Context, args: JogRobotArgs) -> dict[str, Any]:
        """Return the motion for the lease of the host; raise RequestRefused if it is missing or ambiguous."""
        motion: dict[str, Any] = {"end_effector_id": optional(args.end_effector_id)}
        in_space = not (isinstance(args.linear, Unset) and isinstance(args.angular, Unset))
        if isinstance(args.joints, Unset) != in_space:
            raise RequestRefused("Give either linear and angular velocity, or one or both of them, or joints.")
        if not isinstance(args.joints, Unset):
            if len({joint.name for joint in args.joints}) != len(args.joints):
                raise RequestRefused("A joint is named twice.")
            return motion | {"joints": args.joints}
        linear = Position() if isinstance(args.linear, Unset) else args.linear
        angular = Position() if isinstance(args.angular, Unset) else args.angular
        if args.frame is JogFrame.USER:
            axes = self._axes(context, args)
            linear, angular = linear.rotated(axes), angular.rotated(axes)
        elif not (isinstance(args.object_id, Unset) and isinstance(args.pose, Unset)):
            raise RequestRefused("An object or a pose belongs to the frame user.")
        return motion | {"twist": (*linear, *angular), "frame": _FRAMES[args.frame]}

    def _axes(self, context: Context, args: JogRobotArgs) -> Orientation:
        """Return the orientation in the world of the frame that the user means."""
        if isinstance(args.object_id, Unset) == isinstance(args.pose, Unset):
            raise RequestRefused("For the frame user, give either an object or a pose.")
        if not isinstance(args.pose, Unset):
            return args.pose.orientation
        assert not isinstance(args.object_id, Unset)
        found = self._session.document.scene_object(args.object_id)
        if isinstance(found.pose, Unset):
            raise RequestRefused("{name} has no pose.", name=found.name)
        return found.pose.orientation

    # ------------------------------------------------------------------------------------------------ stop
    @rpc("StopAll")
    async def stop_all_(self, context: Context, args: None) -> StopAllData:
        """Stop the program, every robot and device, and the running action."""
        data = await self._stop_all.stop_all(context.client.name)
        if any(outcome.kind is StopKind.ACTION and outcome.stopped for outcome in data.outcomes):
            context.emit("ActionCancelled")
        return data

    # ------------------------------------------------------------------------------------------------ streams
    @rpc("StreamRobot")
    async def stream_robot(self, context: Context, args: StreamRobotArgs) -> None:
        """Send joints or end effector poses of a robot to this client at a rate of its own, or no longer.

        The robot is one of the scene that is online, or of the program that runs.
        """
        execution = self._execution
        if execution.busy:
            streams = execution.streams_of(args.robot_id)
        else:
            streams = self._motion.require_robot_online(args.robot_id).streams
        if args.send and not 1.0 <= args.rate <= FASTEST_STREAM:
            raise RequestRefused(
                "The rate must be 1 to {fastest_stream} Hz, not {rate:g}.",
                fastest_stream=FASTEST_STREAM,
                rate=args.rate,
            )
        streams.at_rate(context.client, args.robot_id, args.what, args.rate, args.send)

    # ------------------------------------------------------------------------------------------------ devices
    @rpc("RetryObject")
    async def retry_object(self, context: Context, args: RetryObjectArgs) -> None:
        """Create and connect a failed object again; answer when that is done."""
        self._session.require_scene_open()
        self._online.require_online()
        self._session.document.scene_object(args.object_id)
        await self._online.retry(args.object_id)

    @rpc("AcknowledgeStop")
    async def acknowledge_stop(self, context: Context, args: AcknowledgeStopArgs) -> None:
        """Acknowledge a stop, a fault or an alarm in the name of the user."""
        user = context.user
        cell, session = self._online, self._session
        session.require_scene_open()
        cell.require_online()
        found = session.document.scene_object(args.object_id)
        cell.board.require_not_failed(args.object_id)
        if not isinstance(args.code, Unset):
            await cell.call(args.object_id, "acknowledge", {"code": args.code}, deadline=ACKNOWLEDGED_WITHIN)
            log.warning("alarm acknowledged", object=found.name, code=args.code, confirmed_by=user)
            return
        cell.robot(args.object_id)
        self._motion.require_feature(args.object_id, "acknowledge_stop")
        self._motion.require_not_moving(args.object_id)
        state: RobotState = await cell.ask(RobotState, args.object_id, "state")
        method = _remedy(found.name, state.safety, context.client.role)
        await cell.call(args.object_id, method, {"confirmed_by": user}, deadline=ACKNOWLEDGED_WITHIN)
        log.warning("stop acknowledged", object=found.name, safety=state.safety.value, confirmed_by=user)
