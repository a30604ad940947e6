"""Requests that move a robot to a target (protocol, 7.5)."""

from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.events import (
    MoveEventType,
    RobotMoveToActionPointJointsData,
    RobotMoveToActionPointOrientationData,
    RobotMoveToJointsData,
    RobotMoveToPoseData,
)
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.project_index import global_pose
from arcor2_hw.data.rpc import (
    InverseKinematicsArgs,
    MoveToActionPointArgs,
    MoveToJointsArgs,
    MoveToPoseArgs,
    SetEefPerpendicularToWorldArgs,
    StepAxis,
    StepMode,
    StepRobotEefArgs,
    StepWhat,
)
from arcor2_server.collaboration.locks import Locks
from arcor2_server.documents import Session
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.motion import (
    MoveEventData,
    RobotMotion,
    require_speed,
)
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.workspace.robots import SceneRobots, optional


def pose_motion(
    args: MoveToPoseArgs | StepRobotEefArgs | SetEefPerpendicularToWorldArgs, target: Pose
) -> tuple[dict[str, Any], MoveEventData]:
    """Return the arguments of a move to a pose without the arm, and what makes its events."""
    arguments = {
        "end_effector_id": args.end_effector_id,
        "target_pose": target,
        "speed": args.speed,
        "safe": args.safe,
        "linear": args.linear,
    }

    def event_data(phase: MoveEventType, message: str | Unset) -> RobotMoveToPoseData:
        return RobotMoveToPoseData(
            phase, args.robot_id, args.end_effector_id, target, args.safe, args.linear, message, args.arm_id
        )

    return arguments, event_data


def _base(cell: OnlineScene, args: StepRobotEefArgs) -> Orientation:
    """Return the orientation in the world of the frame of the step axis."""
    match args.mode:
        case StepMode.WORLD:
            return Orientation()
        case StepMode.ROBOT:
            pose = cell.robot(args.robot_id).pose
            return Orientation() if isinstance(pose, Unset) else pose.orientation
        case StepMode.RELATIVE:
            if isinstance(args.pose, Unset):
                raise RequestRefused("Give the pose that the step is relative to.")
            return args.pose.orientation
    raise RequestRefused("Steps in a frame of the user's own are not available.")


def _stepped(args: StepRobotEefArgs, present: Pose, frame: Orientation) -> Pose:
    axis = Position(*(1.0 if args.axis is candidate else 0.0 for candidate in StepAxis)).rotated(frame)
    x, y, z = (component * args.step for component in axis)
    if args.what is StepWhat.POSITION:
        return Pose(present.position + Position(x, y, z), present.orientation)
    return Pose(present.position, Orientation.from_rotation_vector(x, y, z) * present.orientation)


class RobotMotionRequests:
    """Requests that move a robot to a target (protocol, 7.5)."""

    def __init__(
        self,
        locks: Locks,
        types: ObjectTypes,
        session: Session,
        online: OnlineScene,
        robots: SceneRobots,
        motion: RobotMotion,
    ) -> None:
        self._locks = locks
        self._types = types
        self._session = session
        self._online = online
        self._robots = robots
        self._motion = motion

    # ------------------------------------------------------------------------------------------------ motion
    def begin_motion(
        self,
        context: Context,
        robot_id: str,
        method: str,
        arguments: Mapping[str, Any],
        event: str,
        event_data: MoveEventData,
        lock: str = "",
    ) -> None:
        """Answer, publish the start, and move; `lock`: the user whose lock on the robot ends with the motion."""
        self._motion.require_not_moving(robot_id)  # another request may have been quicker
        self._online.moving.add(robot_id)
        context.emit(event, event_data(MoveEventType.START, UNSET))

        async def whole() -> None:
            try:
                await self._motion.move(robot_id, method, arguments, event, event_data, context.received_at)
            finally:
                if lock:
                    self._locks.release(lock, robot_id)

        self._online.spawn(whole(), f"motion of {robot_id}")

    @asynccontextmanager
    async def _locked_for_motion(self, context: Context, robot_id: str) -> AsyncIterator[None]:
        """Lock the robot; the lock stays with the motion that begins inside, and is given back when none does."""
        self._session.require_scene_open()
        user = context.user
        await self._locks.acquire(user, robot_id)
        try:
            self._motion.require_robot_online(robot_id)
            yield
        except BaseException:
            self._locks.release(user, robot_id)
            raise

    @rpc("MoveToPose")
    async def move_to_pose(self, context: Context, args: MoveToPoseArgs) -> None:
        """Move an end effector to a pose; a missing position or orientation stays as it is."""
        arm_id, position, orientation = optional(args.arm_id), args.position, args.orientation
        async with self._locked_for_motion(context, args.robot_id):
            require_speed(args.speed)
            if isinstance(position, Unset) and isinstance(orientation, Unset):
                raise RequestRefused("Give a position, an orientation, or both.")
            await self._motion.require_ready(args.robot_id, "move_to_pose", arm_id)
            if isinstance(position, Unset) or isinstance(orientation, Unset):
                await self._motion.take_control(args.robot_id, arm_id)
                present = await self._robots.end_effector_pose(args.robot_id, args.end_effector_id, arm_id)
                position = present.position if isinstance(position, Unset) else position
                orientation = present.orientation if isinstance(orientation, Unset) else orientation
            else:
                await self._robots.require_end_effector(args.robot_id, args.end_effector_id, arm_id)
            target = Pose(position, orientation)
            arguments, event_data = pose_motion(args, target)
            arguments |= self._online.arm(args.robot_id, arm_id)
            self.begin_motion(
                context, args.robot_id, "move_to_pose", arguments, "RobotMoveToPose", event_data, context.user
            )

    @rpc("MoveToJoints")
    async def move_to_joints(self, context: Context, args: MoveToJointsArgs) -> None:
        """Move to joint values."""
        arm_id = optional(args.arm_id)
        async with self._locked_for_motion(context, args.robot_id):
            require_speed(args.speed)
            await self._motion.require_ready(args.robot_id, "move_to_joints", arm_id)
            arguments: dict[str, Any] = {"target_joints": args.joints, "speed": args.speed, "safe": args.safe}
            arguments |= self._online.arm(args.robot_id, arm_id)

            def event_data(phase: MoveEventType, message: str | Unset) -> RobotMoveToJointsData:
                return RobotMoveToJointsData(phase, args.robot_id, args.joints, args.safe, message, args.arm_id)

            self.begin_motion(
                context, args.robot_id, "move_to_joints", arguments, "RobotMoveToJoints", event_data, context.user
            )

    @rpc("MoveToActionPoint")
    async def move_to_action_point(self, context: Context, args: MoveToActionPointArgs) -> None:
        """Move to an orientation or joints of an action point."""
        self._session.require_project_open()
        async with self._locks.auto(context.user, args.robot_id):
            self._motion.require_robot_online(args.robot_id)
            require_speed(args.speed)
            if isinstance(args.orientation_id, Unset) == isinstance(args.joints_id, Unset):
                raise RequestRefused("Give either an orientation or joints.")
            if not isinstance(args.joints_id, Unset):
                await self._to_joints(context, args, args.joints_id)
            elif not isinstance(args.orientation_id, Unset):
                await self._to_orientation(context, args, args.orientation_id)

    async def _to_joints(self, context: Context, args: MoveToActionPointArgs, joints_id: str) -> None:
        arm_id = optional(args.arm_id)
        joints = self._session.document.joints(joints_id)[1]
        if joints.robot_id != args.robot_id:
            raise RequestRefused("The joints {name} belong to another robot.", name=joints.name)
        await self._motion.require_ready(args.robot_id, "move_to_joints", arm_id)
        arguments: dict[str, Any] = {"target_joints": joints.joints, "speed": args.speed, "safe": args.safe}
        arguments |= self._online.arm(args.robot_id, arm_id)

        def event_data(phase: MoveEventType, message: str | Unset) -> RobotMoveToActionPointJointsData:
            return RobotMoveToActionPointJointsData(phase, args.robot_id, joints_id, args.safe, message, args.arm_id)

        self.begin_motion(
            context, args.robot_id, "move_to_joints", arguments, "RobotMoveToActionPointJoints", event_data
        )

    async def _to_orientation(self, context: Context, args: MoveToActionPointArgs, orientation_id: str) -> None:
        arm_id, end_effector = optional(args.arm_id), args.end_effector_id
        if isinstance(end_effector, Unset):
            raise RequestRefused("Name the end effector that shall move there.")
        point, named = self._session.document.orientation(orientation_id)
        await self._motion.require_ready(args.robot_id, "move_to_pose", arm_id)
        arguments: dict[str, Any] = {
            "end_effector_id": end_effector,
            "target_pose": global_pose(self._session.document, point, named.orientation),
            "speed": args.speed,
            "safe": args.safe,
            "linear": args.linear,
        }
        arguments |= self._online.arm(args.robot_id, arm_id)

        def event_data(phase: MoveEventType, message: str | Unset) -> RobotMoveToActionPointOrientationData:
            return RobotMoveToActionPointOrientationData(
                phase, args.robot_id, end_effector, orientation_id, args.safe, args.linear, message, args.arm_id
            )

        self.begin_motion(
            context, args.robot_id, "move_to_pose", arguments, "RobotMoveToActionPointOrientation", event_data
        )

    @rpc("StepRobotEef")
    async def step_robot_eef(self, context: Context, args: StepRobotEefArgs) -> None:
        """Move an end effector by a step along, or about, an axis."""
        arm_id = optional(args.arm_id)
        cell = self._motion.require_robot_online(args.robot_id)
        self._locks.require_held(context.user, args.robot_id)
        require_speed(args.speed)
        await self._motion.require_ready(args.robot_id, "move_to_pose", arm_id)
        if not context.dry_run:
            await self._motion.take_control(args.robot_id, arm_id)
        target = _stepped(
            args, await cell.end_effector_pose(args.robot_id, args.end_effector_id, arm_id), _base(cell, args)
        )
        if self._types.robot_meta(cell.robot(args.robot_id).type).features.inverse_kinematics:
            question = InverseKinematicsArgs(
                args.robot_id, args.end_effector_id, target, avoid_collisions=args.safe, arm_id=args.arm_id
            )
            await self._motion.solve_inverse(question)
        if context.dry_run:
            return
        arguments, event_data = pose_motion(args, target)
        arguments |= cell.arm(args.robot_id, arm_id)
        self.begin_motion(context, args.robot_id, "move_to_pose", arguments, "RobotMoveToPose", event_data)
