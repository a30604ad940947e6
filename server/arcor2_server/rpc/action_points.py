"""Requests that add, move and remove action points (protocol, 7.4)."""

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Unset, new_id
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.project import Action, ActionPoint, BareActionPoint, NamedOrientation, ProjectRobotJoints
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
from arcor2_server.documents.checks import check_name
from arcor2_server.documents.document import OWNED, Document
from arcor2_server.documents.reparenting import changes_for_parent, check_parent
from arcor2_server.errors import RequestRefused
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.editing import Editing, emit_changes
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.workspace.robots import optional


def _without_actions(document: Document, point_id: str) -> ActionPoint:
    return replace(document.full_point(point_id), actions=[])


def _check_unneeded(document: Document, point: BareActionPoint) -> None:
    if below := document.points_of(point.id):
        raise RequestRefused(
            "{name} hangs on {point_name}: remove it, or hang it elsewhere, first.",
            name=below[0].name,
            point_name=point.name,
        )
    own = {item.id for item in document.owned(point.id, Kind.ACTION)}
    for action_id in own:
        if document.outgoing(action_id) or document.incoming(action_id):
            raise RequestRefused(
                "{name} on {point_name} is in the logic.",
                name=document.action(action_id)[1].name,
                point_name=point.name,
            )
    for needed in (point.id, *(item.id for kind in OWNED for item in document.owned(point.id, kind))):
        for user in document.users_of(needed):
            if not isinstance(user, Action):
                raise RequestRefused("A condition of the logic uses a result of an action on {name}.", name=point.name)
            if user.id not in own:
                raise RequestRefused(
                    "The action {name} uses {point_name} or what belongs to it.", name=user.name, point_name=point.name
                )


class ActionPointRequests:
    """Requests that add, move and remove action points (protocol, 7.4)."""

    def __init__(self, locks: Locks, session: Session, online: OnlineScene, editing: Editing) -> None:
        self._locks = locks
        self._session = session
        self._online = online
        self._editing = editing

    def check_point_name(self, context: Context, name: str) -> None:
        """Refuse an invalid or used name of an action point."""
        check_name(name, "action point")
        self._editing.require_free(context, Kind.POINT, name, "an action point")

    @rpc("AddActionPoint")
    async def add_action_point(self, context: Context, args: AddActionPointArgs) -> None:
        """Add an action point, on an object, on another action point, or in the world."""
        document = self._session.require_project_open()
        async with self._locks.auto(context.user, PROJECT):
            self.check_point_name(context, args.name)
            parent = args.parent or UNSET
            if not isinstance(parent, Unset):
                check_parent(document, parent, args.name)
            point = BareActionPoint(args.name, args.position, parent, id=new_id("acp"))
            changes = [document.add(Kind.POINT, point.id, point)]
            if await self._editing.commit(context, changes):
                emit_changes(context, changes, "ActionPointChanged", ChangeType.ADD)

    @rpc("AddApUsingRobot")
    async def add_action_point_using_robot(self, context: Context, args: AddApUsingRobotArgs) -> None:
        """Add an action point where a robot's end effector is, with its orientation and joints."""
        check_name(args.name, "action point")
        document = self._session.require_project_open()
        async with self._locks.read(context.user, args.robot_id):
            self._online.require_online()
            self.check_point_name(context, args.name)
            pose = await self._editing.eef_pose(context, args.robot_id, args.end_effector_id, args.arm_id)
            joints = await self._online.robot_joints(args.robot_id, optional(args.arm_id))
            self.check_point_name(context, args.name)
            point = BareActionPoint(args.name, pose.position, id=new_id("acp"))
            orientation = NamedOrientation("default", pose.orientation, new_id("ori"))
            values = ProjectRobotJoints(
                "default", args.robot_id, joints, True, args.arm_id, args.end_effector_id, new_id("joi")
            )
            changes = [
                document.add(Kind.POINT, point.id, point),
                document.add(Kind.ORIENTATION, orientation.id, orientation, point.id),
                document.add(Kind.JOINTS, values.id, values, point.id),
            ]
            if await self._editing.commit(context, changes):
                context.emit("ActionPointChanged", point, ChangeType.ADD)
                context.emit("OrientationChanged", orientation, ChangeType.ADD, point.id)
                context.emit("JointsChanged", values, ChangeType.ADD, point.id)

    @rpc("RenameActionPoint")
    async def rename_action_point(self, context: Context, args: RenameActionPointArgs) -> None:
        """Give an action point another name."""
        document = self._session.require_project_open()
        point = document.action_point(args.action_point_id)
        if point.name == args.new_name:
            raise RequestRefused("The action point is called {name} already.", name=point.name)
        self.check_point_name(context, args.new_name)
        self._editing.require_held(context, point.id)
        changes = [document.update(Kind.POINT, point.id, replace(point, name=args.new_name))]
        if await self._editing.commit(context, changes):
            self._editing.unlock(context, point.id)
            emit_changes(context, changes, "ActionPointChanged", ChangeType.UPDATE_BASE)

    @rpc("UpdateActionPointPosition")
    async def update_action_point_position(self, context: Context, args: UpdateActionPointPositionArgs) -> None:
        """Move an action point, with all that hangs on it."""
        document = self._session.require_project_open()
        point = document.action_point(args.action_point_id)
        if not context.dry_run:
            self._editing.require_held(context, point.id, tree=True)
        elif not self._locks.could_lock_tree(context.user, point.id):
            raise RequestRefused("{name}, or something that hangs on it, is locked by somebody else.", name=point.name)
        await self._move(context, document, point, args.new_position)

    async def _move(self, context: Context, document: Document, point: BareActionPoint, position: Position) -> None:
        invalid = [
            document.update(Kind.JOINTS, item.id, replace(item.value, is_valid=False))
            for item in document.owned(point.id, Kind.JOINTS)
            if item.value.is_valid
        ]
        moved = document.update(Kind.POINT, point.id, replace(point, position=position))
        below = [
            document.update(Kind.JOINTS, item.id, replace(item.value, is_valid=False))
            for other in document.descendants(point.id)
            for item in document.owned(other.id, Kind.JOINTS)
            if item.value.is_valid
        ]
        if await self._editing.commit(context, [*invalid, *below, moved]):
            for change in (*invalid, *below):
                context.emit("JointsChanged", change.after, ChangeType.UPDATE, change.parent)
            emit_changes(context, [moved], "ActionPointChanged", ChangeType.UPDATE_BASE)

    @rpc("UpdateActionPointUsingRobot")
    async def update_action_point_using_robot(self, context: Context, args: UpdateActionPointUsingRobotArgs) -> None:
        """Move an action point to where a robot's end effector is."""
        document = self._session.require_project_open()
        self._online.require_online()
        self._editing.require_held(context, args.action_point_id)
        robot = args.robot
        async with self._locks.read(context.user, robot.robot_id):
            document.action_point(args.action_point_id)
            pose = await self._editing.eef_pose(context, robot.robot_id, robot.end_effector, robot.arm_id)
            point = document.action_point(args.action_point_id)
            await self._move(context, document, point, relative_pose(document, point, pose).position)

    @rpc("UpdateActionPointParent")
    async def update_action_point_parent(self, context: Context, args: UpdateActionPointParentArgs) -> None:
        """Hang an action point on another object or point, or on none; it stays where it is in the world."""
        document = self._session.require_project_open()
        point = document.action_point(args.action_point_id)
        old = "" if isinstance(point.parent, Unset) else point.parent
        if args.new_parent_id == old:
            return
        if args.new_parent_id == point.id:
            raise RequestRefused("{name} cannot hang on itself.", name=point.name)
        user, locks = context.user, self._locks
        skip_held = locks.auto_skip_held(user, *([old] if old else []))
        async with skip_held, locks.auto(user, *([args.new_parent_id] if args.new_parent_id else [])):
            changes, changed = changes_for_parent(document, point.id, args.new_parent_id)
            self._editing.require_held(context, point.id)
            if not await self._editing.commit(context, changes):
                return
            moving = [point.id, *document.tree_of(point.id)]
            locks.move_root(moving, document.root_of(point.id))
            for changed_id in changed:
                context.emit("ActionPointChanged", _without_actions(document, changed_id), ChangeType.UPDATE)
            self._editing.unlock(context, point.id)

    @rpc("RemoveActionPoint")
    async def remove_action_point(self, context: Context, args: IdArgs) -> None:
        """Remove an action point with its orientations, joints and actions; refused while something else needs them."""
        document = self._session.require_project_open()
        async with self._locks.auto_skip_held(context.user, args.id):
            point = document.action_point(args.id)
            owned = [item for kind in OWNED for item in document.owned(point.id, kind)]
            _check_unneeded(document, point)
            for item in owned:
                if self._locks.writer_of(item.id) not in (None, context.user):
                    raise RequestRefused(
                        "{name} on {point_name} is locked by somebody else.",
                        name=item.value.name,
                        point_name=point.name,
                    )
            changes: list[Change] = [document.remove(item.kind, item.id) for item in owned]
            changes.append(document.remove(Kind.POINT, point.id))
            if await self._editing.commit(context, changes):
                context.emit("ActionPointChanged", point, ChangeType.REMOVE)
                self._editing.drop_locks(context, point.id, *(item.id for item in owned))
