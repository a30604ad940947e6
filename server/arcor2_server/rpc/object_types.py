"""Requests about object types."""

import ast

import msgspec
from msgspec import UNSET, Raw

from arcor2_hw.data.base import Unset, is_valid_name
from arcor2_hw.data.events import ChangeType, Event
from arcor2_hw.data.object_type import Mesh, Models, ObjectTypeMeta, ObjectTypeSource
from arcor2_hw.data.parameter import IdValue
from arcor2_hw.data.rpc import ActionParamValuesArgs, DeleteObjectTypesData, IdArgs, TypeArgs
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_hw.runtime.messages import TypeCode
from arcor2_server.collaboration.locks import ADDING_OBJECT
from arcor2_server.errors import RequestRefused
from arcor2_server.events import encode, make_event
from arcor2_server.object_types.changes import Changes
from arcor2_server.rpc.registry import Context, at_once, rpc
from arcor2_server.services import Services


def change_events(changes: Changes) -> list[Event]:
    """Give the events that tell clients what changed among the object types."""
    kinds = (
        (ChangeType.REMOVE, changes.removed),
        (ChangeType.UPDATE, changes.updated),
        (ChangeType.ADD, changes.added),
    )
    return [make_event("ChangedObjectTypes", metas, change) for change, metas in kinds if metas]


async def notice_new_types(context: Context) -> None:
    """Take in types that were put straight into storage, and tell all clients."""
    for event in change_events(await context.services.types.refresh()):
        context.services.hub.broadcast(event)


@rpc("GetObjectTypes")
async def get_object_types(context: Context, args: None) -> Raw:  # noqa: ARG001
    """Give all object types, built-in and disabled ones too."""
    types, kept = context.services.types, context.services.kept
    revisions = (types.revision,)
    return kept.get("GetObjectTypes", revisions) or kept.keep("GetObjectTypes", revisions, encode(types.metas()))


@at_once("GetObjectTypes")
def _kept_object_types(services: Services) -> Raw | None:
    return services.kept.get("GetObjectTypes", (services.types.revision,))


@rpc("GetActions")
async def get_actions(context: Context, args: TypeArgs) -> Raw:
    """Give the actions of a type."""
    types, kept = context.services.types, context.services.kept
    actions = types.actions(args.type)
    name, revisions = f"GetActions {args.type}", (types.revision,)
    return kept.get(name, revisions) or kept.keep(name, revisions, encode(actions))


@rpc("GetRobotMeta")
async def get_robot_meta(context: Context, args: None) -> Raw:  # noqa: ARG001
    """Give what the robot types can do."""
    types, kept = context.services.types, context.services.kept
    revisions = (types.revision,)
    return kept.get("GetRobotMeta", revisions) or kept.keep("GetRobotMeta", revisions, encode(types.robot_metas()))


@rpc("ObjectTypeUsage")
async def object_type_usage(context: Context, args: IdArgs) -> set[str]:
    """Give the scenes in which an object type is used."""
    return await _scenes_with(context, args.id)


async def _scenes_with(context: Context, name: str) -> set[str]:
    storage = context.services.storage
    scenes = [await storage.scene(listed.id) for listed in await storage.scenes()]
    return {scene.id for scene in scenes if any(placed.type == name for placed in scene.objects)}


# ------------------------------------------------------------------------------------------------ new ones
@rpc("NewObjectType")
async def new_object_type(context: Context, args: ObjectTypeMeta) -> None:
    """Make an object type that is its base under another name, with a collision model where the base takes one."""
    async with context.services.locks.auto(context.user, ADDING_OBJECT):
        _check_new(context, args)
        if context.dry_run:
            return
        source = ObjectTypeSource(
            args.type,
            derived_source(args.type, context.services.types.type_code(args.base), args.description),
            description=args.description or UNSET,
            model=args.object_model,
        )
        context.emit("ChangedObjectTypes", [await context.services.types.add(source)], ChangeType.ADD)


def _check_new(context: Context, new: ObjectTypeMeta) -> None:
    types = context.services.types
    if types.known(new.type):
        raise RequestRefused(f"There is an object type called {new.type} already: choose another name.")
    if not is_valid_name(new.type):
        raise RequestRefused(f"{new.type!r} is no valid name: letters, digits and _, no keyword, no name of Python's.")
    base = types.meta(new.base)
    if base.disabled:
        raise RequestRefused(f"The object type {base.type} cannot be used{_because(base)}.")
    if types.derives_from(base.type, "Robot"):
        raise RequestRefused("A robot's object type has to be written, not only derived.")
    if isinstance(new.object_model, Unset):
        if types.derives_from(base.type, "CollisionObject"):
            raise RequestRefused(f"An object type derived from {base.type} needs a collision model.")
        return
    if not types.derives_from(base.type, "CollisionObject"):
        raise RequestRefused(f"An object type derived from {base.type} takes no collision model.")
    try:
        model = new.object_model.model()
    except ValueError as error:
        raise RequestRefused(f"A collision model is needed: {error}.") from None
    if model.id != new.type:
        raise RequestRefused(f"The model of {new.type} needs the id {new.type}, not {model.id}.")
    require_mesh(context.services, model)


def require_mesh(services: Services, model: Models) -> None:
    """Refuse a collision model whose mesh is no asset."""
    if isinstance(model, Mesh) and not services.assets.exists(model.asset_id):
        raise RequestRefused(f"There is no asset {model.asset_id!r} that could be the mesh of {model.id}.")


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


# ------------------------------------------------------------------------------------------------ deleted ones
@rpc("DeleteObjectTypes")
async def delete_object_types(context: Context, args: set[str] | None) -> list[DeleteObjectTypesData] | None:
    """Delete the named uploaded types, or all of them; those that are in use stay, and the answer says why."""
    services = context.services
    user = context.user
    wanted = sorted(args) if args is not None else [name for name in services.types.names() if _given(context, name)]
    async with services.locks.auto(user, *(name for name in wanted if services.types.known(name))):
        failed = []
        # What derives from others goes first, so that a whole family can be deleted at once.
        for name in sorted(wanted, key=lambda name: -len(_ancestors(context, name))):
            try:
                await _check_unused(context, name)
                if not context.dry_run:
                    context.emit_first("ChangedObjectTypes", [await services.types.remove(name)], ChangeType.REMOVE)
                    if services.types.known(name):  # the installed type of that name is back
                        context.emit_first("ChangedObjectTypes", [services.types.meta(name)], ChangeType.ADD)
            except Arcor2Error as error:
                failed.append(DeleteObjectTypesData(name, str(error)))
    if failed:
        raise RequestRefused(f"These object types were not deleted: {', '.join(one.id for one in failed)}.", failed)
    return None


def _given(context: Context, name: str) -> bool:
    return context.services.types.is_uploaded(name)


def _ancestors(context: Context, name: str) -> list[str]:
    types = context.services.types
    return types.bases(name) if types.known(name) else []


async def _check_unused(context: Context, name: str) -> None:
    types, session = context.services.types, context.services.session
    types.meta(name)
    types.require_deletable(name)
    if derived := [other for other in types.names() if other != name and name in types.bases(other)]:
        raise RequestRefused(f"The object type {name} is the base of {', '.join(derived)}.")
    if (opened := session.scene) is not None and any(placed.type == name for placed in opened.objects):
        raise RequestRefused(f"The object type {name} is used in the open scene {opened.name}.")
    if scenes := await _scenes_with(context, name):
        raise RequestRefused(f"The object type {name} is used in the scenes {', '.join(sorted(scenes))}.")


# ------------------------------------------------------------------------------------------------ dynamic values
@rpc("ActionParamValues")
async def action_param_values(context: Context, args: ActionParamValuesArgs) -> list[str]:
    """Give the values that a parameter may take now, as the live object knows them."""
    services = context.services
    services.session.require_scene_open()
    async with services.locks.read(context.user, args.id):
        services.cell.require_online()
        obj = services.session.scene_object(args.id)
        dynamic: dict[str, tuple[str, set[str]]] = await services.cell.ask(
            dict[str, tuple[str, set[str]]], obj.id, "DYNAMIC_PARAMS"
        )
        if args.param_id not in dynamic:
            raise RequestRefused(f"{obj.name} offers no values for a parameter {args.param_id}.")
        method, parents = dynamic[args.param_id]
        given = [parent.id for parent in args.parent_params]
        if sorted(given) != sorted(parents):
            needed = ", ".join(sorted(parents)) or "no other one"
            raise RequestRefused(f"The values of {args.param_id} depend on {needed}: give exactly that.")
        kinds = {
            parameter.name: parameter.type
            for action in services.types.actions(obj.type)
            if any(each.name == args.param_id and each.dynamic_value for each in action.parameters)
            for parameter in action.parameters
        }
        arguments = {parent.id: _parent_value(parent, kinds.get(parent.id, "string")) for parent in args.parent_params}
        values: list[str] = await services.cell.ask(list[str], obj.id, method, arguments)
        return list(dict.fromkeys(values))


def _parent_value(parent: IdValue, kind: str) -> Raw:
    """Give the value of a parent parameter as JSON: as it stands, or as text that existing clients send bare."""
    try:
        value = msgspec.json.decode(parent.value)
    except msgspec.DecodeError as error:
        if kind not in ("string", "string_enum"):
            raise InvalidData(f"The parameter {parent.id}: {parent.value[:80]} is no {kind}.") from error
        value = parent.value
    if kind in ("string", "string_enum") and not isinstance(value, str):
        value = parent.value
    return Raw(msgspec.json.encode(value))
