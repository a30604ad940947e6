"""Requests that change the logic of a project (protocol, 7.4 and 10.4)."""

from collections.abc import Iterable

from msgspec.structs import replace

from arcor2_hw.data.base import new_id
from arcor2_hw.data.events import ChangeType, LockData
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.data.project import Action, LogicItem
from arcor2_hw.data.rpc import AddLogicItemArgs, RemoveLogicItemArgs, UpdateLogicItemArgs
from arcor2_server.collaboration.locks import Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks import action_meta
from arcor2_server.documents.document import Document, action_of
from arcor2_server.documents.logic import check_logic_item
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.rpc.editing import Editing, emit_changes
from arcor2_server.rpc.registry import Context, rpc


class LogicRequests:
    """Requests that change the logic: which action follows which (protocol, 7.4 and 10.4)."""

    def __init__(self, locks: Locks, types: ObjectTypes, session: Session, editing: Editing) -> None:
        self._locks = locks
        self._types = types
        self._session = session
        self._editing = editing

    def _document(self, context: Context) -> Document:
        session = self._session
        document = session.require_project_open()
        if not session.bare_project().has_logic:
            raise RequestRefused(
                "The project {name} has no logic: it is programmed by a script.", name=session.bare_project().name
            )
        return document

    def _check(self, context: Context, document: Document, item: LogicItem) -> None:
        def meta_of(action: Action) -> ObjectAction:
            return action_meta(action, document, self._types)

        check_logic_item(document, meta_of, item)

    def _unlock_always(self, context: Context, places: Iterable[str]) -> None:
        # Existing clients wait for this event even when nothing was held.
        freed = self._locks.release_announced(context.user, places)
        context.emit("ObjectsUnlocked", LockData(freed, context.user))

    @rpc("AddLogicItem")
    async def add_logic_item(self, context: Context, args: AddLogicItemArgs) -> None:
        """Let an action follow another one, or START; END ends a cycle of the program."""
        document = self._document(context)
        places = tuple(dict.fromkeys((action_of(args.start), action_of(args.end))))
        async with self._locks.auto_skip_held(context.user, *places):
            item = LogicItem(args.start, args.end, args.condition, new_id("lit"))
            self._check(context, document, item)
            changes = [document.add(Kind.LOGIC, item.id, item)]
            if not await self._editing.commit(context, changes):
                return
            emit_changes(context, changes, "LogicItemChanged", ChangeType.ADD)
        self._unlock_always(context, places)

    @rpc("UpdateLogicItem")
    async def update_logic_item(self, context: Context, args: UpdateLogicItemArgs) -> None:
        """Change a step of the logic."""
        document = self._document(context)
        item = document.logic_item(args.logic_item_id)
        changed = replace(item, start=args.start, end=args.end, condition=args.condition)
        self._check(context, document, changed)
        changes = [document.update(Kind.LOGIC, item.id, changed)]
        if await self._editing.commit(context, changes):
            emit_changes(context, changes, "LogicItemChanged", ChangeType.UPDATE)

    @rpc("RemoveLogicItem")
    async def remove_logic_item(self, context: Context, args: RemoveLogicItemArgs) -> None:
        """Remove a step of the logic."""
        document = self._document(context)
        item = document.logic_item(args.logic_item_id)
        places = tuple(dict.fromkeys((action_of(item.start), action_of(item.end))))
        async with self._locks.auto_skip_held(context.user, *places):
            changes = [document.remove(Kind.LOGIC, item.id)]
            if not await self._editing.commit(context, changes):
                return
            emit_changes(context, changes, "LogicItemChanged", ChangeType.REMOVE)
        self._unlock_always(context, places)
