"""Requests about orientations of action points (protocol, 7.4)."""

from dataclasses import dataclass

from msgspec.structs import replace

from arcor2_hw.data.base import new_id
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.geometry import Orientation
from arcor2_hw.data.project import NamedOrientation
from arcor2_hw.data.project_index import relative_pose
from arcor2_hw.data.robot import RobotArg
from arcor2_hw.data.rpc import (
    AddActionPointOrientationArgs,
    AddActionPointOrientationUsingRobotArgs,
    RemoveActionPointOrientationArgs,
    RenameActionPointOrientationArgs,
    UpdateActionPointOrientationArgs,
    UpdateActionPointOrientationUsingRobotArgs,
)
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
class OrientationRequests:
    """Requests about orientations of action points (protocol, 7.4)."""

    _locks: Locks
    _session: Session
    _online: OnlineScene
    _editing: Editing

    def _check_name(self, name: str, point_id: str) -> None:
        check_name(name, "orientation")
        self._editing.require_name_free(Kind.ORIENTATION, name, "an orientation of this action point", point_id)

    async def _present_orientation(self, point_id: str, robot: RobotArg) -> Orientation:
        """Return the present orientation of an end effector in the frame of an action point's parent."""
        document = self._session.document
        pose = await self._online.end_effector_pose(robot.robot_id, robot.end_effector, optional(robot.arm_id))
        return relative_pose(document, document.action_point(point_id), pose).orientation

    async def _add(self, context: Context, point_id: str, name: str, orientation: Orientation) -> None:
        document = self._session.document
        value = NamedOrientation(name, orientation, new_id("ori"))
        await self._editing.commit_one(context, document.add(Kind.ORIENTATION, value.id, value, point_id))

    async def _update(
        self, context: Context, value: NamedOrientation, change_type: ChangeType = ChangeType.UPDATE
    ) -> None:
        change = self._session.document.update(Kind.ORIENTATION, value.id, value)
        await self._editing.commit_one(context, change, change_type)

    @rpc("AddActionPointOrientation")
    async def add_orientation(self, context: Context, args: AddActionPointOrientationArgs) -> None:
        """Add an orientation to an action point."""
        self._session.require_project_open().action_point(args.action_point_id)
        self._check_name(args.name, args.action_point_id)
        self._editing.require_locked(context, args.action_point_id)
        await self._add(context, args.action_point_id, args.name, args.orientation)

    @rpc("AddActionPointOrientationUsingRobot")
    async def add_orientation_using_robot(
        self, context: Context, args: AddActionPointOrientationUsingRobotArgs
    ) -> None:
        """Add the present orientation of an end effector to an action point."""
        document = self._session.require_project_open()
        async with self._locks.read(context.user, args.robot.robot_id):
            self._online.require_online()
            document.action_point(args.action_point_id)
            self._check_name(args.name, args.action_point_id)
            self._editing.require_locked(context, args.action_point_id)
            orientation = await self._present_orientation(args.action_point_id, args.robot)
            self._check_name(args.name, args.action_point_id)
            await self._add(context, args.action_point_id, args.name, orientation)

    @rpc("UpdateActionPointOrientation")
    async def update_orientation(self, context: Context, args: UpdateActionPointOrientationArgs) -> None:
        """Change an orientation of an action point."""
        _, value = self._session.require_project_open().orientation(args.orientation_id)
        self._editing.require_locked(context, args.orientation_id)
        await self._update(context, replace(value, orientation=args.orientation))

    @rpc("UpdateActionPointOrientationUsingRobot")
    async def update_orientation_using_robot(
        self, context: Context, args: UpdateActionPointOrientationUsingRobotArgs
    ) -> None:
        """Set an orientation of an action point to the present orientation of an end effector."""
        document = self._session.require_project_open()
        async with self._locks.read(context.user, args.robot.robot_id):
            self._online.require_online()
            point, _ = document.orientation(args.orientation_id)
            self._editing.require_locked(context, args.orientation_id)
            orientation = await self._present_orientation(point.id, args.robot)
            _, value = document.orientation(args.orientation_id)
            await self._update(context, replace(value, orientation=orientation))

    @rpc("RenameActionPointOrientation")
    async def rename_orientation(self, context: Context, args: RenameActionPointOrientationArgs) -> None:
        """Rename an orientation."""
        point, value = self._session.require_project_open().orientation(args.orientation_id)
        self._check_name(args.new_name, point.id)
        self._editing.require_locked(context, args.orientation_id)
        await self._update(context, replace(value, name=args.new_name), ChangeType.UPDATE_BASE)

    @rpc("RemoveActionPointOrientation")
    async def remove_orientation(self, context: Context, args: RemoveActionPointOrientationArgs) -> None:
        """Remove an orientation. Refuse while an action uses it."""
        document = self._session.require_project_open()
        async with self._locks.auto_skip_held(context.user, args.orientation_id):
            _, value = document.orientation(args.orientation_id)
            if users := document.users_of(value.id):
                raise RequestRefused(
                    "The action {name} uses the orientation {value_name}.",
                    name=getattr(users[0], "name", ""),
                    value_name=value.name,
                )
            if await self._editing.commit_one(context, document.remove(Kind.ORIENTATION, value.id)):
                self._editing.drop_locks(context, value.id)
