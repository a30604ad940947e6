"""Requests that add, move and remove action points (protocol, 7.4)."""

from dataclasses import dataclass

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Unset, new_id
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.project import BareActionPoint, NamedOrientation, ProjectRobotJoints
from arcor2_hw.data.project_index import relative_pose
from arcor2_hw.data.rpc import (
    AddActionPointArgs,
    AddApUsingRobotArgs,
    IdArgs,
    RenameActionPointArgs,
    UpdateActionPointParentArgs,
    UpdateActionPointPositionArgs,
    UpdateActionPointUsingRobotArgs,
)
from arcor2_server.collaboration.locks import PROJECT, Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.checks.names import check_name
from arcor2_server.documents.document import Document
from arcor2_server.documents.item_indexes import OWNED
from arcor2_server.documents.removal import require_point_unused
from arcor2_server.documents.reparenting import changes_for_parent, check_parent
from arcor2_server.errors import RequestRefused
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.change_events import emit_all
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.workspace.robots import optional


@dataclass(frozen=True, slots=True)
class ActionPointRequests:
    """Requests that add, move and remove action points (protocol, 7.4)."""

    _locks: Locks
    _session: Session
    _online: OnlineScene
    _editing: Editing

    def _check_name(self, name: str) -> None:
        check_name(name, "action point")
        self._editing.require_name_free(Kind.POINT, name, "an action point")

    @rpc("AddActionPoint")
    async def add_action_point(self, context: Context, args: AddActionPointArgs) -> None:
        """Add an action point whose parent is an object, another action point or the world."""
        document = self._session.require_project_open()
        async with self._locks.auto(context.user, PROJECT):
            self._check_name(args.name)
            parent = args.parent or UNSET
            if not isinstance(parent, Unset):
                check_parent(document, parent, args.name)
            point = BareActionPoint(args.name, args.position, parent, id=new_id("acp"))
            await self._editing.commit_one(context, document.add(Kind.POINT, point.id, point))

    @rpc("AddApUsingRobot")
    async def add_action_point_using_robot(self, context: Context, args: AddApUsingRobotArgs) -> None:
        """Add an action point at the pose of an end effector, with its orientation and the joints of the robot."""
        check_name(args.name, "action point")
        document = self._session.require_project_open()
        async with self._locks.read(context.user, args.robot_id):
            self._online.require_online()
            self._check_name(args.name)
            arm_id = optional(args.arm_id)
            pose = await self._online.end_effector_pose(args.robot_id, args.end_effector_id, arm_id)
            joints = await self._online.robot_joints(args.robot_id, arm_id)
            self._check_name(args.name)
            point = BareActionPoint(args.name, pose.position, id=new_id("acp"))
            orientation = NamedOrientation("default", pose.orientation, new_id("ori"))
            stored_joints = ProjectRobotJoints(
                "default", args.robot_id, joints, True, args.arm_id, args.end_effector_id, new_id("joi")
            )
            changes = [
                document.add(Kind.POINT, point.id, point),
                document.add(Kind.ORIENTATION, orientation.id, orientation, point.id),
                document.add(Kind.JOINTS, stored_joints.id, stored_joints, point.id),
            ]
            if await self._editing.commit(context, changes):
                emit_all(context, self._session, changes)

    @rpc("RenameActionPoint")
    async def rename_action_point(self, context: Context, args: RenameActionPointArgs) -> None:
        """Rename an action point."""
        document = self._session.require_project_open()
        point = document.action_point(args.action_point_id)
        if point.name == args.new_name:
            raise RequestRefused("The action point already has the name {name}.", name=point.name)
        self._check_name(args.new_name)
        self._editing.require_locked(context, point.id)
        renamed = replace(point, name=args.new_name)
        if await self._editing.commit(context, [document.update(Kind.POINT, point.id, renamed)]):
            self._editing.unlock(context, point.id)
            context.emit("ActionPointChanged", renamed, ChangeType.UPDATE_BASE)

    @rpc("UpdateActionPointPosition")
    async def update_action_point_position(self, context: Context, args: UpdateActionPointPositionArgs) -> None:
        """Move an action point together with its descendants."""
        document = self._session.require_project_open()
        point = document.action_point(args.action_point_id)
        if not context.dry_run:
            self._editing.require_locked(context, point.id, tree=True)
        elif not self._locks.could_lock_tree(context.user, point.id):
            raise RequestRefused("{name} or one of its descendants is locked by another user.", name=point.name)
        await self._move(context, document, point, args.new_position)

    async def _move(self, context: Context, document: Document, point: BareActionPoint, position: Position) -> None:
        """Move an action point. The joints of it and of its descendants become invalid."""
        moved = replace(point, position=position)
        invalid_joints = [
            document.update(Kind.JOINTS, item.id, replace(item.value, is_valid=False))
            for moving in (point, *document.descendants(point.id))
            for item in document.owned(moving.id, Kind.JOINTS)
            if item.value.is_valid
        ]
        if await self._editing.commit(context, [*invalid_joints, document.update(Kind.POINT, point.id, moved)]):
            for change in invalid_joints:
                context.emit("JointsChanged", change.after, ChangeType.UPDATE, change.parent)
            context.emit("ActionPointChanged", moved, ChangeType.UPDATE_BASE)

    @rpc("UpdateActionPointUsingRobot")
    async def update_action_point_using_robot(self, context: Context, args: UpdateActionPointUsingRobotArgs) -> None:
        """Move an action point to the position of an end effector."""
        document = self._session.require_project_open()
        self._online.require_online()
        self._editing.require_locked(context, args.action_point_id)
        robot = args.robot
        async with self._locks.read(context.user, robot.robot_id):
            document.action_point(args.action_point_id)
            pose = await self._online.end_effector_pose(robot.robot_id, robot.end_effector, optional(robot.arm_id))
            point = document.action_point(args.action_point_id)
            await self._move(context, document, point, relative_pose(document, point, pose).position)

    @rpc("UpdateActionPointParent")
    async def update_action_point_parent(self, context: Context, args: UpdateActionPointParentArgs) -> None:
        """Change the parent of an action point: an object, an action point or none. Its pose in the world is kept."""
        document = self._session.require_project_open()
        point = document.action_point(args.action_point_id)
        old = "" if isinstance(point.parent, Unset) else point.parent
        if args.new_parent_id == old:
            return
        if args.new_parent_id == point.id:
            raise RequestRefused("{name} cannot be its own parent.", name=point.name)
        user, locks = context.user, self._locks
        skip_held = locks.auto_skip_held(user, *([old] if old else []))
        async with skip_held, locks.auto(user, *([args.new_parent_id] if args.new_parent_id else [])):
            changes, changed = changes_for_parent(document, point.id, args.new_parent_id)
            self._editing.require_locked(context, point.id)
            if not await self._editing.commit(context, changes):
                return
            locks.move_root([point.id, *document.tree_of(point.id)], document.root_of(point.id))
            for changed_id in changed:
                without_actions = replace(document.full_point(changed_id), actions=[])
                context.emit("ActionPointChanged", without_actions, ChangeType.UPDATE)
            self._editing.unlock(context, point.id)

    @rpc("RemoveActionPoint")
    async def remove_action_point(self, context: Context, args: IdArgs) -> None:
        """Remove an action point with its orientations, joints and actions. Refuse while something else uses them."""
        document = self._session.require_project_open()
        async with self._locks.auto_skip_held(context.user, args.id):
            point = document.action_point(args.id)
            owned = [item for kind in OWNED for item in document.owned(point.id, kind)]
            require_point_unused(document, point)
            for item in owned:
                if self._locks.writer_of(item.id) not in (None, context.user):
                    raise RequestRefused(
                        "{name} on {point_name} is locked by another user.",
                        name=item.value.name,
                        point_name=point.name,
                    )
            changes: list[Change] = [document.remove(item.kind, item.id) for item in owned]
            changes.append(document.remove(Kind.POINT, point.id))
            if await self._editing.commit(context, changes):
                context.emit("ActionPointChanged", point, ChangeType.REMOVE)
                self._editing.drop_locks(context, point.id, *(item.id for item in owned))
