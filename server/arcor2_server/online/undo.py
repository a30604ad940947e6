"""Undo, redo and restoring of revisions, in the open document and in the online scene."""

from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass

from arcor2_hw.data.base import Unset
from arcor2_server.collaboration.locks import Locked, Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Edit, EditKind, Kind
from arcor2_server.documents.dependents import Dependents
from arcor2_server.documents.undo import ids_to_lock, moved_ids, require_applicable
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.storage import Storage


def _moves(change: Change) -> bool:
    return bool(change.before.pose != change.after.pose)


@dataclass(frozen=True, slots=True)
class Undo:
    """Applies changes that revert edits, with the locks and checks of the ordinary requests for such changes."""

    _locks: Locks
    _storage: Storage
    _types: ObjectTypes
    _session: Session
    _online: OnlineScene
    _dependents: Dependents

    def find_edit(self, user: str, number: int | Unset, kind: EditKind) -> Edit:
        """Return the edit that a user can undo or redo, by its number, or without a number the latest one.

        Raises:
            RequestRefused: the edit does not exist.
        """
        history = self._session.history
        if isinstance(number, Unset):
            latest = history.undoable(user) if kind is EditKind.UNDO else history.redoable(user)
            if latest is None:
                raise RequestRefused("There is nothing to {value}.", value=kind.value)
            return latest
        edit = history.find(number)
        if edit is None:
            raise RequestRefused("Edit {number} does not exist or is too old.", number=number)
        if edit.user != user:
            raise RequestRefused("Edit {number} was made by {user}.", number=number, user=edit.user)
        if not (history.can_undo(user, number) if kind is EditKind.UNDO else history.can_redo(user, number)):
            raise RequestRefused("You cannot {value} edit {number}.", number=number, value=kind.value)
        return edit

    @asynccontextmanager
    async def locked(self, user: str, changes: Sequence[Change]) -> AsyncIterator[None]:
        """Hold the locks that ordinary requests for such changes need. Raise Locked if that is impossible."""
        async with self._locks.auto_skip_held(user, *ids_to_lock(self._session.document, changes)):
            for item in moved_ids(self._session.document, changes):
                if others := self._locks.holders_of(item) - {user}:
                    raise Locked(
                        "{item} would move too, but is locked by {others}.",
                        item=self._session.name_of(item) or item,
                        others=", ".join(sorted(others)),
                    )
            yield

    async def apply(
        self,
        user: str,
        changes: Sequence[Change],
        after: int,
        request: str,
        kind: EditKind,
        *,
        dry_run: bool,
        step: str = "",
    ) -> int:
        """Apply the changes that revert edits after the edit number `after`; return the new revision.

        Changes of the kind EDIT were prepared in the state after the edit number `after`, and belong to the `step` of
        undo. In a dry run only check them, and return the present revision. Call this inside `locked`.

        Raises:
            RequestRefused: the changes conflict with later edits, or with the state of scene and projects.
        """
        session = self._session
        document = session.document
        self._require_allowed(changes)
        require_applicable(document, changes, self._types, session.history, after, user)
        await self._require_consistent_storage(changes)
        if not dry_run:
            for change in changes:
                if change.kind is Kind.OBJECT and self._online.online and _moves(change):
                    await self._online.object_pose_changed(change.id, change.after.pose)
        if session.document is not document:
            raise RequestRefused("The scene or project was closed in the meantime. Nothing was changed.")
        # Other users may have edited the document while this waited.
        require_applicable(document, changes, self._types, session.history, after, user)
        if dry_run:
            return session.revision
        revision = session.revision + 1
        await session.commit(user, changes, request, kind, 0 if kind is EditKind.EDIT else after, step)
        for change in changes:
            if change.kind is Kind.OBJECT and change.after is None:
                session.removed_types.add(change.before.type)
            if change.kind is Kind.POINT and document.find(Kind.POINT, change.id) is not None:
                self._locks.move_root([change.id, *document.tree_of(change.id)], document.root_of(change.id))
        return revision

    def _require_allowed(self, changes: Sequence[Change]) -> None:
        """Refuse a new name of the scene while a project is open, and changes that are impossible online."""
        cell = self._online
        if any(change.kind is Kind.SCENE for change in changes):
            self._session.require_scene_alone()
        for change in changes:
            if change.kind is not Kind.OBJECT:
                continue
            if change.before is None or change.after is None or change.before.parameters != change.after.parameters:
                cell.require_offline()
            elif cell.online and self._types.derives_from(change.after.type, "Robot") and _moves(change):
                raise RequestRefused(
                    "{name} is a robot: it cannot be moved in the scene while it is online.", name=change.after.name
                )

    async def _require_consistent_storage(self, changes: Sequence[Change]) -> None:
        """Refuse names that another scene or project has, and the removal of objects that projects use."""
        for change in changes:
            if change.kind in (Kind.SCENE, Kind.PROJECT) and change.before.name != change.after.name:
                name = change.after.name
                found = {await self._storage.scene_named(name), await self._storage.project_named(name)}
                opened = {
                    item.id
                    for kind in (Kind.SCENE, Kind.PROJECT)
                    for item in self._session.document.of_kind(kind)
                    if item.value.name == name
                }
                if (found | opened) - {None, change.id}:
                    raise RequestRefused("A scene or project called {name} exists now.", name=name)
            if (
                change.kind is Kind.OBJECT
                and change.after is None
                and await self._dependents.uses_object(change.id, changes)
            ):
                raise RequestRefused("{name} is now used in projects.", name=change.before.name)
