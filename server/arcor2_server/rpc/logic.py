"""Requests that change the logic of a project (protocol, 7.4 and 10.4)."""

from collections.abc import Iterable
from dataclasses import dataclass

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Unset, new_id
from arcor2_hw.data.events import LockData
from arcor2_hw.data.project import LogicItem, LogicWhen
from arcor2_hw.data.rpc import AddLogicItemArgs, RemoveLogicItemArgs, UpdateLogicItemArgs
from arcor2_server.collaboration.locks import Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks.actions import action_meta
from arcor2_server.documents.document import Document
from arcor2_server.documents.item_indexes import action_of
from arcor2_server.documents.logic import check_logic_item, scope_of
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc


def _compares(when: LogicWhen | Unset) -> bool:
    return not isinstance(when, Unset) and bool(when.comparisons)


@dataclass(frozen=True, slots=True)
class LogicRequests:
    """Requests that change the logic of a project, the order of its actions (protocol, 7.4 and 10.4)."""

    _locks: Locks
    _types: ObjectTypes
    _session: Session
    _editing: Editing

    def _require_logic(self) -> Document:
        """Return the open document. Raise RequestRefused unless it is a project with logic."""
        session = self._session
        document = session.require_project_open()
        if not session.bare_project().has_logic:
            raise RequestRefused("The project {name} has a script instead of logic.", name=session.bare_project().name)
        return document

    def _check(self, document: Document, item: LogicItem) -> None:
        check_logic_item(document, lambda action: action_meta(action, document, self._types), item)

    def _unlock(self, context: Context, places: Iterable[str]) -> None:
        """Release the locks of the caller. Existing clients expect the event even if there are no such locks."""
        freed = self._locks.release_announced(context.user, places)
        context.emit("ObjectsUnlocked", LockData(freed, context.user))

    @rpc("AddLogicItem")
    async def add_logic_item(self, context: Context, args: AddLogicItemArgs) -> None:
        """Connect an action, or START, with its next action, or END."""
        document = self._require_logic()
        places = tuple(dict.fromkeys((action_of(args.start), action_of(args.end))))
        async with self._locks.auto_skip_held(context.user, *places):
            item = LogicItem(args.start, args.end, args.condition, new_id("lit"), args.error_kinds or UNSET)
            item = replace(item, when=args.when if _compares(args.when) else UNSET)
            self._check(document, item)
            change = document.add(Kind.LOGIC, item.id, item, scope_of(document, item))
            if not await self._editing.commit_one(context, change):
                return
        self._unlock(context, places)

    @rpc("UpdateLogicItem")
    async def update_logic_item(self, context: Context, args: UpdateLogicItemArgs) -> None:
        """Change a connection of the logic."""
        document = self._require_logic()
        item = document.logic_item(args.logic_item_id)
        kinds = item.error_kinds if isinstance(args.error_kinds, Unset) else args.error_kinds or UNSET
        # Clients of the original do not know comparisons; a condition that they set replaces these.
        when = args.when if args.condition or not isinstance(args.when, Unset) else item.when
        changed = replace(
            item,
            start=args.start,
            end=args.end,
            condition=args.condition,
            error_kinds=kinds,
            when=when if _compares(when) else UNSET,
        )
        self._check(document, changed)
        if scope_of(document, changed) != scope_of(document, item):
            raise RequestRefused("A step cannot be moved into a function or out of it.")
        await self._editing.commit_one(context, document.update(Kind.LOGIC, item.id, changed))

    @rpc("RemoveLogicItem")
    async def remove_logic_item(self, context: Context, args: RemoveLogicItemArgs) -> None:
        """Remove a connection of the logic."""
        document = self._require_logic()
        item = document.logic_item(args.logic_item_id)
        places = tuple(dict.fromkeys((action_of(item.start), action_of(item.end))))
        async with self._locks.auto_skip_held(context.user, *places):
            if not await self._editing.commit_one(context, document.remove(Kind.LOGIC, item.id)):
                return
        self._unlock(context, places)
