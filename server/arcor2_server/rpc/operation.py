"""Requests beyond the ARCOR2 protocol: jogging, hand teaching, stop, streams, devices (docs/protocol.md)."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import msgspec
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
    StreamObservationsArgs,
    StreamPointsArgs,
    StreamRobotArgs,
)
from arcor2_hw.data.rpc.operation import FASTEST_OBSERVATIONS, FASTEST_STREAM, SLOWEST_OBSERVATIONS
from arcor2_hw.data.rpc.points import FASTEST_POINTS
from arcor2_server.documents import Session
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.service import Execution
from arcor2_server.execution.stop_all import StopAll
from arcor2_server.hosts.session import READ_TIMEOUT
from arcor2_server.hosts.streams import OBSERVATIONS, POINTS
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.motion import RobotMotion
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.workspace.robots import optional

log = structlog.get_logger(__name__)

ACKNOWLEDGE_TIMEOUT: Final = 30.0
"""Time limit for acknowledging a stop, s. Restarting the safety system of a controller takes 20 s."""
_FRAMES: Final = {JogFrame.WORLD: "world", JogFrame.ROBOT: "base", JogFrame.TOOL: "tool", JogFrame.USER: "world"}
_RELEASED_ON_SITE: Final = {
    Safety.EMERGENCY_STOP: "release the emergency stop where it was pressed",
    Safety.SAFEGUARD_STOP: "close the guard",
    Safety.ENABLING_STOP: "hold the enabling device",
    Safety.RECOVERY: "move the robot back into its limits by hand",
}


def _acknowledging_method(name: str, safety: Safety, role: Role) -> str:
    """Return the method that ends a safety state. Raise RequestRefused if there is none, or the role is too low."""
    if (remedy := _RELEASED_ON_SITE.get(safety)) is not None:
        raise RequestRefused("{name} cannot be acknowledged here: {remedy}.", name=name, remedy=remedy)
    if safety is Safety.PROTECTIVE_STOP:
        return "acknowledge_protective_stop"
    if safety not in (Safety.FAULT, Safety.VIOLATION):
        raise RequestRefused("{name} has no stop that could be acknowledged.", name=name)
    if role < Role.TECHNICIAN:
        raise RequestRefused(
            "Restarting the safety system of {name} needs the role technician or a higher one.", name=name
        )
    return "restart_safety"


@dataclass(frozen=True, slots=True)
class OperationRequests:
    """Requests beyond the ARCOR2 protocol: jogging, hand teaching, stop, streams, devices (docs/protocol.md)."""

    _types: ObjectTypes
    _session: Session
    _online: OnlineScene
    _execution: Execution
    _motion: RobotMotion
    _stop_all: StopAll

    # ------------------------------------------------------------------------------------------------ hold-to-run
    @rpc("JogRobot")
    async def jog_robot(self, context: Context, args: JogRobotArgs) -> JogRobotData:
        """Start, renew or end the jogging of a robot with a velocity."""
        motion = functools.partial(self._velocity, args)
        return JogRobotData(await self._hold(context, args, HoldKind.JOG, "jog", motion))

    @rpc("HoldHandTeaching")
    async def hold_hand_teaching(self, context: Context, args: HoldHandTeachingArgs) -> None:
        """Start, renew or end hand teaching of a robot."""
        await self._hold(context, args, HoldKind.HAND_TEACHING, "hand_teaching", dict)

    async def _hold(
        self,
        context: Context,
        args: JogRobotArgs | HoldHandTeachingArgs,
        kind: HoldKind,
        feature: str,
        motion: Callable[[], dict[str, Any]],
    ) -> float:
        """Start, renew or end a hold-to-run motion; `motion` returns the parameters of the motion."""
        user = context.user
        cell = self._motion.require_robot_online(args.robot_id)

        async def allow() -> None:
            await self._motion.require_ready(args.robot_id, feature, optional(args.arm_id), held=True)

        return await cell.held.lease(context.client, user, args, kind, {} if args.valid_ms == 0 else motion(), allow)

    def _velocity(self, args: JogRobotArgs) -> dict[str, Any]:
        """Return the parameters of a jog motion. Raise RequestRefused if the velocity is missing or ambiguous."""
        motion: dict[str, Any] = {"end_effector_id": optional(args.end_effector_id)}
        in_space = not (isinstance(args.linear, Unset) and isinstance(args.angular, Unset))
        if args.retract is True:
            if in_space or not isinstance(args.joints, Unset):
                raise RequestRefused("With retract, the server chooses the velocity. Give none.")
            return motion | {"retract": True}
        if isinstance(args.joints, Unset) != in_space:
            raise RequestRefused("Give either joint velocities, or a linear or angular velocity, or both of these.")
        if not isinstance(args.joints, Unset):
            if len({joint.name for joint in args.joints}) != len(args.joints):
                raise RequestRefused("A joint is given twice.")
            return motion | {"joints": args.joints}
        linear = Position() if isinstance(args.linear, Unset) else args.linear
        angular = Position() if isinstance(args.angular, Unset) else args.angular
        if args.frame is JogFrame.USER:
            axes = self._axes(args)
            linear, angular = linear.rotated(axes), angular.rotated(axes)
        elif not (isinstance(args.object_id, Unset) and isinstance(args.pose, Unset)):
            raise RequestRefused("An object or a pose is only allowed with the frame user.")
        return motion | {"twist": (*linear, *angular), "frame": _FRAMES[args.frame]}

    def _axes(self, args: JogRobotArgs) -> Orientation:
        """Return the orientation of the user frame in the world."""
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
        """Stop the program, all robots and devices, and the running action."""
        data = await self._stop_all.stop_all(context.client.name)
        if any(outcome.kind is StopKind.ACTION and outcome.stopped for outcome in data.outcomes):
            context.emit("ActionCancelled")
        return StopAllData(context.translatable(data.outcomes))

    # ------------------------------------------------------------------------------------------------ streams
    @rpc("StreamRobot")
    async def stream_robot(self, context: Context, args: StreamRobotArgs) -> None:
        """Start or stop sending joints or end effector poses of a robot to this client at a given rate.

        The robot belongs to the online scene or to the running program.
        """
        execution = self._execution
        if execution.busy:
            streams = execution.streams.of_robot(args.robot_id)
        else:
            streams = self._motion.require_robot_online(args.robot_id).streams
        if args.send and not 1.0 <= args.rate <= FASTEST_STREAM:
            raise RequestRefused(
                "The rate must be 1 to {fastest_stream} Hz, not {rate:g}.",
                fastest_stream=FASTEST_STREAM,
                rate=args.rate,
            )
        streams.at_rate(context.client, args.robot_id, args.what, args.rate, args.send)

    @rpc("StreamObservations")
    async def stream_observations(self, context: Context, args: StreamObservationsArgs) -> None:
        """Start or stop sending the observations of a device to this client at a given rate.

        The device belongs to the online scene or to the running program.
        """
        self._stream_values(context, args, OBSERVATIONS, FASTEST_OBSERVATIONS)

    @rpc("StreamPoints")
    async def stream_points(self, context: Context, args: StreamPointsArgs) -> None:
        """Start or stop sending the points of a device to this client at a given rate.

        The device belongs to the online scene or to the running program.
        """
        self._stream_values(context, args, POINTS, FASTEST_POINTS)

    def _stream_values(
        self, context: Context, args: StreamObservationsArgs | StreamPointsArgs, what: str, fastest: float
    ) -> None:
        if self._execution.busy:
            streams = self._execution.streams.of_object(args.object_id)
        else:
            self._session.require_scene_open()
            self._online.require_online()
            self._session.document.scene_object(args.object_id)
            streams = self._online.host.streams
        if args.send and not SLOWEST_OBSERVATIONS <= args.rate <= fastest:
            raise RequestRefused(
                "The rate must be {slowest:g} to {fastest:g} Hz, not {rate:g}.",
                slowest=SLOWEST_OBSERVATIONS,
                fastest=fastest,
                rate=args.rate,
            )
        streams.at_rate(context.client, args.object_id, what, args.rate, args.send)

    # ------------------------------------------------------------------------------------------------ devices
    @rpc("RetryObject")
    async def retry_object(self, context: Context, args: RetryObjectArgs) -> None:
        """Create and connect a failed object again. The answer comes when it is connected."""
        self._session.require_scene_open()
        self._online.require_online()
        self._session.document.scene_object(args.object_id)
        await self._online.host.retry(args.object_id)

    @rpc("AcknowledgeStop")
    async def acknowledge_stop(self, context: Context, args: AcknowledgeStopArgs) -> None:
        """Acknowledge a stop, a fault or an alarm on behalf of the user."""
        user = context.user
        if self._execution.busy:
            await self._acknowledge_of_program(context, args, user)
            return
        cell, session = self._online, self._session
        session.require_scene_open()
        cell.require_online()
        found = session.document.scene_object(args.object_id)
        cell.board.require_not_failed(args.object_id)
        if not isinstance(args.code, Unset):
            await cell.call(args.object_id, "acknowledge", {"code": args.code}, deadline=ACKNOWLEDGE_TIMEOUT)
            log.warning("alarm acknowledged", object=found.name, code=args.code, confirmed_by=user)
            return
        cell.robot(args.object_id)
        self._motion.require_feature(args.object_id, "acknowledge_stop")
        self._motion.require_not_moving(args.object_id)
        state: RobotState = await cell.ask(RobotState, args.object_id, "state")
        method = _acknowledging_method(found.name, state.safety, context.client.role)
        await cell.call(args.object_id, method, {"confirmed_by": user}, deadline=ACKNOWLEDGE_TIMEOUT)
        log.warning("stop acknowledged", object=found.name, safety=state.safety.value, confirmed_by=user)

    async def _acknowledge_of_program(self, context: Context, args: AcknowledgeStopArgs, user: str) -> None:
        """Acknowledge a stop, a fault or an alarm of a device of the held program."""
        execution = self._execution
        found = execution.device_of_hold(args.object_id)
        if not isinstance(args.code, Unset):
            await execution.call(found.id, "acknowledge", {"code": args.code}, ACKNOWLEDGE_TIMEOUT)
            log.warning("alarm acknowledged", object=found.name, code=args.code, confirmed_by=user)
            return
        self._motion.require_feature_of(found, "acknowledge_stop")
        state = msgspec.json.decode(await execution.call(found.id, "state", {}, READ_TIMEOUT), type=RobotState)
        method = _acknowledging_method(found.name, state.safety, context.client.role)
        await execution.call(found.id, method, {"confirmed_by": user}, ACKNOWLEDGE_TIMEOUT)
        log.warning("stop acknowledged", object=found.name, safety=state.safety.value, confirmed_by=user)
