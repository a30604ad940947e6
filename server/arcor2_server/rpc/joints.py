"""Requests about robot joints kept at action points (protocol, 7.4)."""

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
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks import check_name
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.editing import commit, drop_locks, optional, require_free, require_held, tell
from arcor2_server.rpc.registry import Context, rpc


def _require_free(context: Context, name: str, point_id: str) -> None:
    require_free(context, Kind.JOINTS, name, "joints of this action point", point_id)


async def _update(context: Context, value: ProjectRobotJoints, change: ChangeType) -> None:
    changes = [context.services.session.document.update(Kind.JOINTS, value.id, value)]
    if await commit(context, changes):
        tell(context, changes, "JointsChanged", change)


@rpc("AddActionPointJointsUsingRobot")
async def add_joints_using_robot(context: Context, args: AddActionPointJointsUsingRobotArgs) -> None:
    """Keep the joints that a robot has now."""
    check_name(args.name, "set of joints")
    services = context.services
    document = services.session.require_project_open()
    async with services.locks.read(context.user, args.robot_id):
        services.cell.require_online()
        document.action_point(args.action_point_id)
        _require_free(context, args.name, args.action_point_id)
        require_held(context, args.action_point_id)
        joints = await services.cell.robot_joints(args.robot_id, optional(args.arm_id))
        document.action_point(args.action_point_id)
        _require_free(context, args.name, args.action_point_id)
        value = ProjectRobotJoints(
            args.name, args.robot_id, joints, True, args.arm_id, args.end_effector_id, new_id("joi")
        )
        changes = [document.add(Kind.JOINTS, value.id, value, args.action_point_id)]
        if await commit(context, changes):
            tell(context, changes, "JointsChanged", ChangeType.ADD, args.action_point_id)


@rpc("UpdateActionPointJoints")
async def update_joints(context: Context, args: UpdateActionPointJointsArgs) -> None:
    """Set the values of joints; they become valid."""
    point, value = context.services.session.require_project_open().joints(args.joints_id)
    given, known = [joint.name for joint in args.joints], {joint.name for joint in value.joints}
    if len(given) != len(set(given)) or set(given) != known:
        raise InvalidData(f"{value.name} has exactly the joints {', '.join(sorted(known))}.")
    require_held(context, point.id)
    await _update(context, replace(value, joints=list(args.joints), is_valid=True), ChangeType.UPDATE)


@rpc("UpdateActionPointJointsUsingRobot")
async def update_joints_using_robot(context: Context, args: UpdateActionPointJointsUsingRobotArgs) -> None:
    """Set joints to the values that their robot has now."""
    services = context.services
    document = services.session.require_project_open()
    services.cell.require_online()
    point, value = document.joints(args.joints_id)
    async with services.locks.read(context.user, value.robot_id):
        require_held(context, point.id)
        joints = await services.cell.robot_joints(value.robot_id, optional(value.arm_id))
        _, value = document.joints(args.joints_id)
        await _update(context, replace(value, joints=joints, is_valid=True), ChangeType.UPDATE)


@rpc("RenameActionPointJoints")
async def rename_joints(context: Context, args: RenameActionPointJointsArgs) -> None:
    """Give joints another name."""
    point, value = context.services.session.require_project_open().joints(args.joints_id)
    check_name(args.new_name, "set of joints")
    _require_free(context, args.new_name, point.id)
    require_held(context, point.id)
    await _update(context, replace(value, name=args.new_name), ChangeType.UPDATE_BASE)


@rpc("RemoveActionPointJoints")
async def remove_joints(context: Context, args: RemoveActionPointJointsArgs) -> None:
    """Remove joints; refused while an action uses them."""
    document = context.services.session.require_project_open()
    point, value = document.joints(args.joints_id)
    if users := document.users_of(value.id):
        raise RequestRefused(f"The action {getattr(users[0], 'name', '')} uses the joints {value.name}.")
    require_held(context, point.id)
    changes = [document.remove(Kind.JOINTS, value.id)]
    if await commit(context, changes):
        tell(context, changes, "JointsChanged", ChangeType.REMOVE)
        drop_locks(context, value.id)
