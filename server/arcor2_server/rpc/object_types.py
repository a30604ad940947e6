"""Requests about object types."""

import ast

import msgspec
from msgspec import UNSET, Raw

from arcor2_hw.data.base import Unset, is_valid_name
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.object_type import Mesh, Models, ObjectTypeMeta, ObjectTypeSource
from arcor2_hw.data.parameter import IdValue
from arcor2_hw.data.rpc import ActionParamValuesArgs, DeleteObjectTypesData, IdArgs, TypeArgs
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_hw.runtime.messages import TypeCode
from arcor2_server.collaboration.locks import ADDING_OBJECT, Locks
from arcor2_server.documents import Session
from arcor2_server.errors import RequestRefused
from arcor2_server.events import encode
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.answer_cache import AnswerCache
from arcor2_server.rpc.registry import Context, cached, rpc
from arcor2_server.storage import AssetStore, Storage


def require_mesh(assets: AssetStore, model: Models) -> None:
    """Refuse a collision model whose mesh is not an asset."""
    if isinstance(model, Mesh) and not assets.exists(model.asset_id):
        raise RequestRefused(
            "There is no asset {asset_id!r} that could be the mesh of {id}.", asset_id=model.asset_id, id=model.id
        )


def _because(meta: ObjectTypeMeta) -> str:
    return "" if isinstance(meta.problem, Unset) else f" ({meta.problem})"


def derived_source(name: str, base: TypeCode, description: str = "") -> str:
    """Give the module of a type that only derives from another one."""
    module, _, imported = base.entry_point.partition(":")
    come_from = ast.ImportFrom(module or base.module, [ast.alias(imported or base.name)], 0 if module else 1)
    body: list[ast.stmt] = [ast.Expr(ast.Constant(description))] if description else []
    body.append(ast.Assign([ast.Name("_ABSTRACT", ast.Store())], ast.Constant(False)))
    derived = ast.ClassDef(name, [ast.Name(imported or base.name, ast.Load())], [], body, [])
    return ast.unparse(ast.fix_missing_locations(ast.Module([come_from, derived], []))) + "\n"


def _parent_value(parent: IdValue, kind: str) -> Raw:
    """Return the value of a parent parameter as JSON. Existing clients send text without quotes."""
    try:
        value = msgspec.json.decode(parent.value)
    except msgspec.DecodeError as error:
        if kind not in ("string", "string_enum"):
            raise InvalidData(
                "The parameter {id}: {value} is no {type}.", id=parent.id, value=parent.value[:80], type=kind
            ) from error
        value = parent.value
    if kind in ("string", "string_enum") and not isinstance(value, str):
        value = parent.value
    return Raw(msgspec.json.encode(value))


class ObjectTypeRequests:
    """Requests about object types."""

    def __init__(
        self,
        locks: Locks,
        storage: Storage,
        assets: AssetStore,
        types: ObjectTypes,
        session: Session,
        online: OnlineScene,
        answer_cache: AnswerCache,
    ) -> None:
        self._locks = locks
        self._storage = storage
        self._assets = assets
        self._types = types
        self._session = session
        self._online = online
        self._answer_cache = answer_cache

    @rpc("GetObjectTypes")
    async def get_object_types(self, context: Context, args: None) -> Raw:
        """Return all object types, built-in and disabled ones too."""
        types, cached_answers = self._types, self._answer_cache
        revisions = (types.revision,)
        return cached_answers.get("GetObjectTypes", revisions) or cached_answers.store(
            "GetObjectTypes", revisions, encode(types.metas())
        )

    @cached("GetObjectTypes")
    def _cached_object_types(self) -> Raw | None:
        return self._answer_cache.get("GetObjectTypes", (self._types.revision,))

    @rpc("GetActions")
    async def get_actions(self, context: Context, args: TypeArgs) -> Raw:
        """Return the actions of a type."""
        types, cached_answers = self._types, self._answer_cache
        actions = types.actions(args.type)
        name, revisions = f"GetActions {args.type}", (types.revision,)
        return cached_answers.get(name, revisions) or cached_answers.store(name, revisions, encode(actions))

    @rpc("GetRobotMeta")
    async def get_robot_meta(self, context: Context, args: None) -> Raw:
        """Return what the robot types can do."""
        types, cached_answers = self._types, self._answer_cache
        revisions = (types.revision,)
        return cached_answers.get("GetRobotMeta", revisions) or cached_answers.store(
            "GetRobotMeta", revisions, encode(types.robot_metas())
        )

    @rpc("ObjectTypeUsage")
    async def object_type_usage(self, context: Context, args: IdArgs) -> set[str]:
        """Return the scenes in which an object type is used."""
        return await self._scenes_with(context, args.id)

    async def _scenes_with(self, context: Context, name: str) -> set[str]:
        storage = self._storage
        scenes = [await storage.scene(listed.id) for listed in await storage.scenes()]
        return {scene.id for scene in scenes if any(placed.type == name for placed in scene.objects)}

    # ------------------------------------------------------------------------------------------------ new ones
    @rpc("NewObjectType")
    async def new_object_type(self, context: Context, args: ObjectTypeMeta) -> None:
        """Make an object type that is its base under another name, with a collision model where the base takes one."""
        async with self._locks.auto(context.user, ADDING_OBJECT):
            self._check_new(context, args)
            if context.dry_run:
                return
            source = ObjectTypeSource(
                args.type,
                derived_source(args.type, self._types.type_code(args.base), args.description),
                description=args.description or UNSET,
                model=args.object_model,
            )
            context.emit("ChangedObjectTypes", [await self._types.add(source)], ChangeType.ADD)

    def _check_new(self, context: Context, new: ObjectTypeMeta) -> None:
        types = self._types
        if types.known(new.type):
            raise RequestRefused("There is an object type called {type} already: choose another name.", type=new.type)
        if not is_valid_name(new.type):
            raise RequestRefused(
                "{type!r} is no valid name: letters, digits and _, no keyword, no name of Python's.", type=new.type
            )
        base = types.meta(new.base)
        if base.disabled:
            raise RequestRefused("The object type {type} cannot be used{base}.", type=base.type, base=_because(base))
        if types.derives_from(base.type, "Robot"):
            raise RequestRefused("A robot's object type has to be written, not only derived.")
        if isinstance(new.object_model, Unset):
            if types.derives_from(base.type, "CollisionObject"):
                raise RequestRefused("An object type derived from {type} needs a collision model.", type=base.type)
            return
        if not types.derives_from(base.type, "CollisionObject"):
            raise RequestRefused("An object type derived from {type} takes no collision model.", type=base.type)
        try:
            model = new.object_model.model()
        except ValueError as error:
            raise RequestRefused("A collision model is needed: {reason}.", reason=error) from None
        if model.id != new.type:
            raise RequestRefused("The model of {type} needs the id {type}, not {id}.", type=new.type, id=model.id)
        require_mesh(self._assets, model)

    # ------------------------------------------------------------------------------------------------ deleted ones
    @rpc("DeleteObjectTypes")
    async def delete_object_types(self, context: Context, args: set[str] | None) -> list[DeleteObjectTypesData] | None:
        """Delete the named uploaded types, or all. Types in use stay, and the answer says why."""
        user = context.user
        wanted = (
            sorted(args) if args is not None else [name for name in self._types.names() if self._given(context, name)]
        )
        async with self._locks.auto(user, *(name for name in wanted if self._types.known(name))):
            failed = []
            # What derives from others goes first, so that a whole family can be deleted at once.
            for name in sorted(wanted, key=lambda name: -len(self._ancestors(context, name))):
                try:
                    await self._check_unused(context, name)
                    if not context.dry_run:
                        context.emit_first("ChangedObjectTypes", [await self._types.remove(name)], ChangeType.REMOVE)
                        if self._types.known(name):  # the installed type of that name is back
                            context.emit_first("ChangedObjectTypes", [self._types.meta(name)], ChangeType.ADD)
                except Arcor2Error as error:
                    failed.append(DeleteObjectTypesData(name, str(error)))
        if failed:
            raise RequestRefused(
                "These object types were not deleted: {failed}.", failed, failed=", ".join(one.id for one in failed)
            )
        return None

    def _given(self, context: Context, name: str) -> bool:
        return self._types.is_uploaded(name)

    def _ancestors(self, context: Context, name: str) -> list[str]:
        types = self._types
        return types.bases(name) if types.known(name) else []

    async def _check_unused(self, context: Context, name: str) -> None:
        types, session = self._types, self._session
        types.meta(name)
        types.require_deletable(name)
        if derived := [other for other in types.names() if other != name and name in types.bases(other)]:
            raise RequestRefused(
                "The object type {name} is the base of {derived}.", name=name, derived=", ".join(derived)
            )
        if (opened := session.scene) is not None and any(placed.type == name for placed in opened.objects):
            raise RequestRefused(
                "The object type {name} is used in the open scene {opened_name}.", name=name, opened_name=opened.name
            )
        if scenes := await self._scenes_with(context, name):
            raise RequestRefused(
                "The object type {name} is used in the scenes {scenes}.", name=name, scenes=", ".join(sorted(scenes))
            )

    # ------------------------------------------------------------------------------------------------ dynamic values
    @rpc("ActionParamValues")
    async def action_param_values(self, context: Context, args: ActionParamValuesArgs) -> list[str]:
        """Return the values that a parameter may take now, as the live object knows them."""
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
                needed = ", ".join(sorted(parents)) or "no other one"
                raise RequestRefused(
                    "The values of {param_id} depend on {needed}: give exactly that.",
                    param_id=args.param_id,
                    needed=needed,
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
