"""Requests to robots of the online scene (protocol, 7.5)."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

from arcor2_hw.data.base import Unset
from arcor2_hw.data.events import HandTeachingModeData
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.rpc import (
    ForwardKinematicsArgs,
    GetEndEffectorPoseArgs,
    GetEndEffectorsArgs,
    GetGrippersArgs,
    GetRobotArmsArgs,
    GetRobotJointsArgs,
    GetSuctionsArgs,
    HandTeachingModeArgs,
    InverseKinematicsArgs,
    RegisterForRobotEventArgs,
    StopRobotArgs,
)
from arcor2_hw.data.scene import SceneObject
from arcor2_server.collaboration.locks import Locks
from arcor2_server.documents import Session
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.motion import RobotMotion
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.workspace.kinematics import Kinematics
from arcor2_server.workspace.robots import SceneRobots, optional


@dataclass(frozen=True, slots=True)
class RobotRequests:
    """Requests to robots of the online scene (protocol, 7.5)."""

    _locks: Locks
    _types: ObjectTypes
    _session: Session
    _online: OnlineScene
    _robots: SceneRobots
    _kinematics: Kinematics
    _motion: RobotMotion

    @asynccontextmanager
    async def _reading(self, context: Context, robot_id: str) -> AsyncIterator[OnlineScene]:
        """Check that the object is a robot of the online scene, and hold its read lock."""
        self._session.require_scene_open()
        async with self._locks.read(context.user, robot_id):
            self._online.require_online()
            self._online.robot(robot_id)
            yield self._online

    # ------------------------------------------------------------------------------------------------ observing
    @rpc("GetRobotJoints")
    async def get_robot_joints(self, context: Context, args: GetRobotJointsArgs) -> list[Joint]:
        """Return the present joint values."""
        async with self._reading(context, args.robot_id) as cell:
            return await cell.robot_joints(args.robot_id, optional(args.arm_id))

    @rpc("GetEndEffectorPose")
    async def get_end_effector_pose(self, context: Context, args: GetEndEffectorPoseArgs) -> Pose:
        """Return the present pose of an end effector."""
        async with self._reading(context, args.robot_id) as cell:
            return await cell.end_effector_pose(args.robot_id, args.end_effector_id, optional(args.arm_id))

    async def _names(self, context: Context, args: GetGrippersArgs | GetSuctionsArgs, method: str) -> list[str]:
        async with self._reading(context, args.robot_id) as cell:
            arm = cell.arm(args.robot_id, optional(args.arm_id))
            return sorted(await cell.ask(set[str], args.robot_id, method, arm))

    @rpc("GetEndEffectors")
    async def get_end_effectors(self, context: Context, args: GetEndEffectorsArgs) -> list[str]:
        """Return the names of the end effectors."""
        async with self._reading(context, args.robot_id):
            return sorted(await self._robots.end_effectors(args.robot_id, optional(args.arm_id)))

    @rpc("GetGrippers")
    async def get_grippers(self, context: Context, args: GetGrippersArgs) -> list[str]:
        """Return the names of the grippers."""
        return await self._names(context, args, "grippers")

    @rpc("GetSuctions")
    async def get_suctions(self, context: Context, args: GetSuctionsArgs) -> list[str]:
        """Return the names of the suction cups."""
        return await self._names(context, args, "suctions")

    @rpc("GetRobotArms")
    async def get_robot_arms(self, context: Context, args: GetRobotArmsArgs) -> list[str]:
        """Return the names of the arms of a robot with several arms."""
        async with self._reading(context, args.robot_id) as cell:
            robot = cell.robot(args.robot_id)
            if not self._types.robot_meta(robot.type).multi_arm:
                raise RequestRefused("{name} has only one arm.", name=robot.name)
            return sorted(await cell.ask(set[str], args.robot_id, "get_arm_ids"))

    @rpc("RegisterForRobotEvent")
    async def register_for_robot_event(self, context: Context, args: RegisterForRobotEventArgs) -> None:
        """Start or stop sending joints or end effector poses of a robot to this client."""
        async with self._reading(context, args.robot_id) as cell:
            cell.streams.subscribe(context.client, args.robot_id, args.what, args.send)

    @rpc("InverseKinematics")
    async def inverse_kinematics(self, context: Context, args: InverseKinematicsArgs) -> list[Joint]:
        """Return joints that reach a pose: computed by the robot, else from its model, also offline."""
        async with self._modelled(context, args.robot_id, args.arm_id) as robot:
            if self._kinematics.solves(robot, "inverse_kinematics"):
                return await self._motion.solve_inverse(args)
            return await self._kinematics.inverse(robot, args)

    @asynccontextmanager
    async def _modelled(self, context: Context, robot_id: str, arm_id: str | Unset) -> AsyncIterator[SceneObject]:
        """Check that the object is a robot that is online or has a model, and hold its read lock."""
        self._session.require_scene_open()
        async with self._locks.read(context.user, robot_id):
            robot = self._online.robot(robot_id)
            if self._robots.model_of_type(robot.type) is None:
                self._online.require_online()
            self._online.arm(robot_id, optional(arm_id))
            yield robot

    @rpc("ForwardKinematics")
    async def forward_kinematics(self, context: Context, args: ForwardKinematicsArgs) -> Pose:
        """Return the pose for joint values: computed by the robot, else from its model, also offline."""
        async with self._modelled(context, args.robot_id, args.arm_id) as robot:
            if not self._kinematics.solves(robot, "forward_kinematics"):
                return await self._kinematics.forward(robot, args)
            cell = self._online
            arguments: dict[str, Any] = cell.arm(args.robot_id, optional(args.arm_id))
            arguments |= {"end_effector_id": args.end_effector_id, "joints": args.joints}
            pose: Pose = await cell.ask(Pose, args.robot_id, "forward_kinematics", arguments)
            return pose

    @rpc("StopRobot")
    async def stop_robot(self, context: Context, args: StopRobotArgs) -> None:
        """Stop a moving robot. The request does not wait for other requests to the robot."""
        cell = self._motion.require_robot_online(args.robot_id)
        self._motion.require_feature(args.robot_id, "stop")
        acting = cell.running_action is not None and cell.running_action.object_id == args.robot_id
        if args.robot_id not in cell.moving and not acting:
            raise RequestRefused("{name} is not moving.", name=cell.robot(args.robot_id).name)
        await cell.host.stop_motion(args.robot_id)

    @rpc("HandTeachingMode")
    async def hand_teaching_mode(self, context: Context, args: HandTeachingModeArgs) -> None:
        """Switch hand teaching of a robot on or off."""
        cell = self._motion.require_robot_online(args.robot_id)
        self._locks.require_held(context.user, args.robot_id)
        arm = cell.arm(args.robot_id, optional(args.arm_id))
        self._motion.require_feature(args.robot_id, "hand_teaching")
        self._motion.require_not_moving(args.robot_id)
        if await cell.ask(bool, args.robot_id, "get_hand_teaching_mode", arm) is args.enable:
            raise RequestRefused("Hand teaching is on already." if args.enable else "Hand teaching is off already.")
        if context.dry_run:
            return
        await cell.call(args.robot_id, "set_hand_teaching_mode", {"enabled": args.enable} | arm, control=True)
        data = HandTeachingModeData(args.robot_id, args.enable, args.arm_id)
        cell.held.teaching_changed(context.client, context.user, data)
        context.emit("HandTeachingMode", data)
