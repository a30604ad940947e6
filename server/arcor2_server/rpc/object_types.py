"""Requests about object types."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec
from msgspec import UNSET, Raw

from arcor2_hw.data.base import Unset, is_valid_name
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.object_type import Disableable, Mesh, Models, ObjectTypeMeta, ObjectTypeSource
from arcor2_hw.data.parameter import IdValue
from arcor2_hw.data.rpc import ActionParamValuesArgs, DeleteObjectTypesData, IdArgs, TypeArgs
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_server.collaboration.locks import ADDING_OBJECT, Locks
from arcor2_server.documents import Session
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.derived_types import derived_source
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.answer_cache import AnswerCache, cache_name
from arcor2_server.rpc.registry import Context, cached, rpc
from arcor2_server.storage import AssetStore, Storage


def require_mesh(assets: AssetStore, model: Models) -> None:
    """Raise RequestRefused if the mesh of a collision model is not an asset."""
    if isinstance(model, Mesh) and not assets.exists(model.asset_id):
        raise RequestRefused(
            "Asset {asset_id!r}, the mesh of {id}, does not exist.", asset_id=model.asset_id, id=model.id
        )


def _parent_value(parent: IdValue, kind: str) -> Raw:
    """Return the value of a parent parameter as JSON. Existing clients send strings without quotes."""
    try:
        value = msgspec.json.decode(parent.value)
    except msgspec.DecodeError as error:
        if kind not in ("string", "string_enum"):
            raise InvalidData(
                "The parameter {id}: {value} is not of the type {type}.",
                id=parent.id,
                value=parent.value[:80],
                type=kind,
            ) from error
        value = parent.value
    if kind in ("string", "string_enum") and not isinstance(value, str):
        value = parent.value
    return Raw(msgspec.json.encode(value))


@dataclass(frozen=True, slots=True)
class ObjectTypeRequests:
    """Requests about object types."""

    _locks: Locks
    _storage: Storage
    _assets: AssetStore
    _types: ObjectTypes
    _session: Session
    _online: OnlineScene
    _answer_cache: AnswerCache

    @rpc("GetObjectTypes")
    async def get_object_types(self, context: Context, args: None) -> Raw:
        """Return all object types, including built-in and disabled ones."""
        return self._listed("GetObjectTypes", context, self._types.metas)

    def _listed(self, name: str, context: Context, items: Callable[[], Sequence[Disableable]]) -> Raw:
        """Return the cached answer with these items, else encode it."""
        name, revisions = cache_name(name, context.codes), (self._types.revision,)
        return self._answer_cache.get_or_encode(name, revisions, lambda: context.translatable(items()))

    @cached("GetObjectTypes")
    def cached_object_types(self, codes: bool) -> Raw | None:
        """Return the cached object types, None if they are outdated."""
        return self._answer_cache.get(cache_name("GetObjectTypes", codes), (self._types.revision,))

    @rpc("GetActions")
    async def get_actions(self, context: Context, args: TypeArgs) -> Raw:
        """Return the actions of an object type."""
        actions = self._types.actions(args.type)
        return self._listed(f"GetActions {args.type}", context, lambda: actions)

    @rpc("GetRobotMeta")
    async def get_robot_meta(self, context: Context, args: None) -> Raw:
        """Return the features of all robot types."""
        return self._answer_cache.get_or_encode("GetRobotMeta", (self._types.revision,), self._types.robot_metas)

    @rpc("ObjectTypeUsage")
    async def object_type_usage(self, context: Context, args: IdArgs) -> set[str]:
        """Return the scenes in which an object type is used."""
        return await self._scenes_with(args.id)

    async def _scenes_with(self, name: str) -> set[str]:
        storage = self._storage
        scenes = [await storage.scene(listed.id) for listed in await storage.scenes()]
        return {scene.id for scene in scenes if any(placed.type == name for placed in scene.objects)}

    # ------------------------------------------------------------------------------------------------ adding
    @rpc("NewObjectType")
    async def new_object_type(self, context: Context, args: ObjectTypeMeta) -> None:
        """Create an object type that derives from a base without changes, but may have its own collision model."""
        async with self._locks.auto(context.user, ADDING_OBJECT):
            self._check_new(args)
            if context.dry_run:
                return
            source = ObjectTypeSource(
                args.type,
                derived_source(args.type, self._types.type_code(args.base), args.description),
                description=args.description or UNSET,
                model=args.object_model,
            )
            context.emit("ChangedObjectTypes", [await self._types.add(source)], ChangeType.ADD)

    def _check_new(self, new: ObjectTypeMeta) -> None:
        """Raise RequestRefused if the name, the base or the collision model of a new object type is not allowed."""
        types = self._types
        if types.known(new.type):
            raise RequestRefused("An object type called {type} already exists. Choose another name.", type=new.type)
        if not is_valid_name(new.type):
            raise RequestRefused(
                "{type!r} is not a valid name. Use letters, digits and _, and no keyword or built-in name of Python.",
                type=new.type,
            )
        base = types.meta(new.base)
        if base.disabled:
            raise RequestRefused(
                "The object type {type} cannot be used ({problem}).", type=base.shown_name, problem=base.why_disabled
            )
        if types.derives_from(base.type, "Robot"):
            raise RequestRefused(
                "The object type of a robot cannot be derived without changes. Upload its source instead."
            )
        if isinstance(new.object_model, Unset):
            if types.derives_from(base.type, "CollisionObject"):
                raise RequestRefused(
                    "An object type derived from {type} needs a collision model.", type=base.shown_name
                )
            return
        if not types.derives_from(base.type, "CollisionObject"):
            raise RequestRefused("An object type derived from {type} takes no collision model.", type=base.shown_name)
        try:
            model = new.object_model.model()
        except ValueError as error:
            raise RequestRefused("The collision model is missing or invalid: {reason}.", reason=error) from None
        if model.id != new.type:
            raise RequestRefused("The model of {type} needs the id {type}, not {id}.", type=new.type, id=model.id)
        require_mesh(self._assets, model)

    # ------------------------------------------------------------------------------------------------ deleting
    @rpc("DeleteObjectTypes")
    async def delete_object_types(self, context: Context, args: set[str] | None) -> list[DeleteObjectTypesData] | None:
        """Delete the named uploaded types, or all. The answer lists the types that were not deleted, with reasons."""
        user, types = context.user, self._types
        names = sorted(args) if args is not None else [name for name in types.names() if types.is_uploaded(name)]
        async with self._locks.auto(user, *(name for name in names if types.known(name))):
            failed = []
            # Derived types are deleted before their bases, so that both can be deleted by one request.
            for name in sorted(names, key=lambda name: -len(types.bases(name)) if types.known(name) else 0):
                try:
                    await self._require_unused(name)
                    if not context.dry_run:
                        context.emit_first("ChangedObjectTypes", [await types.remove(name)], ChangeType.REMOVE)
                        if types.known(name):  # the installed type of this name is available again
                            context.emit_first("ChangedObjectTypes", [types.meta(name)], ChangeType.ADD)
                except Arcor2Error as error:
                    failed.append(DeleteObjectTypesData(name, str(error)))
        if failed:
            raise RequestRefused(
                "These object types were not deleted: {failed}.",
                failed,
                failed=", ".join(types.shown_name(one.id) for one in failed),
            )
        return None

    async def _require_unused(self, name: str) -> None:
        """Raise RequestRefused if an object type is used; NotFound or InvalidData if it cannot be deleted at all."""
        types, session = self._types, self._session
        shown = types.meta(name).shown_name
        types.require_deletable(name)
        derived = [meta.shown_name for meta in types.metas() if meta.type != name and name in types.bases(meta.type)]
        if derived:
            raise RequestRefused(
                "The object type {name} is the base of {derived}.", name=shown, derived=", ".join(derived)
            )
        if (opened := session.scene) is not None and any(placed.type == name for placed in opened.objects):
            raise RequestRefused(
                "The object type {name} is used in the open scene {opened_name}.", name=shown, opened_name=opened.name
            )
        if scenes := await self._scenes_with(name):
            raise RequestRefused(
                "The object type {name} is used in the scenes {scenes}.", name=shown, scenes=", ".join(sorted(scenes))
            )

    # ------------------------------------------------------------------------------------------------ dynamic values
    @rpc("ActionParamValues")
    async def action_param_values(self, context: Context, args: ActionParamValuesArgs) -> list[str]:
        """Return the present values of a parameter with dynamic values, from the connected device."""
        self._session.require_scene_open()
        async with self._locks.read(context.user, args.id):
            self._online.require_online()
            obj = self._session.document.scene_object(args.id)
            dynamic: dict[str, tuple[str, set[str]]] = await self._online.ask(
                dict[str, tuple[str, set[str]]], obj.id, "DYNAMIC_PARAMS"
            )
            if args.param_id not in dynamic:
                raise RequestRefused(
                    "{name} offers no values for a parameter {param_id}.", name=obj.name, param_id=args.param_id
                )
            method, parents = dynamic[args.param_id]
            given = [parent.id for parent in args.parent_params]
            if sorted(given) != sorted(parents):
                raise RequestRefused(
                    "The values of {param_id} depend on {needed}. Give exactly these parameters."
                    if parents
                    else "The values of {param_id} depend on no other parameter.",
                    param_id=args.param_id,
                    needed=", ".join(sorted(parents)),
                )
            kinds = {
                parameter.name: parameter.type
                for action in self._types.actions(obj.type)
                if any(each.name == args.param_id and each.dynamic_value for each in action.parameters)
                for parameter in action.parameters
            }
            arguments = {
                parent.id: _parent_value(parent, kinds.get(parent.id, "string")) for parent in args.parent_params
            }
            values: list[str] = await self._online.ask(list[str], obj.id, method, arguments)
            return list(dict.fromkeys(values))
