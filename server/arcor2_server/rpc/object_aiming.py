"""Requests by which a robot shows where an object stands: its tip is put to one focus point after the other (7.3)."""

from typing import Final

import structlog

from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Mesh
from arcor2_hw.data.rpc import ObjectAimingAddPointArgs, ObjectAimingAddPointData, ObjectAimingStartArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.editing import eef_pose, require_held
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.rpc.scene_objects import move_object
from arcor2_server.workspace.object_aiming import Aim
from arcor2_server.workspace.point_registration import check_points, fit

log = structlog.get_logger(__name__)

WORST_MISS: Final = 0.05
"""By how much a touched point may miss, m; beyond that it was another point that was touched."""


def _focus_points(context: Context, obj: SceneObject) -> list[Pose]:
    """Give the focus points of an object's mesh; RequestRefused, InvalidData when it cannot be aimed at."""
    if isinstance(obj.pose, Unset):
        raise RequestRefused(f"{obj.name} has no pose.")
    wrapped = context.services.types.meta(obj.type).object_model
    model = None if isinstance(wrapped, Unset) else wrapped.model()
    if not isinstance(model, Mesh) or isinstance(model.focus_points, Unset) or not model.focus_points:
        raise RequestRefused(f"{obj.name} has no mesh with focus points.")
    check_points([point.position for point in model.focus_points], f"Focus points of {obj.type}")
    return model.focus_points


@rpc("ObjectAimingStart")
async def object_aiming_start(context: Context, args: ObjectAimingStartArgs) -> None:
    """Begin to aim at an object with a robot."""
    services, robot = context.services, args.robot
    document = services.session.require_scene_alone()
    services.cell.require_online()
    user = context.user
    if services.aiming.of(user, document) is not None:
        raise RequestRefused("You are aiming already: finish that, or cancel it.")
    points = _focus_points(context, document.scene_object(args.object_id))
    services.cell.robot(robot.robot_id)
    require_held(context, args.object_id)
    require_held(context, robot.robot_id)
    # Tells whether the robot has that arm and end effector, and knows where it is.
    await eef_pose(context, robot.robot_id, robot.end_effector, robot.arm_id)
    if services.aiming.of(user, services.session.require_scene_alone()) is not None:
        raise RequestRefused("You are aiming already: finish that, or cancel it.")
    if not context.dry_run:
        services.aiming.begin(user, Aim(args.object_id, robot, points, document))


@rpc("ObjectAimingAddPoint")
async def object_aiming_add_point(context: Context, args: ObjectAimingAddPointArgs) -> ObjectAimingAddPointData:
    """Take the present place of the tip for a focus point; gives those that are done."""
    services = context.services
    document = services.session.require_scene_open()
    aim = services.aiming.require(context.user, document)
    require_held(context, aim.object_id)
    require_held(context, aim.robot.robot_id)
    if not 0 <= args.point_idx < len(aim.points):
        raise RequestRefused(f"There is no focus point {args.point_idx}: they go from 0 to {len(aim.points) - 1}.")
    pose = await eef_pose(context, aim.robot.robot_id, aim.robot.end_effector, aim.robot.arm_id)
    if context.dry_run:
        return ObjectAimingAddPointData(sorted({*aim.poses, args.point_idx}))
    aim.poses[args.point_idx] = pose
    return ObjectAimingAddPointData(sorted(aim.poses))


@rpc("ObjectAimingDone")
async def object_aiming_done(context: Context, args: None) -> None:  # noqa: ARG001
    """Put the object where the robot found its focus points. The locks stay with the user."""
    services = context.services
    document = services.session.require_scene_open()
    user = context.user
    aim = services.aiming.require(user, document)
    if missing := [index for index in range(len(aim.points)) if index not in aim.poses]:
        raise RequestRefused(f"Focus points are missing: {', '.join(map(str, missing))}.")
    obj = document.scene_object(aim.object_id)
    touched = [aim.poses[index].position for index in range(len(aim.points))]
    found = fit([point.position for point in aim.points], touched)
    log.info("aimed", object=obj.name, worst=found.worst)
    if found.worst > WORST_MISS:
        raise RequestRefused(
            f"The points do not fit {obj.name}: one misses by {found.worst * 1000:.0f} mm. Was another one touched?"
        )
    await move_object(context, obj, found.pose)
    if not context.dry_run:
        services.aiming.end(user)


@rpc("ObjectAimingCancel")
async def object_aiming_cancel(context: Context, args: None) -> None:  # noqa: ARG001
    """Stop aiming; what was found is forgotten."""
    services, user = context.services, context.user
    services.aiming.require(user, services.session.document)
    if not context.dry_run:
        services.aiming.end(user)
