"""Requests that change the objects of the open scene (protocol, 7.2 and 7.3)."""

from dataclasses import dataclass

import structlog
from msgspec.structs import replace

from arcor2_hw.actions.json_values import decode_json, encode
from arcor2_hw.data.base import UNSET, Unset, new_id
from arcor2_hw.data.discovery import NETWORK, Search
from arcor2_hw.data.events import ChangeType, SceneStateEnum
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models, ObjectModel, ObjectTypeSource
from arcor2_hw.data.rpc import (
    AddObjectToSceneArgs,
    AddVirtualCollisionObjectToSceneArgs,
    CheckConnectionArgs,
    CheckConnectionData,
    FindDevicesArgs,
    FoundDevice,
    RemoveFromSceneArgs,
    RenameArgs,
    UpdateObjectModelArgs,
    UpdateObjectParametersArgs,
    UpdateObjectPoseArgs,
    UpdateObjectPoseUsingRobotArgs,
)
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_hw.messages import Message
from arcor2_hw.runtime.network_search import addresses_of
from arcor2_server.collaboration.locks import ADDING_OBJECT, SCENE, Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks.interlocks import using
from arcor2_server.documents.checks.names import check_name
from arcor2_server.documents.checks.scene import object_problems, settings_problems
from arcor2_server.documents.dependents import VIRTUAL, Dependents, invalid_joints_below
from arcor2_server.documents.document import Document
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.derived_types import virtual_source
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.connection_check import ConnectionCheck
from arcor2_server.online.device_search import BUS, bus_of, search, value_of
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.change_events import emit_all
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.object_types import require_mesh
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.storage import AssetStore, Storage
from arcor2_server.workspace.pivot import pivot_offset
from arcor2_server.workspace.robots import optional

log = structlog.get_logger(__name__)


def _model_of(model: ObjectModel) -> Models:
    """Return the collision model. Raise InvalidData if there is none."""
    try:
        return model.model()
    except ValueError as error:
        raise InvalidData("The collision model is missing or invalid: {reason}.", reason=error) from None


@dataclass(frozen=True, slots=True)
class SceneObjectRequests:
    """Requests that change the objects of the open scene (protocol, 7.2 and 7.3)."""

    _locks: Locks
    _storage: Storage
    _assets: AssetStore
    _types: ObjectTypes
    _session: Session
    _online: OnlineScene
    _dependents: Dependents
    _editing: Editing
    _connection_check: ConnectionCheck

    def _document(self, *, with_project: bool) -> Document:
        """Return the document if its scene may be edited: with a project open, only by the additional requests."""
        return self._session.require_scene_open() if with_project else self._session.require_scene_alone()

    # ------------------------------------------------------------------------------------ adding
    @rpc("AddObjectToScene")
    async def add_object_to_scene(self, context: Context, args: AddObjectToSceneArgs) -> None:
        """Add an object of a known type to the scene."""
        async with self._locks.auto(context.user, SCENE):
            self._session.require_scene_alone()
            self._online.require_offline()
            await self._add_object(context, self._new_object(args))

    @rpc("AddSceneObject")
    async def add_scene_object(self, context: Context, args: AddObjectToSceneArgs) -> None:
        """Add an object also while a project is open or the scene is online; then it is connected, too."""
        async with self._locks.auto(context.user, SCENE):
            self._session.require_scene_open()
            obj = self._new_object(args)
            await self._online.prepare_addition(obj, dry_run=context.dry_run)
            obj = await self._add_object(context, obj)
        if not context.dry_run and self._online.online:
            self._online.connect_added(obj)

    def _new_object(self, args: AddObjectToSceneArgs) -> SceneObject:
        """Return the object that a request adds, with its settings as sent. Raise Arcor2Error if it is invalid."""
        obj = SceneObject(args.name, args.type, args.pose, args.parameters, new_id("obj"), args.node or UNSET)
        self._check(obj)
        return obj

    async def _add_object(self, context: Context, obj: SceneObject) -> SceneObject:
        obj = replace(obj, parameters=await self._editing.hide_secrets(context, obj, obj.parameters))
        await self._add(context, obj)
        return obj

    def _check(self, obj: SceneObject) -> None:
        self._editing.require_name_free(Kind.OBJECT, obj.name, "an object")
        if problems := object_problems(obj, self._types):
            raise InvalidData(Message.joined(problems))

    async def _add(self, context: Context, obj: SceneObject) -> None:
        self._check(obj)
        await self._editing.commit_one(context, self._session.document.add(Kind.OBJECT, obj.id, obj))

    @rpc("AddVirtualCollisionObjectToScene")
    async def add_virtual_collision_object(self, context: Context, args: AddVirtualCollisionObjectToSceneArgs) -> None:
        """Add an object that consists of a collision model, with an object type created for it."""
        async with self._locks.auto(context.user, SCENE, ADDING_OBJECT):
            self._session.require_scene_alone()
            await self._add_shape(context, args)

    @rpc("AddSceneShape")
    async def add_scene_shape(self, context: Context, args: AddVirtualCollisionObjectToSceneArgs) -> None:
        """Add an object that consists of a collision model, also while a project is open."""
        async with self._locks.auto(context.user, SCENE, ADDING_OBJECT):
            self._session.require_scene_open()
            await self._add_shape(context, args)

    async def _add_shape(self, context: Context, args: AddVirtualCollisionObjectToSceneArgs) -> None:
        self._online.require_offline()
        if self._types.known(args.name):
            raise RequestRefused("An object type called {name} already exists. Choose another name.", name=args.name)
        self._editing.require_name_free(Kind.OBJECT, args.name, "an object")
        check_name(args.name, "object")
        if _model_of(args.model).id != args.name:
            raise InvalidData("The model of {name} needs the id {name}.", name=args.name)
        if context.dry_run:
            return
        source = ObjectTypeSource(args.name, virtual_source(args.name, VIRTUAL), model=args.model)
        meta = await self._types.add(source)
        context.emit("ChangedObjectTypes", [meta], ChangeType.ADD)
        try:
            await self._add(context, SceneObject(args.name, args.name, args.pose, [], new_id("obj")))
        except BaseException:
            await self._types.remove(args.name)
            raise

    @rpc("CheckConnection")
    async def check_connection(self, context: Context, args: CheckConnectionArgs) -> CheckConnectionData:
        """Connect a device that is not online, and return the data that it reports."""
        if args.id and self._online.state is not SceneStateEnum.STOPPED:
            raise RequestRefused("The scene is online. Its devices are connected already.")
        pose = Pose() if self._types.meta(args.type).has_pose else UNSET
        node = self._node_of(args.id) or args.node or UNSET
        obj = SceneObject(args.type, args.type, pose, args.parameters, args.id or new_id("obj"), node)
        if problems := object_problems(obj, self._types):
            raise InvalidData(Message.joined(problems))
        return await self._connection_check.run(obj)

    def _node_of(self, object_id: str) -> str:
        """Return the node on which an object of the open scene runs; empty for none."""
        scene = self._session.document.scene
        own = [each for each in (scene.objects if scene else []) if each.id == object_id]
        return self._online.host.node_of(own[0]) if own else ""

    @rpc("FindDevices")
    async def find_devices(self, context: Context, args: FindDevicesArgs) -> list[FoundDevice]:
        """Search for values of a setting of a device."""
        settings = {each.name: each for each in self._types.meta(args.type).settings}
        wanted = settings.get(args.setting)
        if wanted is None or isinstance(wanted.found_by, Unset):
            raise InvalidData("No search finds the setting {setting} of {type}.", setting=args.setting, type=args.type)
        kind, where, port = Search(wanted.found_by), "", None
        values = {each.name: each.default_value for each in settings.values() if each.default_value is not UNSET}
        values |= {each.name: each.value for each in args.parameters}
        if kind is Search.CAN:
            self._online.require_offline()  # a serial adapter serves only one program
            where = bus_of({name: decode_json(value, str | int) for name, value in values.items() if name in BUS})
        elif kind in NETWORK:
            where = ",".join(addresses_of(args.addresses))
            log.info("network searched", kind=kind.value, addresses=args.addresses, user=context.user)
            if kind is Search.MODBUS and "port" in values:
                port = decode_json(values["port"], int)
        return [
            FoundDevice(encode(value_of(found, kind)), found.address, found.description, found.serial)
            for found in await search(kind, where, port)
        ]

    # ------------------------------------------------------------------------------------ changing
    @rpc("RemoveFromScene")
    async def remove_from_scene(self, context: Context, args: RemoveFromSceneArgs) -> None:
        """Remove an object. With `force`, also if projects use it; saving the scene removes its items from them."""
        session = self._session
        document = session.require_scene_alone()
        async with self._locks.auto_skip_held(context.user, args.id):
            self._online.require_offline()
            obj = document.scene_object(args.id)
            for interlock in using(args.id, document.interlocks()):
                raise RequestRefused(
                    "{name} is used by the interlock {interlock}. Delete it first.",
                    name=obj.name,
                    interlock=interlock.name,
                )
            if not args.force and (users := await self._dependents.uses_object(args.id)):
                names = ", ".join(
                    sorted([project.name for project in await self._storage.projects() if project.id in users])
                )
                raise RequestRefused(
                    "{name} is used in {names}. Change these projects, or remove it with force.",
                    name=obj.name,
                    names=names,
                )
            if await self._editing.commit_one(context, document.remove(Kind.OBJECT, args.id)):
                session.removed_types.add(obj.type)
                self._editing.drop_locks(context, args.id)

    @rpc("UpdateObjectParameters")
    async def update_object_parameters(self, context: Context, args: UpdateObjectParametersArgs) -> None:
        """Replace all settings of an object."""
        await self._update_parameters(context, args, with_project=False)

    @rpc("UpdateSceneObjectSettings")
    async def update_scene_object_parameters(self, context: Context, args: UpdateObjectParametersArgs) -> None:
        """Replace all settings of an object, also while a project is open."""
        await self._update_parameters(context, args, with_project=True)

    async def _update_parameters(
        self, context: Context, args: UpdateObjectParametersArgs, *, with_project: bool
    ) -> None:
        document = self._document(with_project=with_project)
        self._online.require_offline()
        obj = document.scene_object(args.id)
        if problems := settings_problems(obj.name, args.parameters, self._types.meta(obj.type)):
            raise InvalidData(Message.joined(problems))
        self._editing.require_locked(context, args.id)
        parameters = await self._editing.hide_secrets(context, obj, args.parameters, obj.parameters)
        self._editing.require_locked(context, args.id)
        await self._update(context, replace(document.scene_object(args.id), parameters=parameters))

    async def _update(self, context: Context, obj: SceneObject) -> None:
        await self._editing.commit_one(context, self._session.document.update(Kind.OBJECT, obj.id, obj))

    @rpc("UpdateObjectPose")
    async def update_object_pose(self, context: Context, args: UpdateObjectPoseArgs) -> None:
        """Change the pose of an object, while online also that of its device."""
        await self._update_pose(context, args, with_project=False)

    @rpc("UpdateSceneObjectPose")
    async def update_scene_object_pose(self, context: Context, args: UpdateObjectPoseArgs) -> None:
        """Change the pose of an object, also while a project is open. Joints at its action points become invalid."""
        await self._update_pose(context, args, with_project=True)

    async def _update_pose(self, context: Context, args: UpdateObjectPoseArgs, *, with_project: bool) -> None:
        document = self._document(with_project=with_project)
        obj = document.scene_object(args.object_id)
        if self._online.online and self._types.derives_from(obj.type, "Robot"):
            raise RequestRefused(
                "{name} is a robot: it cannot be moved in the scene while it is online.", name=obj.name
            )
        if isinstance(obj.pose, Unset):
            raise RequestRefused("{name} has no pose.", name=obj.name)
        self._editing.require_locked(context, args.object_id, tree=bool(document.points_of(args.object_id)))
        await self.move_object(context, obj, args.pose)

    async def move_object(self, context: Context, obj: SceneObject, pose: Pose) -> None:
        """Set the pose of an object, while online also that of its device."""
        # The device comes first, since it may fail: a refused request must not leave an edit without event.
        if not context.dry_run and self._online.online:
            await self._online.object_pose_changed(obj.id, pose)
        document = self._session.document
        moved = document.update(Kind.OBJECT, obj.id, replace(document.scene_object(obj.id), pose=pose))
        changes = [*invalid_joints_below(document, obj.id), moved]
        if await self._editing.commit(context, changes):
            emit_all(context, self._session, changes)

    @rpc("UpdateObjectPoseUsingRobot")
    async def update_object_pose_using_robot(self, context: Context, args: UpdateObjectPoseUsingRobotArgs) -> None:
        """Move an object to the tool tip of a robot."""
        robot = args.robot
        if args.id == robot.robot_id:
            raise RequestRefused("A robot cannot point at itself.")
        document = self._session.require_scene_alone()
        async with self._locks.auto_skip_held(context.user, robot.robot_id, args.id):
            self._online.require_online()
            obj = document.scene_object(args.id)
            if isinstance(obj.pose, Unset):
                raise RequestRefused("{name} has no pose.", name=obj.name)
            offset = pivot_offset(self._types.meta(obj.type).object_model, args.pivot)
            tool = await self._online.end_effector_pose(robot.robot_id, robot.end_effector, optional(robot.arm_id))
            await self.move_object(context, document.scene_object(args.id), tool * offset)

    @rpc("RenameObject")
    async def rename_object(self, context: Context, args: RenameArgs) -> None:
        """Rename an object."""
        document = self._session.require_scene_alone()
        obj = document.scene_object(args.id)
        if args.new_name == obj.name:
            raise RequestRefused("The object already has the name {name}.", name=obj.name)
        self._editing.require_name_free(Kind.OBJECT, args.new_name, "an object")
        check_name(args.new_name, "object")
        self._editing.require_locked(context, args.id)
        await self._update(context, replace(obj, name=args.new_name))
        if not context.dry_run:
            self._editing.unlock(context, args.id)

    @rpc("UpdateObjectModel")
    async def update_object_model(self, context: Context, args: UpdateObjectModelArgs) -> None:
        """Replace the collision model of an object type."""
        self._online.require_offline()
        self._session.require_scene_alone()
        await self._update_model(context, args)

    @rpc("UpdateSceneShape")
    async def update_scene_shape(self, context: Context, args: UpdateObjectModelArgs) -> None:
        """Replace the collision model of an object type, also while a project is open."""
        self._online.require_offline()
        self._session.require_scene_open()
        await self._update_model(context, args)

    async def _update_model(self, context: Context, args: UpdateObjectModelArgs) -> None:
        meta = self._types.meta(args.object_type_id)
        if meta.disabled or not self._types.derives_from(meta.type, "CollisionObject"):
            raise RequestRefused("{type} takes no collision model.", type=meta.shown_name)
        if meta.object_model == args.object_model:
            raise RequestRefused("{type} has this model already.", type=meta.shown_name)
        if _model_of(args.object_model).id != meta.type:
            raise InvalidData("The model of {type} needs the id {type}.", type=meta.type)
        require_mesh(self._assets, _model_of(args.object_model))
        self._editing.require_locked(context, args.object_type_id)
        try:
            stored = await self._storage.object_type(meta.type)
        except NotFound:
            raise RequestRefused(
                "{type} comes with an installed driver: its model cannot be changed.", type=meta.shown_name
            ) from None
        if not context.dry_run:
            updated = await self._types.add(replace(stored, model=args.object_model))
            context.emit("ChangedObjectTypes", [updated], ChangeType.UPDATE)
