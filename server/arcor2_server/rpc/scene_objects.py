"""Requests that change the objects of the open scene (protocol, 7.2 and 7.3)."""

import ast

from msgspec.structs import replace

from arcor2_hw.data.base import Unset, new_id
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Box, Cylinder, Models, ObjectModel, ObjectTypeSource, Sphere
from arcor2_hw.data.rpc import (
    AddObjectToSceneArgs,
    AddVirtualCollisionObjectToSceneArgs,
    Pivot,
    RemoveFromSceneArgs,
    RenameArgs,
    UpdateObjectModelArgs,
    UpdateObjectParametersArgs,
    UpdateObjectPoseArgs,
    UpdateObjectPoseUsingRobotArgs,
)
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.collaboration.locks import ADDING_OBJECT, SCENE
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks import check_name, object_problems, settings_problems
from arcor2_server.documents.dependents import VIRTUAL, uses_object
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.editing import (
    commit,
    drop_locks,
    eef_pose,
    hide_secrets,
    require_free,
    require_held,
    tell,
    unlock,
)
from arcor2_server.rpc.object_types import require_mesh
from arcor2_server.rpc.registry import Context, rpc


@rpc("AddObjectToScene")
async def add_object_to_scene(context: Context, args: AddObjectToSceneArgs) -> None:
    """Place an object of a known type."""
    services = context.services
    async with services.locks.auto(context.user, SCENE):
        services.session.require_scene_alone()
        services.cell.require_offline()
        obj = SceneObject(args.name, args.type, args.pose, id=new_id("obj"))
        await _add(context, replace(obj, parameters=await hide_secrets(context, obj, args.parameters)))


async def _add(context: Context, obj: SceneObject) -> None:
    require_free(context, Kind.OBJECT, obj.name, "an object")
    if problems := object_problems(obj, context.services.types):
        raise InvalidData(" ".join(problems))
    changes = [context.services.session.document.add(Kind.OBJECT, obj.id, obj)]
    if await commit(context, changes):
        tell(context, changes, "SceneObjectChanged", ChangeType.ADD)


@rpc("AddVirtualCollisionObjectToScene")
async def add_virtual_collision_object(context: Context, args: AddVirtualCollisionObjectToSceneArgs) -> None:
    """Make an object type of a shape alone, and place one object of it."""
    services = context.services
    async with services.locks.auto(context.user, SCENE, ADDING_OBJECT):
        services.session.require_scene_alone()
        services.cell.require_offline()
        if services.types.known(args.name):
            raise RequestRefused(f"There is an object type called {args.name} already: choose another name.")
        require_free(context, Kind.OBJECT, args.name, "an object")
        check_name(args.name, "object")
        if _model_of(args.model).id != args.name:
            raise InvalidData(f"The model of {args.name} needs the id {args.name}.")
        if context.dry_run:
            return
        source = ObjectTypeSource(args.name, virtual_source(args.name), model=args.model)
        meta = await services.types.add(source)
        context.emit("ChangedObjectTypes", [meta], ChangeType.ADD)
        try:
            await _add(context, SceneObject(args.name, args.name, args.pose, [], new_id("obj")))
        except BaseException:
            await services.types.remove(args.name)
            raise


def virtual_source(name: str) -> str:
    """Give the module of an object type that is a shape alone."""
    base = ast.ImportFrom("arcor2_hw.objects", [ast.alias(VIRTUAL)], 0)
    concrete = ast.Assign([ast.Name("_ABSTRACT", ast.Store())], ast.Constant(False))
    of_type = ast.ClassDef(name, [ast.Name(VIRTUAL, ast.Load())], [], [concrete], [])
    return ast.unparse(ast.fix_missing_locations(ast.Module([base, of_type], []))) + "\n"


def _model_of(model: ObjectModel) -> Models:
    try:
        return model.model()
    except ValueError as error:
        raise InvalidData(f"A collision model is needed: {error}.") from None


@rpc("RemoveFromScene")
async def remove_from_scene(context: Context, args: RemoveFromSceneArgs) -> None:
    """Remove an object. By force also when projects use it: they lose what belongs to it when the scene is saved."""
    services, session = context.services, context.services.session
    document = session.require_scene_alone()
    async with services.locks.auto_skip_held(context.user, args.id):
        services.cell.require_offline()
        obj = document.scene_object(args.id)
        if not args.force and (users := await uses_object(services, args.id)):
            names = ", ".join(
                sorted([project.name for project in await services.storage.projects() if project.id in users])
            )
            raise RequestRefused(f"{obj.name} is used in {names}: change these projects, or remove it by force.")
        changes = [document.remove(Kind.OBJECT, args.id)]
        if await commit(context, changes):
            session.removed_types.add(obj.type)
            tell(context, changes, "SceneObjectChanged", ChangeType.REMOVE)
            drop_locks(context, args.id)


@rpc("UpdateObjectParameters")
async def update_object_parameters(context: Context, args: UpdateObjectParametersArgs) -> None:
    """Replace all settings of an object."""
    services = context.services
    document = services.session.require_scene_alone()
    services.cell.require_offline()
    obj = document.scene_object(args.id)
    if problems := settings_problems(obj.name, args.parameters, services.types.meta(obj.type)):
        raise InvalidData(" ".join(problems))
    require_held(context, args.id)
    parameters = await hide_secrets(context, obj, args.parameters, obj.parameters)
    require_held(context, args.id)
    await _update(context, replace(document.scene_object(args.id), parameters=parameters))


async def _update(context: Context, obj: SceneObject) -> None:
    changes = [context.services.session.document.update(Kind.OBJECT, obj.id, obj)]
    if await commit(context, changes):
        tell(context, changes, "SceneObjectChanged", ChangeType.UPDATE)


@rpc("UpdateObjectPose")
async def update_object_pose(context: Context, args: UpdateObjectPoseArgs) -> None:
    """Move an object; while online the live one moves too."""
    services = context.services
    obj = services.session.require_scene_alone().scene_object(args.object_id)
    if services.cell.online and services.types.derives_from(obj.type, "Robot"):
        raise RequestRefused(f"{obj.name} is a robot: it cannot be moved in the scene while it is online.")
    if isinstance(obj.pose, Unset):
        raise RequestRefused(f"{obj.name} has no pose.")
    require_held(context, args.object_id)
    await move_object(context, obj, args.pose)


async def move_object(context: Context, obj: SceneObject, pose: Pose) -> None:
    """Give an object another pose, and the live one too while online."""
    # First where it may fail: a refused request must not leave an edit behind that nobody was told of.
    if not context.dry_run and context.services.cell.online:
        await context.services.cell.object_pose_changed(obj.id, pose)
    obj = context.services.session.scene_object(obj.id)
    await _update(context, replace(obj, pose=pose))


@rpc("UpdateObjectPoseUsingRobot")
async def update_object_pose_using_robot(context: Context, args: UpdateObjectPoseUsingRobotArgs) -> None:
    """Put an object where the robot points."""
    services = context.services
    robot = args.robot
    if args.id == robot.robot_id:
        raise RequestRefused("A robot cannot point at itself.")
    document = services.session.require_scene_alone()
    async with services.locks.auto_skip_held(context.user, robot.robot_id, args.id):
        services.cell.require_online()
        obj = document.scene_object(args.id)
        if isinstance(obj.pose, Unset):
            raise RequestRefused(f"{obj.name} has no pose.")
        model = services.types.meta(obj.type).object_model
        offset = pivot_offset(model, args.pivot)
        pose = await eef_pose(context, robot.robot_id, robot.end_effector, robot.arm_id)
        await move_object(context, document.scene_object(args.id), pose * Pose(Position(0, 0, -offset), FLIPPED))


FLIPPED = Orientation(1, 0, 0, 0)
"""The tool points at the object: their z axes are opposite."""


def pivot_offset(model: ObjectModel | Unset, pivot: Pivot) -> float:
    """Give by how much the centre of an object lies behind the tool's tip along the tool's z axis, m."""
    if pivot is Pivot.MIDDLE:
        return 0.0
    shape = None if isinstance(model, Unset) else model.model()
    match shape:
        case Box():
            half = shape.size_z / 2
        case Cylinder():
            half = shape.height / 2
        case Sphere():
            half = shape.radius / 2
        case _:
            raise RequestRefused("Only a box, a cylinder or a sphere has a top and a bottom: use the middle.")
    return -half if pivot is Pivot.TOP else half


@rpc("RenameObject")
async def rename_object(context: Context, args: RenameArgs) -> None:
    """Give an object another name."""
    document = context.services.session.require_scene_alone()
    obj = document.scene_object(args.id)
    if args.new_name == obj.name:
        raise RequestRefused(f"The object is called {obj.name} already.")
    require_free(context, Kind.OBJECT, args.new_name, "an object")
    check_name(args.new_name, "object")
    require_held(context, args.id)
    await _update(context, replace(obj, name=args.new_name))
    if not context.dry_run:
        unlock(context, args.id)


@rpc("UpdateObjectModel")
async def update_object_model(context: Context, args: UpdateObjectModelArgs) -> None:
    """Give an object type another collision model."""
    services = context.services
    services.cell.require_offline()
    services.session.require_scene_alone()
    meta = services.types.meta(args.object_type_id)
    if meta.disabled or not services.types.derives_from(meta.type, "CollisionObject"):
        raise RequestRefused(f"{meta.type} takes no collision model.")
    if meta.object_model == args.object_model:
        raise RequestRefused(f"{meta.type} has this model already.")
    if _model_of(args.object_model).id != meta.type:
        raise InvalidData(f"The model of {meta.type} needs the id {meta.type}.")
    require_mesh(services, _model_of(args.object_model))
    require_held(context, args.object_type_id)
    try:
        stored = await services.storage.object_type(meta.type)
    except NotFound:
        raise RequestRefused(f"{meta.type} comes with an installed driver: its model cannot be changed.") from None
    if not context.dry_run:
        updated = await services.types.add(replace(stored, model=args.object_model))
        context.emit("ChangedObjectTypes", [updated], ChangeType.UPDATE)
