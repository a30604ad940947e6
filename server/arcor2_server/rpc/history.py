"""Requests that undo, redo and list edits (docs/protocol.md)."""

from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
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
from arcor2_server.collaboration.locks import Locked, Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import OF_SCENE, Change, Edit, EditKind, Kind, net
from arcor2_server.documents.dependents import Dependents
from arcor2_server.documents.document import Document
from arcor2_server.documents.undo import (
    ids_to_lock,
    inverse_changes,
    moved_ids,
    require_applicable,
    role_for,
)
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.change_events import ChangeEvents
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.storage import Storage

LONGEST_LIST: Final = 20
"""Things that History names of one edit."""
ATTEMPTS: Final = 5
"""Number of attempts of RestoreRevision while other users edit."""


def _moves(change: Change) -> bool:
    return bool(change.before.pose != change.after.pose)


def _described(edit: Edit, *, in_force: bool) -> HistoryEdit:
    changes = net(edit.changes)
    items = [_item(change) for change in changes[:LONGEST_LIST]]
    return HistoryEdit(
        number=edit.number,
        time=edit.time,
        user=edit.user,
        request=edit.request,
        how=edit.kind.value,
        in_force=in_force,
        items=items,
        touched=len(changes),
        of=UNSET if edit.kind is EditKind.EDIT else edit.target,
    )


def _item(change: Change) -> HistoryItem:
    value = change.before if change.after is None else change.after
    how = "remove" if change.after is None else "add" if change.before is None else "update"
    return HistoryItem(change.kind.value, change.id, getattr(value, "name", ""), how)


class HistoryRequests:
    """Requests that take edits back and tell what was edited (docs/protocol.md)."""

    def __init__(
        self,
        locks: Locks,
        storage: Storage,
        types: ObjectTypes,
        session: Session,
        online: OnlineScene,
        dependents: Dependents,
        editing: Editing,
        change_events: ChangeEvents,
    ) -> None:
        self._locks = locks
        self._storage = storage
        self._types = types
        self._session = session
        self._online = online
        self._dependents = dependents
        self._editing = editing
        self._change_events = change_events

    @rpc("Undo")
    async def undo(self, context: Context, args: UndoArgs) -> UndoData:
        """Take back an edit of the caller."""
        return await self._take_back(context, args.number, EditKind.UNDO)

    @rpc("Redo")
    async def redo(self, context: Context, args: RedoArgs) -> UndoData:
        """Take back an undo of the caller."""
        return await self._take_back(context, args.number, EditKind.REDO)

    @rpc("RestoreRevision")
    async def restore_revision(self, context: Context, args: RestoreRevisionArgs) -> RestoreRevisionData:
        """Bring the document back to how it was after an edit, as one edit of the caller."""
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
                raise RequestRefused("The document is as it was in revision {revision}.", revision=args.revision)
            async with self._locked(context, changes):
                if session.document is document and session.revision == at:
                    revision = await self._make(context, changes, args.revision, context.request, EditKind.RESTORE)
                    return RestoreRevisionData(revision)
        raise RequestRefused("Others are editing: try again.")

    async def _take_back(self, context: Context, number: int | Unset, how: EditKind) -> UndoData:
        self._session.require_scene_open()
        while True:
            edit = self._chosen(context, number, how)
            changes = inverse_changes([edit])
            async with self._locked(context, changes):
                # Another request of the same user may have been faster.
                if self._chosen(context, number, how) is edit:
                    revision = await self._make(context, changes, edit.number, edit.request, how)
                    return UndoData(edit.number, edit.request, revision)

    def _chosen(self, context: Context, number: int | Unset, how: EditKind) -> Edit:
        history, user = self._session.history, context.user
        if isinstance(number, Unset):
            latest = history.undoable(user) if how is EditKind.UNDO else history.redoable(user)
            if latest is None:
                raise RequestRefused("There is nothing that you could {value}.", value=how.value)
            return latest
        edit = history.find(number)
        if edit is None:
            raise RequestRefused("There is no edit {number}, or it is not kept any more.", number=number)
        if edit.user != user:
            raise RequestRefused("Edit {number} was made by {user}.", number=number, user=edit.user)
        if not (history.can_undo(user, number) if how is EditKind.UNDO else history.can_redo(user, number)):
            raise RequestRefused("Edit {number} is nothing that you could {value}.", number=number, value=how.value)
        return edit

    # ---------------------------------------------------------------------------------------------- checks
    @asynccontextmanager
    async def _locked(self, context: Context, changes: Sequence[Change]) -> AsyncIterator[None]:
        """Hold the locks that ordinary requests for such changes take."""
        user = context.user
        async with self._locks.auto_skip_held(user, *ids_to_lock(self._session.document, changes)):
            for item in moved_ids(self._session.document, changes):
                if others := self._locks.holders_of(item) - {user}:
                    raise Locked(
                        "{item!r}, which would move along, is locked by {others}.",
                        item=item,
                        others=", ".join(sorted(others)),
                    )
            yield

    async def _make(self, context: Context, changes: Sequence[Change], after: int, request: str, how: EditKind) -> int:
        """Make the changes that take back edits since number `after`, unless this is a dry run; gives the revision."""
        session, user = self._session, context.user
        document = session.document
        needed = role_for(changes)
        if context.client.role < needed:
            raise RequestRefused("What would change needs the role {name} or a higher one.", name=needed.name.lower())
        self._require_state(context, changes)
        require_applicable(document, changes, self._types, session.history, after, user)
        await self._require_outside(context, changes)
        if not context.dry_run:
            await self._move_live(context, changes)
        if session.document is not document:
            raise RequestRefused("The scene or project was closed meanwhile: nothing was changed.")
        # Others may have been busy meanwhile.
        require_applicable(document, changes, self._types, session.history, after, user)
        if context.dry_run:
            return session.revision
        revision = session.revision + 1
        await session.commit(user, changes, request, how, after)
        self._change_events.emit_all(context, changes)
        self._settle(context, document, changes)
        return revision

    def _require_state(self, context: Context, changes: Sequence[Change]) -> None:
        session, cell = self._session, self._online
        if any(change.kind in OF_SCENE for change in changes):
            session.require_scene_alone()
        for change in changes:
            if change.kind is not Kind.OBJECT:
                continue
            if change.before is None or change.after is None or change.before.parameters != change.after.parameters:
                cell.require_offline()
            elif cell.online and self._types.derives_from(change.after.type, "Robot") and _moves(change):
                raise RequestRefused(
                    "{name} is a robot: it cannot be moved in the scene while it is online.", name=change.after.name
                )

    async def _require_outside(self, context: Context, changes: Sequence[Change]) -> None:
        """Refuse for what is saved elsewhere: names of scenes and projects, projects that use an object."""
        for change in changes:
            if change.kind in (Kind.SCENE, Kind.PROJECT) and change.before.name != change.after.name:
                name = change.after.name
                found = {await self._storage.scene_named(name), await self._storage.project_named(name)}
                opened = {
                    i.id
                    for kind in (Kind.SCENE, Kind.PROJECT)
                    for i in self._session.document.of_kind(kind)
                    if i.value.name == name
                }
                if (found | opened) - {None, change.id}:
                    raise RequestRefused("There is a scene or project called {name} by now.", name=name)
            if change.kind is Kind.OBJECT and change.after is None and await self._dependents.uses_object(change.id):
                raise RequestRefused("{name} is used in projects by now.", name=change.before.name)

    async def _move_live(self, context: Context, changes: Sequence[Change]) -> None:
        cell = self._online
        for change in changes:
            if change.kind is Kind.OBJECT and cell.online and _moves(change):
                await cell.object_pose_changed(change.id, change.after.pose)

    def _settle(self, context: Context, document: Document, changes: Sequence[Change]) -> None:
        """Apply the consequences of changes for locks and object types."""
        for change in changes:
            if change.kind is Kind.OBJECT and change.after is None:
                self._session.removed_types.add(change.before.type)
            if change.kind is Kind.POINT and document.find(Kind.POINT, change.id) is not None:
                self._locks.move_root([change.id, *document.tree_of(change.id)], document.root_of(change.id))
        self._editing.drop_locks(context, *(change.id for change in changes if change.after is None))

    # ---------------------------------------------------------------------------------------------- what was edited
    @rpc("History")
    async def history(self, context: Context, args: HistoryArgs) -> HistoryData:
        """Return what was edited, newest first, and what the caller can take back."""
        session, user = self._session, context.client.user or ""
        session.require_scene_open()
        kept = session.history
        edits: list[HistoryEdit] = []
        for edit in reversed(kept):
            if len(edits) >= args.limit:
                break
            if isinstance(args.before, Unset) or edit.number < args.before:
                edits.append(_described(edit, in_force=kept.in_force(edit)))
        undoable, redoable = kept.undoable(user), kept.redoable(user)
        return HistoryData(
            session.revision,
            session.oldest_revision,
            edits,
            UNSET if undoable is None else undoable.number,
            UNSET if redoable is None else redoable.number,
        )
