"""Requests that change the logic: which action follows which (protocol, 7.4 and 10.4)."""

from collections.abc import Iterable

from msgspec.structs import replace

from arcor2_hw.data.base import new_id
from arcor2_hw.data.events import ChangeType, LockData
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.data.project import Action, LogicItem
from arcor2_hw.data.rpc import AddLogicItemArgs, RemoveLogicItemArgs, UpdateLogicItemArgs
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks import action_meta
from arcor2_server.documents.document import Document, action_of
from arcor2_server.documents.logic import check_logic_item
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.editing import commit, tell
from arcor2_server.rpc.registry import Context, rpc


def _document(context: Context) -> Document:
    session = context.services.session
    document = session.require_project_open()
    if not session.bare_project().has_logic:
        raise RequestRefused(f"The project {session.bare_project().name} has no logic: it is programmed by a script.")
    return document


def _check(context: Context, document: Document, item: LogicItem) -> None:
    def meta_of(action: Action) -> ObjectAction:
        return action_meta(action, document, context.services.types)

    check_logic_item(document, meta_of, item)


def _unlock_always(context: Context, places: Iterable[str]) -> None:
    # Existing clients wait for this event even when nothing was held.
    freed = context.services.locks.release_announced(context.user, places)
    context.emit("ObjectsUnlocked", LockData(freed, context.user))


@rpc("AddLogicItem")
async def add_logic_item(context: Context, args: AddLogicItemArgs) -> None:
    """Let an action follow another one, or START; END ends a cycle of the program."""
    document = _document(context)
    places = tuple(dict.fromkeys((action_of(args.start), action_of(args.end))))
    async with context.services.locks.auto_skip_held(context.user, *places):
        item = LogicItem(args.start, args.end, args.condition, new_id("lit"))
        _check(context, document, item)
        changes = [document.add(Kind.LOGIC, item.id, item)]
        if not await commit(context, changes):
            return
        tell(context, changes, "LogicItemChanged", ChangeType.ADD)
    _unlock_always(context, places)


@rpc("UpdateLogicItem")
async def update_logic_item(context: Context, args: UpdateLogicItemArgs) -> None:
    """Change a step of the logic."""
    document = _document(context)
    item = document.logic_item(args.logic_item_id)
    changed = replace(item, start=args.start, end=args.end, condition=args.condition)
    _check(context, document, changed)
    changes = [document.update(Kind.LOGIC, item.id, changed)]
    if await commit(context, changes):
        tell(context, changes, "LogicItemChanged", ChangeType.UPDATE)


@rpc("RemoveLogicItem")
async def remove_logic_item(context: Context, args: RemoveLogicItemArgs) -> None:
    """Remove a step of the logic."""
    document = _document(context)
    item = document.logic_item(args.logic_item_id)
    places = tuple(dict.fromkeys((action_of(item.start), action_of(item.end))))
    async with context.services.locks.auto_skip_held(context.user, *places):
        changes = [document.remove(Kind.LOGIC, item.id)]
        if not await commit(context, changes):
            return
        tell(context, changes, "LogicItemChanged", ChangeType.REMOVE)
    _unlock_always(context, places)
