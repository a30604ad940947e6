"""Requests that move robots (protocol, 7.5)."""

from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
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
from arcor2_server.online.perpendicular import find_perpendicular_pose
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.workspace.robots import SceneRobots, optional


def _step_frame(cell: OnlineScene, args: StepRobotEefArgs) -> Orientation:
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
    raise RequestRefused("Steps in a user frame are not available.")


def _stepped(args: StepRobotEefArgs, present: Pose, frame: Orientation) -> Pose:
    """Return the pose after a step along or about an axis of a frame with this orientation."""
    axis = Position(*(1.0 if args.axis is candidate else 0.0 for candidate in StepAxis)).rotated(frame)
    x, y, z = (component * args.step for component in axis)
    if args.what is StepWhat.POSITION:
        return Pose(present.position + Position(x, y, z), present.orientation)
    return Pose(present.position, Orientation.from_rotation_vector(x, y, z) * present.orientation)


@dataclass(frozen=True, slots=True)
class RobotMotionRequests:
    """Requests that move robots (protocol, 7.5)."""

    _locks: Locks
    _types: ObjectTypes
    _session: Session
    _online: OnlineScene
    _robots: SceneRobots
    _motion: RobotMotion

    # ------------------------------------------------------------------------------------------------ motion
    def _start_motion(
        self,
        context: Context,
        robot_id: str,
        method: str,
        arguments: Mapping[str, Any],
        event: str,
        event_data: MoveEventData,
        lock_owner: str = "",
    ) -> None:
        """Publish the start of a motion, and move in the background.

        Args:
            context: the request.
            robot_id: the robot.
            method: the method of the robot.
            arguments: its arguments.
            event: the event that publishes start and end.
            event_data: creates the data of the event.
            lock_owner: the user whose lock on the robot is released after the motion, "" for none.
        """
        self._motion.require_not_moving(robot_id)  # another request may have started a motion meanwhile
        self._online.moving.add(robot_id)
        context.emit(event, event_data(MoveEventType.START, UNSET))

        async def run() -> None:
            try:
                await self._motion.move(robot_id, method, arguments, event, event_data, context.received_at)
            finally:
                if lock_owner:
                    self._locks.release(lock_owner, robot_id)

        self._online.background.spawn(run(), f"motion of {robot_id}")

    def _start_pose_motion(
        self,
        context: Context,
        args: MoveToPoseArgs | StepRobotEefArgs | SetEefPerpendicularToWorldArgs,
        target: Pose,
        lock_owner: str = "",
    ) -> None:
        arguments: dict[str, Any] = {
            "end_effector_id": args.end_effector_id,
            "target_pose": target,
            "speed": args.speed,
            "safe": args.safe,
            "linear": args.linear,
        }
        arguments |= self._online.arm(args.robot_id, optional(args.arm_id))

        def event_data(phase: MoveEventType, message: str | Unset) -> RobotMoveToPoseData:
            return RobotMoveToPoseData(
                phase, args.robot_id, args.end_effector_id, target, args.safe, args.linear, message, args.arm_id
            )

        self._start_motion(context, args.robot_id, "move_to_pose", arguments, "RobotMoveToPose", event_data, lock_owner)

    @asynccontextmanager
    async def _locked_for_motion(self, context: Context, robot_id: str) -> AsyncIterator[None]:
        """Lock the robot for a motion started in the body; release it at once if the body raises."""
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
        """Move an end effector to a pose. A missing position or orientation keeps its present value."""
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
            self._start_pose_motion(context, args, target, context.user)

    @rpc("MoveToJoints")
    async def move_to_joints(self, context: Context, args: MoveToJointsArgs) -> None:
        """Move a robot to joint values."""
        arm_id = optional(args.arm_id)
        async with self._locked_for_motion(context, args.robot_id):
            require_speed(args.speed)
            await self._motion.require_ready(args.robot_id, "move_to_joints", arm_id)
            arguments: dict[str, Any] = {"target_joints": args.joints, "speed": args.speed, "safe": args.safe}
            arguments |= self._online.arm(args.robot_id, arm_id)

            def event_data(phase: MoveEventType, message: str | Unset) -> RobotMoveToJointsData:
                return RobotMoveToJointsData(phase, args.robot_id, args.joints, args.safe, message, args.arm_id)

            self._start_motion(
                context, args.robot_id, "move_to_joints", arguments, "RobotMoveToJoints", event_data, context.user
            )

    @rpc("MoveToActionPoint")
    async def move_to_action_point(self, context: Context, args: MoveToActionPointArgs) -> None:
        """Move a robot to an orientation or to joints of an action point."""
        self._session.require_project_open()
        async with self._locks.auto(context.user, args.robot_id):
            self._motion.require_robot_online(args.robot_id)
            require_speed(args.speed)
            if isinstance(args.orientation_id, Unset) == isinstance(args.joints_id, Unset):
                raise RequestRefused("Give either an orientation or joints.")
            if not isinstance(args.joints_id, Unset):
                await self._move_to_stored_joints(context, args, args.joints_id)
            elif not isinstance(args.orientation_id, Unset):
                await self._move_to_orientation(context, args, args.orientation_id)

    async def _move_to_stored_joints(self, context: Context, args: MoveToActionPointArgs, joints_id: str) -> None:
        arm_id = optional(args.arm_id)
        joints = self._session.document.joints(joints_id)[1]
        if joints.robot_id != args.robot_id:
            raise RequestRefused("The joints {name} belong to another robot.", name=joints.name)
        await self._motion.require_ready(args.robot_id, "move_to_joints", arm_id)
        arguments: dict[str, Any] = {"target_joints": joints.joints, "speed": args.speed, "safe": args.safe}
        arguments |= self._online.arm(args.robot_id, arm_id)

        def event_data(phase: MoveEventType, message: str | Unset) -> RobotMoveToActionPointJointsData:
            return RobotMoveToActionPointJointsData(phase, args.robot_id, joints_id, args.safe, message, args.arm_id)

        self._start_motion(
            context, args.robot_id, "move_to_joints", arguments, "RobotMoveToActionPointJoints", event_data
        )

    async def _move_to_orientation(self, context: Context, args: MoveToActionPointArgs, orientation_id: str) -> None:
        arm_id, end_effector = optional(args.arm_id), args.end_effector_id
        if isinstance(end_effector, Unset):
            raise RequestRefused("Give the end effector that moves to the orientation.")
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

        self._start_motion(
            context, args.robot_id, "move_to_pose", arguments, "RobotMoveToActionPointOrientation", event_data
        )

    @rpc("StepRobotEef")
    async def step_robot_eef(self, context: Context, args: StepRobotEefArgs) -> None:
        """Move an end effector by one step along or about an axis."""
        cell = await self._prepare_pose_motion(context, args)
        present = await cell.end_effector_pose(args.robot_id, args.end_effector_id, optional(args.arm_id))
        target = _stepped(args, present, _step_frame(cell, args))
        if self._types.robot_meta(cell.robot(args.robot_id).type).features.inverse_kinematics:
            request = InverseKinematicsArgs(
                args.robot_id, args.end_effector_id, target, avoid_collisions=args.safe, arm_id=args.arm_id
            )
            await self._motion.solve_inverse(request)
        if not context.dry_run:
            self._start_pose_motion(context, args, target)

    @rpc("SetEefPerpendicularToWorld")
    async def set_eef_perpendicular_to_world(self, context: Context, args: SetEefPerpendicularToWorldArgs) -> None:
        """Point a tool straight down at its present position, with the smallest joint changes."""
        cell = await self._prepare_pose_motion(context, args, "inverse_kinematics", "forward_kinematics")
        target = await find_perpendicular_pose(cell, self._motion, args)
        await self._motion.require_ready(args.robot_id, "move_to_pose", optional(args.arm_id))
        if not context.dry_run:
            self._start_pose_motion(context, args, target)

    async def _prepare_pose_motion(
        self, context: Context, args: StepRobotEefArgs | SetEefPerpendicularToWorldArgs, *features: str
    ) -> OnlineScene:
        """Check that a locked robot can start a motion, and take control of it unless this is a dry run."""
        arm_id = optional(args.arm_id)
        cell = self._motion.require_robot_online(args.robot_id)
        self._locks.require_held(context.user, args.robot_id)
        require_speed(args.speed)
        await self._motion.require_ready(args.robot_id, "move_to_pose", arm_id)
        for feature in features:
            self._motion.require_feature(args.robot_id, feature)
        if not context.dry_run:
            await self._motion.take_control(args.robot_id, arm_id)
        return cell
