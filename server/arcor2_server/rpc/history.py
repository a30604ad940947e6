"""Requests that undo, redo and list edits (docs/protocol.md)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.rpc import (
    HistoryArgs,
    HistoryData,
    HistoryEdit,
    HistoryItem,
    RedoArgs,
    RestoreRevisionArgs,
    RestoreRevisionData,
    UndoArgs,
    UndoData,
)
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Edit, EditKind, net
from arcor2_server.documents.undo import inverse_changes, role_for
from arcor2_server.errors import RequestRefused
from arcor2_server.online.undo import Undo
from arcor2_server.rpc.change_events import emit_all
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc

MAX_LIST: Final = 20
"""Maximum number of items that History lists for one edit."""
ATTEMPTS: Final = 5
"""Number of attempts of RestoreRevision while other users edit."""


def _described(edit: Edit, *, in_force: bool) -> HistoryEdit:
    changes = net(edit.changes)
    items = [_item(change) for change in changes[:MAX_LIST]]
    return HistoryEdit(
        number=edit.number,
        time=edit.time,
        user=edit.user,
        request=edit.request,
        how=edit.kind.value,
        in_force=in_force,
        items=items,
        touched=len(changes),
        of=UNSET if edit.kind is EditKind.EDIT and not edit.target else edit.target,
    )


def _item(change: Change) -> HistoryItem:
    value = change.before if change.after is None else change.after
    how = "remove" if change.after is None else "add" if change.before is None else "update"
    return HistoryItem(change.kind.value, change.id, getattr(value, "name", ""), how)


@dataclass(frozen=True, slots=True)
class HistoryRequests:
    """Requests that undo, redo and list edits (docs/protocol.md)."""

    _session: Session
    _undo: Undo
    _editing: Editing

    @rpc("Undo")
    async def undo(self, context: Context, args: UndoArgs) -> UndoData:
        """Undo an edit of the caller."""
        return await self._revert(context, args.number, EditKind.UNDO)

    @rpc("Redo")
    async def redo(self, context: Context, args: RedoArgs) -> UndoData:
        """Redo an edit that the caller has undone."""
        return await self._revert(context, args.number, EditKind.REDO)

    @rpc("RestoreRevision")
    async def restore_revision(self, context: Context, args: RestoreRevisionArgs) -> RestoreRevisionData:
        """Restore the state of the document after an earlier edit, as one edit of the caller."""
        session = self._session
        for _ in range(ATTEMPTS):
            session.require_scene_open()
            document, at = session.document, session.revision
            if not session.oldest_revision <= args.revision <= at:
                raise RequestRefused(
                    "Only the revisions {oldest_revision} to {at} can be restored.",
                    oldest_revision=session.oldest_revision,
                    at=at,
                )
            changes = inverse_changes(session.history.since(args.revision))
            if not changes:
                raise RequestRefused(
                    "The document already has the state of revision {revision}.", revision=args.revision
                )
            async with self._undo.locked(context.user, changes):
                if session.document is document and session.revision == at:
                    revision = await self._apply(context, changes, args.revision, context.request, EditKind.RESTORE)
                    return RestoreRevisionData(revision)
        raise RequestRefused("Other users are editing the document. Try again.")

    async def _revert(self, context: Context, number: int | Unset, kind: EditKind) -> UndoData:
        self._session.require_scene_open()
        while True:
            edit = self._undo.find_edit(context.user, number, kind)
            step = self._session.history.step(edit)
            changes = inverse_changes(step)
            async with self._undo.locked(context.user, changes):
                # Another request of the same user may have reverted or continued the step meanwhile.
                same = self._undo.find_edit(context.user, number, kind) is edit
                if same and len(self._session.history.step(edit)) == len(step):
                    revision = await self._apply(context, changes, edit.number, edit.request, kind)
                    return UndoData(edit.number, edit.request, revision)

    async def _apply(
        self, context: Context, changes: Sequence[Change], after: int, request: str, kind: EditKind
    ) -> int:
        needed = role_for(changes)
        if context.client.role < needed:
            raise RequestRefused("These changes need the role {name} or a higher one.", name=needed.shown)
        revision = await self._undo.apply(context.user, changes, after, request, kind, dry_run=context.dry_run)
        if not context.dry_run:
            emit_all(context, self._session, changes)
            self._editing.drop_locks(context, *(change.id for change in changes if change.after is None))
        return revision

    @rpc("History")
    async def history(self, context: Context, args: HistoryArgs) -> HistoryData:
        """Return the edits, newest first, and which edits the caller can undo and redo."""
        session, user = self._session, context.client.user or ""
        session.require_scene_open()
        history = session.history
        edits: list[HistoryEdit] = []
        for edit in reversed(history):
            if len(edits) >= args.limit:
                break
            if isinstance(args.before, Unset) or edit.number < args.before:
                edits.append(_described(edit, in_force=history.in_force(edit)))
        undoable, redoable = history.undoable(user), history.redoable(user)
        return HistoryData(
            session.revision,
            session.oldest_revision,
            edits,
            UNSET if undoable is None else undoable.number,
            UNSET if redoable is None else redoable.number,
        )
