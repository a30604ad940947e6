"""Requests about object types."""

from msgspec import Raw

from arcor2_hw.data.events import ChangeType, Event
from arcor2_hw.data.rpc import TypeArgs
from arcor2_server.hub import encode
from arcor2_server.object_types import Changes
from arcor2_server.rpc.registry import Context, make_event, rpc


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
