"""Requests about orientations of action points (protocol, 7.4)."""

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
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks import check_name
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.editing import commit, drop_locks, eef_pose, require_free, require_held, tell
from arcor2_server.rpc.registry import Context, rpc


def _check_name(context: Context, name: str, point_id: str) -> None:
    check_name(name, "orientation")
    require_free(context, Kind.ORIENTATION, name, "an orientation of this action point", point_id)


async def _relative(context: Context, point_id: str, robot: RobotArg) -> Orientation:
    """Give the orientation of an end effector in the frame in which those of the action point are stated."""
    document = context.services.session.document
    pose = await eef_pose(context, robot.robot_id, robot.end_effector, robot.arm_id)
    return relative_pose(document, document.action_point(point_id), pose).orientation


async def _add(context: Context, point_id: str, name: str, orientation: Orientation) -> None:
    document = context.services.session.document
    value = NamedOrientation(name, orientation, new_id("ori"))
    changes = [document.add(Kind.ORIENTATION, value.id, value, point_id)]
    if await commit(context, changes):
        tell(context, changes, "OrientationChanged", ChangeType.ADD, point_id)


async def _update(context: Context, value: NamedOrientation, change: ChangeType) -> None:
    changes = [context.services.session.document.update(Kind.ORIENTATION, value.id, value)]
    if await commit(context, changes):
        tell(context, changes, "OrientationChanged", change)


@rpc("AddActionPointOrientation")
async def add_orientation(context: Context, args: AddActionPointOrientationArgs) -> None:
    """Add an orientation to an action point."""
    context.services.session.require_project_open().action_point(args.action_point_id)
    _check_name(context, args.name, args.action_point_id)
    require_held(context, args.action_point_id)
    await _add(context, args.action_point_id, args.name, args.orientation)


@rpc("AddActionPointOrientationUsingRobot")
async def add_orientation_using_robot(context: Context, args: AddActionPointOrientationUsingRobotArgs) -> None:
    """Add the orientation that a robot's end effector has now."""
    services = context.services
    document = services.session.require_project_open()
    async with services.locks.read(context.user, args.robot.robot_id):
        services.cell.require_online()
        document.action_point(args.action_point_id)
        _check_name(context, args.name, args.action_point_id)
        require_held(context, args.action_point_id)
        orientation = await _relative(context, args.action_point_id, args.robot)
        _check_name(context, args.name, args.action_point_id)
        await _add(context, args.action_point_id, args.name, orientation)


@rpc("UpdateActionPointOrientation")
async def update_orientation(context: Context, args: UpdateActionPointOrientationArgs) -> None:
    """Turn an orientation."""
    _, value = context.services.session.require_project_open().orientation(args.orientation_id)
    require_held(context, args.orientation_id)
    await _update(context, replace(value, orientation=args.orientation), ChangeType.UPDATE)


@rpc("UpdateActionPointOrientationUsingRobot")
async def update_orientation_using_robot(context: Context, args: UpdateActionPointOrientationUsingRobotArgs) -> None:
    """Turn an orientation to the one that a robot's end effector has now."""
    services = context.services
    document = services.session.require_project_open()
    async with services.locks.read(context.user, args.robot.robot_id):
        services.cell.require_online()
        point, _ = document.orientation(args.orientation_id)
        require_held(context, args.orientation_id)
        orientation = await _relative(context, point.id, args.robot)
        _, value = document.orientation(args.orientation_id)
        await _update(context, replace(value, orientation=orientation), ChangeType.UPDATE)


@rpc("RenameActionPointOrientation")
async def rename_orientation(context: Context, args: RenameActionPointOrientationArgs) -> None:
    """Give an orientation another name."""
    point, value = context.services.session.require_project_open().orientation(args.orientation_id)
    _check_name(context, args.new_name, point.id)
    require_held(context, args.orientation_id)
    await _update(context, replace(value, name=args.new_name), ChangeType.UPDATE_BASE)


@rpc("RemoveActionPointOrientation")
async def remove_orientation(context: Context, args: RemoveActionPointOrientationArgs) -> None:
    """Remove an orientation; refused while an action uses it."""
    services = context.services
    document = services.session.require_project_open()
    async with services.locks.auto_skip_held(context.user, args.orientation_id):
        _, value = document.orientation(args.orientation_id)
        if users := document.users_of(value.id):
            raise RequestRefused(f"The action {getattr(users[0], 'name', '')} uses the orientation {value.name}.")
        changes = [document.remove(Kind.ORIENTATION, value.id)]
        if await commit(context, changes):
            tell(context, changes, "OrientationChanged", ChangeType.REMOVE)
            drop_locks(context, value.id)
