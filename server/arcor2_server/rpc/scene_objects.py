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
from arcor2_server.collaboration.locks import ADDING_OBJECT, SCENE, Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks import check_name, object_problems, settings_problems
from arcor2_server.documents.dependents import VIRTUAL, Dependents
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.editing import (
    Editing,
    emit_changes,
)
from arcor2_server.rpc.object_types import require_mesh
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.storage import AssetStore, Storage


def virtual_source(name: str) -> str:
    """Return the module of an object type that is a shape alone."""
    base = ast.ImportFrom("arcor2_hw.objects", [ast.alias(VIRTUAL)], 0)
    concrete = ast.Assign([ast.Name("_ABSTRACT", ast.Store())], ast.Constant(False))
    of_type = ast.ClassDef(name, [ast.Name(VIRTUAL, ast.Load())], [], [concrete], [])
    return ast.unparse(ast.fix_missing_locations(ast.Module([base, of_type], []))) + "\n"


def _model_of(model: ObjectModel) -> Models:
    try:
        return model.model()
    except ValueError as error:
        raise InvalidData("A collision model is needed: {reason}.", reason=error) from None


FLIPPED = Orientation(1, 0, 0, 0)
"""The tool points at the object: their z axes are opposite."""


def pivot_offset(model: ObjectModel | Unset, pivot: Pivot) -> float:
    """Return by how much the centre of an object lies behind the tool's tip along the tool's z axis, m."""
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


class SceneObjectRequests:
    """Requests that change the objects of the open scene (protocol, 7.2 and 7.3)."""

    def __init__(
        self,
        locks: Locks,
        storage: Storage,
        assets: AssetStore,
        types: ObjectTypes,
        session: Session,
        online: OnlineScene,
        dependents: Dependents,
        editing: Editing,
    ) -> None:
        self._locks = locks
        self._storage = storage
        self._assets = assets
        self._types = types
        self._session = session
        self._online = online
        self._dependents = dependents
        self._editing = editing

    @rpc("AddObjectToScene")
    async def add_object_to_scene(self, context: Context, args: AddObjectToSceneArgs) -> None:
        """Place an object of a known type."""
        async with self._locks.auto(context.user, SCENE):
            self._session.require_scene_alone()
            self._online.require_offline()
            obj = SceneObject(args.name, args.type, args.pose, id=new_id("obj"))
            await self._add(
                context, replace(obj, parameters=await self._editing.hide_secrets(context, obj, args.parameters))
            )

    async def _add(self, context: Context, obj: SceneObject) -> None:
        self._editing.require_free(context, Kind.OBJECT, obj.name, "an object")
        if problems := object_problems(obj, self._types):
            raise InvalidData(" ".join(problems))
        changes = [self._session.document.add(Kind.OBJECT, obj.id, obj)]
        if await self._editing.commit(context, changes):
            emit_changes(context, changes, "SceneObjectChanged", ChangeType.ADD)

    @rpc("AddVirtualCollisionObjectToScene")
    async def add_virtual_collision_object(self, context: Context, args: AddVirtualCollisionObjectToSceneArgs) -> None:
        """Create an object type of a shape alone, and place one object of it."""
        async with self._locks.auto(context.user, SCENE, ADDING_OBJECT):
            self._session.require_scene_alone()
            self._online.require_offline()
            if self._types.known(args.name):
                raise RequestRefused(
                    "There is an object type called {name} already: choose another name.", name=args.name
                )
            self._editing.require_free(context, Kind.OBJECT, args.name, "an object")
            check_name(args.name, "object")
            if _model_of(args.model).id != args.name:
                raise InvalidData("The model of {name} needs the id {name}.", name=args.name)
            if context.dry_run:
                return
            source = ObjectTypeSource(args.name, virtual_source(args.name), model=args.model)
            meta = await self._types.add(source)
            context.emit("ChangedObjectTypes", [meta], ChangeType.ADD)
            try:
                await self._add(context, SceneObject(args.name, args.name, args.pose, [], new_id("obj")))
            except BaseException:
                await self._types.remove(args.name)
                raise

    @rpc("RemoveFromScene")
    async def remove_from_scene(self, context: Context, args: RemoveFromSceneArgs) -> None:
        """Remove an object. With `force`, also if projects use it: they lose its items when the scene is saved."""
        session = self._session
        document = session.require_scene_alone()
        async with self._locks.auto_skip_held(context.user, args.id):
            self._online.require_offline()
            obj = document.scene_object(args.id)
            if not args.force and (users := await self._dependents.uses_object(args.id)):
                names = ", ".join(
                    sorted([project.name for project in await self._storage.projects() if project.id in users])
                )
                raise RequestRefused(
                    "{name} is used in {names}: change these projects, or remove it by force.",
                    name=obj.name,
                    names=names,
                )
            changes = [document.remove(Kind.OBJECT, args.id)]
            if await self._editing.commit(context, changes):
                session.removed_types.add(obj.type)
                emit_changes(context, changes, "SceneObjectChanged", ChangeType.REMOVE)
                self._editing.drop_locks(context, args.id)

    @rpc("UpdateObjectParameters")
    async def update_object_parameters(self, context: Context, args: UpdateObjectParametersArgs) -> None:
        """Replace all settings of an object."""
        document = self._session.require_scene_alone()
        self._online.require_offline()
        obj = document.scene_object(args.id)
        if problems := settings_problems(obj.name, args.parameters, self._types.meta(obj.type)):
            raise InvalidData(" ".join(problems))
        self._editing.require_held(context, args.id)
        parameters = await self._editing.hide_secrets(context, obj, args.parameters, obj.parameters)
        self._editing.require_held(context, args.id)
        await self._update(context, replace(document.scene_object(args.id), parameters=parameters))

    async def _update(self, context: Context, obj: SceneObject) -> None:
        changes = [self._session.document.update(Kind.OBJECT, obj.id, obj)]
        if await self._editing.commit(context, changes):
            emit_changes(context, changes, "SceneObjectChanged", ChangeType.UPDATE)

    @rpc("UpdateObjectPose")
    async def update_object_pose(self, context: Context, args: UpdateObjectPoseArgs) -> None:
        """Move an object; while online the live one moves too."""
        obj = self._session.require_scene_alone().scene_object(args.object_id)
        if self._online.online and self._types.derives_from(obj.type, "Robot"):
            raise RequestRefused(
                "{name} is a robot: it cannot be moved in the scene while it is online.", name=obj.name
            )
        if isinstance(obj.pose, Unset):
            raise RequestRefused("{name} has no pose.", name=obj.name)
        self._editing.require_held(context, args.object_id)
        await self.move_object(context, obj, args.pose)

    async def move_object(self, context: Context, obj: SceneObject, pose: Pose) -> None:
        """Give an object another pose, and the live one too while online."""
        # First where it may fail: a refused request must not leave an edit behind that nobody was told of.
        if not context.dry_run and self._online.online:
            await self._online.object_pose_changed(obj.id, pose)
        obj = self._session.document.scene_object(obj.id)
        await self._update(context, replace(obj, pose=pose))

    @rpc("UpdateObjectPoseUsingRobot")
    async def update_object_pose_using_robot(self, context: Context, args: UpdateObjectPoseUsingRobotArgs) -> None:
        """Put an object where the robot points."""
        robot = args.robot
        if args.id == robot.robot_id:
            raise RequestRefused("A robot cannot point at itself.")
        document = self._session.require_scene_alone()
        async with self._locks.auto_skip_held(context.user, robot.robot_id, args.id):
            self._online.require_online()
            obj = document.scene_object(args.id)
            if isinstance(obj.pose, Unset):
                raise RequestRefused("{name} has no pose.", name=obj.name)
            model = self._types.meta(obj.type).object_model
            offset = pivot_offset(model, args.pivot)
            pose = await self._editing.eef_pose(context, robot.robot_id, robot.end_effector, robot.arm_id)
            await self.move_object(
                context, document.scene_object(args.id), pose * Pose(Position(0, 0, -offset), FLIPPED)
            )

    @rpc("RenameObject")
    async def rename_object(self, context: Context, args: RenameArgs) -> None:
        """Give an object another name."""
        document = self._session.require_scene_alone()
        obj = document.scene_object(args.id)
        if args.new_name == obj.name:
            raise RequestRefused("The object is called {name} already.", name=obj.name)
        self._editing.require_free(context, Kind.OBJECT, args.new_name, "an object")
        check_name(args.new_name, "object")
        self._editing.require_held(context, args.id)
        await self._update(context, replace(obj, name=args.new_name))
        if not context.dry_run:
            self._editing.unlock(context, args.id)

    @rpc("UpdateObjectModel")
    async def update_object_model(self, context: Context, args: UpdateObjectModelArgs) -> None:
        """Give an object type another collision model."""
        self._online.require_offline()
        self._session.require_scene_alone()
        meta = self._types.meta(args.object_type_id)
        if meta.disabled or not self._types.derives_from(meta.type, "CollisionObject"):
            raise RequestRefused("{type} takes no collision model.", type=meta.type)
        if meta.object_model == args.object_model:
            raise RequestRefused("{type} has this model already.", type=meta.type)
        if _model_of(args.object_model).id != meta.type:
            raise InvalidData("The model of {type} needs the id {type}.", type=meta.type)
        require_mesh(self._assets, _model_of(args.object_model))
        self._editing.require_held(context, args.object_type_id)
        try:
            stored = await self._storage.object_type(meta.type)
        except NotFound:
            raise RequestRefused(
                "{type} comes with an installed driver: its model cannot be changed.", type=meta.type
            ) from None
        if not context.dry_run:
            updated = await self._types.add(replace(stored, model=args.object_model))
            context.emit("ChangedObjectTypes", [updated], ChangeType.UPDATE)
