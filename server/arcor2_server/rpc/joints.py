"""Requests about robot joints stored at action points (protocol, 7.4)."""

from dataclasses import dataclass

from msgspec.structs import replace

from arcor2_hw.data.base import new_id
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.data.rpc import (
    AddActionPointJointsUsingRobotArgs,
    RemoveActionPointJointsArgs,
    RenameActionPointJointsArgs,
    UpdateActionPointJointsArgs,
    UpdateActionPointJointsUsingRobotArgs,
)
from arcor2_hw.exceptions import InvalidData
from arcor2_server.collaboration.locks import Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks.names import check_name
from arcor2_server.errors import RequestRefused
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.workspace.robots import optional


@dataclass(frozen=True, slots=True)
class JointsRequests:
    """Requests about robot joints stored at action points (protocol, 7.4)."""

    _locks: Locks
    _session: Session
    _online: OnlineScene
    _editing: Editing

    def _require_name_free(self, name: str, point_id: str) -> None:
        self._editing.require_name_free(Kind.JOINTS, name, "joints of this action point", point_id)

    async def _update(
        self, context: Context, value: ProjectRobotJoints, change_type: ChangeType = ChangeType.UPDATE
    ) -> None:
        change = self._session.document.update(Kind.JOINTS, value.id, value)
        await self._editing.commit_one(context, change, change_type)

    @rpc("AddActionPointJointsUsingRobot")
    async def add_joints_using_robot(self, context: Context, args: AddActionPointJointsUsingRobotArgs) -> None:
        """Store the present joints of a robot at an action point."""
        check_name(args.name, "set of joints")
        document = self._session.require_project_open()
        async with self._locks.read(context.user, args.robot_id):
            self._online.require_online()
            document.action_point(args.action_point_id)
            self._require_name_free(args.name, args.action_point_id)
            self._editing.require_locked(context, args.action_point_id)
            joints = await self._online.robot_joints(args.robot_id, optional(args.arm_id))
            document.action_point(args.action_point_id)
            self._require_name_free(args.name, args.action_point_id)
            value = ProjectRobotJoints(
                args.name, args.robot_id, joints, True, args.arm_id, args.end_effector_id, new_id("joi")
            )
            await self._editing.commit_one(context, document.add(Kind.JOINTS, value.id, value, args.action_point_id))

    @rpc("UpdateActionPointJoints")
    async def update_joints(self, context: Context, args: UpdateActionPointJointsArgs) -> None:
        """Replace the values of stored joints. This marks them as valid."""
        point, value = self._session.require_project_open().joints(args.joints_id)
        given, known = [joint.name for joint in args.joints], {joint.name for joint in value.joints}
        if len(given) != len(set(given)) or set(given) != known:
            raise InvalidData(
                "Give each joint of {name} once: {known}.", name=value.name, known=", ".join(sorted(known))
            )
        self._editing.require_locked(context, point.id)
        await self._update(context, replace(value, joints=list(args.joints), is_valid=True))

    @rpc("UpdateActionPointJointsUsingRobot")
    async def update_joints_using_robot(self, context: Context, args: UpdateActionPointJointsUsingRobotArgs) -> None:
        """Replace the values of stored joints with the present values of their robot."""
        document = self._session.require_project_open()
        self._online.require_online()
        point, value = document.joints(args.joints_id)
        async with self._locks.read(context.user, value.robot_id):
            self._editing.require_locked(context, point.id)
            joints = await self._online.robot_joints(value.robot_id, optional(value.arm_id))
            _, value = document.joints(args.joints_id)
            await self._update(context, replace(value, joints=joints, is_valid=True))

    @rpc("RenameActionPointJoints")
    async def rename_joints(self, context: Context, args: RenameActionPointJointsArgs) -> None:
        """Rename stored joints."""
        point, value = self._session.require_project_open().joints(args.joints_id)
        check_name(args.new_name, "set of joints")
        self._require_name_free(args.new_name, point.id)
        self._editing.require_locked(context, point.id)
        await self._update(context, replace(value, name=args.new_name), ChangeType.UPDATE_BASE)

    @rpc("RemoveActionPointJoints")
    async def remove_joints(self, context: Context, args: RemoveActionPointJointsArgs) -> None:
        """Remove stored joints. Refuse while an action uses them."""
        document = self._session.require_project_open()
        point, value = document.joints(args.joints_id)
        if users := document.users_of(value.id):
            raise RequestRefused(
                "The action {name} uses the joints {value_name}.",
                name=getattr(users[0], "name", ""),
                value_name=value.name,
            )
        self._editing.require_locked(context, point.id)
        if await self._editing.commit_one(context, document.remove(Kind.JOINTS, value.id)):
            self._editing.drop_locks(context, value.id)
