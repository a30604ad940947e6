"""The open scene or project and its history. Every edit is applied in memory and written to the journal."""

import asyncio
import functools
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from typing import NamedTuple

import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import now
from arcor2_hw.data.project import BareProject, Project
from arcor2_hw.data.scene import BareScene, Scene
from arcor2_hw.exceptions import NotFound, StorageError
from arcor2_hw.messages import Message
from arcor2_server.audit.changes import record
from arcor2_server.documents.changes import OF_SCENE, Change, Edit, EditKind, Kind
from arcor2_server.documents.checks.scene import scene_problems
from arcor2_server.documents.closed_history import ClosedHistories
from arcor2_server.documents.document import Document
from arcor2_server.documents.history import History
from arcor2_server.documents.journal import Journal
from arcor2_server.documents.journal_records import ALL, Base, RecoveredDocument, Times
from arcor2_server.documents.journal_secrets import hide_in_journal
from arcor2_server.documents.open_document import OpenDocument
from arcor2_server.documents.renamed_actions import with_present_names
from arcor2_server.documents.unsaved import Unsaved
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from arcor2_server.storage.damage_notices import DataDamage
from arcor2_server.storage.setting_secrets import SettingSecrets

log = structlog.get_logger(__name__)


class _Pending(NamedTuple):
    """An applied edit that is not on disk yet, with the times that were valid before it."""

    edit: Edit
    scene: Times
    project: Times


class Session(OpenDocument):
    """The open document. Between two awaits of a handler no other handler changes it."""

    def __init__(
        self,
        settings: ServerSettings,
        storage: Storage,
        types: ObjectTypes,
        damage: DataDamage,
        secrets: SettingSecrets,
    ) -> None:
        super().__init__()
        self._storage = storage
        self._types = types
        self._damage = damage
        self.removed_types: set[str] = set()
        """Object types of removed objects. Types generated for one object are deleted when the scene is saved."""
        self.history = History(settings.history_limit)
        self.on_change: list[Callable[[Edit | None], None]] = []
        """Called with each edit when it is on disk, and with None when another document is opened."""
        self._limit = settings.history_limit
        convert = functools.partial(hide_in_journal, secrets)
        self._journal = Journal(settings.journal_database, self._revert_pending, convert)
        self._closed = ClosedHistories(settings.history_dir, damage)
        self._number = 0
        self._based_on = 0
        self._pending: deque[_Pending] = deque()

    # ------------------------------------------------------------------------------------------ start and stop
    async def open(self) -> None:
        """Reopen the document in the journal, and report data lost by a damaged journal.

        Raises:
            StorageError: The journal cannot be read or written.
        """
        recovered = await self._journal.open()
        if recovered is not None:
            if recovered.number and not recovered.edits and self._journal.loss is None:
                recovered = await self._with_history(recovered)
            self._restore(recovered)
            await self._find_unsaved()
        if (loss := self._journal.loss) is not None:
            notice = [loss.message]
            if loss.incomplete and await self._superseded():
                await self.discard()
                newer = "The saved version is newer than the rest of the journal: open it again."
                notice.append(Message.of(newer))
            self._damage.report(Message.joined(notice))
        if scene := self._name(Kind.SCENE):
            project = self._name(Kind.PROJECT)
            log.info("reopened", scene=scene, project=project, edits=len(self.history), unsaved=self.has_changes)

    async def close(self) -> None:
        """Write the waiting edits. The document stays in the journal for the next start."""
        await self._journal.close()

    async def _with_history(self, recovered: RecoveredDocument) -> RecoveredDocument:
        """Add the history of a document if the server stopped before `show` had written it to the journal."""
        document = Document(recovered.items)
        if (scene := document.scene) is not None:
            _, edits = await self._closed.reopen(scene, document.project)
            if edits and edits[-1].number == recovered.number:
                recovered = replace(recovered, edits=edits)
                self._journal_history(
                    Base(recovered.items, recovered.number, recovered.scene, recovered.project, 0, edits)
                )
        return recovered

    async def _superseded(self) -> bool:
        """Return whether the document recovered from a damaged journal is older than the saved version."""
        newest = max((edit.time for edit in self.history), default="")
        times = self._scene_times if self.project is None else self._project_times
        return bool(times.modified) and newest < times.modified

    def _restore(self, recovered: RecoveredDocument) -> None:
        self.document = Document(recovered.items)
        self._scene_times, self._project_times = recovered.scene, recovered.project
        self._number = self._based_on = recovered.number
        for edit in recovered.edits:
            self.history.append(edit)
            if edit.number > recovered.number:
                self._apply(edit)

    async def _find_unsaved(self) -> None:
        """Find the unsaved changes by comparing with the saved version, since the journal may lack the last save."""
        storage, scene, project = self._storage, self.require_scene(), self.project
        saved, saved_project = Scene(name="", id=scene.id), None
        try:
            saved = await storage.scene(scene.id)
            self._scene_times = replace(Times.of(saved), changed=self._scene_times.changed)
            if project is not None:
                saved_project = with_present_names(saved, await storage.project(project.id), self._types)
                self._project_times = replace(Times.of(saved_project), changed=self._project_times.changed)
        except NotFound:
            pass  # the document was never saved, or it was deleted
        except StorageError as error:
            log.warning("open document cannot be compared with the saved version", reason=str(error))
        self._unsaved = Unsaved.between(Document.of(saved, saved_project), self.document)
        self._scene_times = self._scene_times.after_comparison(differs=self._unsaved.scene)
        self._project_times = self._project_times.after_comparison(differs=self._unsaved.project)
        self._forget_snapshots()

    # ------------------------------------------------------------------------------------------ edits
    @property
    def revision(self) -> int:
        """The number of the newest edit; 0 for the document as it was opened."""
        return self._number

    @property
    def oldest_revision(self) -> int:
        """The oldest revision that can be restored from the stored edits."""
        return self._number - len(self.history)

    async def commit(
        self,
        user: str,
        changes: Sequence[Change],
        request: str = "",
        kind: EditKind = EditKind.EDIT,
        target: int = 0,
        step: str = "",
    ) -> None:
        """Apply changes as one edit; return when they are on disk. Other requests see them at once.

        Args:
            user: Author of the edit.
            changes: The changes.
            request: See `Edit`.
            kind: See `Edit`.
            target: See `Edit`.
            step: Name of the step of undo that this edit starts or continues; empty if it is a step by itself.

        Raises:
            StorageError: The changes cannot be stored, and are reverted.
        """
        if step:
            target = self.history.start_of_step(user, step, changes)
        edit = Edit(self._number + 1, now(), user, list(changes), request, kind, target)
        stored = self._journal.append(edit)
        self._pending.append(_Pending(edit, self._scene_times, self._project_times))
        stored.add_done_callback(self._edit_stored)
        self._apply(edit)
        self.history.append(edit, step)
        if self._number - self._based_on >= self._limit:
            self._shorten()
        await asyncio.shield(stored)  # the edit is valid even if the caller is cancelled
        record(edit.changes)

    def _apply(self, edit: Edit) -> None:
        self.document.apply(edit.changes)
        self._number = edit.number
        for change in edit.changes:
            self._unsaved.note(change)
        kinds = {change.kind for change in edit.changes}
        if kinds & OF_SCENE:
            self._scene_times = self._scene_times.after_edit(edit.time, differs=self._unsaved.scene)
        if kinds - OF_SCENE:
            self._project_times = self._project_times.after_edit(edit.time, differs=self._unsaved.project)
        self._forget_snapshots()

    def _edit_stored(self, future: "asyncio.Future[None]") -> None:
        if future.exception() is None:
            edit = self._pending.popleft().edit
            for notify in self.on_change:
                notify(edit)

    def _revert_pending(self) -> None:
        """Revert all edits that are not on disk, since the journal cannot be written."""
        while self._pending:
            pending = self._pending.pop()
            inverse = [change.inverse() for change in reversed(pending.edit.changes)]
            self.document.apply(inverse)
            for change in inverse:
                self._unsaved.note(change)
            self._number = pending.edit.number - 1
            self._scene_times, self._project_times = pending.scene, pending.project
            if len(self.history):
                self.history.pop()
        self._forget_snapshots()
        self._journal.next_epoch()

    def _shorten(self) -> None:
        """Write the present document to the journal, so that the file stays small and the next start fast."""
        self._rebase(forget=self._number - self._limit).add_done_callback(lambda future: future.exception())

    def _rebase(self, forget: int) -> "asyncio.Future[None]":
        self._based_on = self._number
        base = Base(self.document.items(), self._number, self._scene_times, self._project_times, forget)
        return self._journal.rebase(base)

    def _journal_history(self, base: Base) -> None:
        """Write a document to the journal together with the edits that led to it."""
        self._journal.rebase(base).add_done_callback(lambda future: future.exception())

    # ------------------------------------------------------------------------------------------ opening, saving
    async def show(self, scene: Scene, project: Project | None = None) -> None:
        """Open a scene, or a project on its scene, with its history; close the open document."""
        with self.document.retiring():
            document, edits = await self._closed.reopen(scene, project)
            await self._closed.store(self.document, self.history, self._unsaved)
            scene_times = Times.of(scene)
            project_times = Times() if project is None else Times.of(project)
            base = Base(document.items(), edits[-1].number if edits else 0, scene_times, project_times, ALL)
            await self._journal.rebase(base)
            if edits:
                # Not awaited, since a long history takes longer than the document. Later edits are written after it.
                self._journal_history(replace(base, forget=0, edits=edits))
        # Set before `_replace` calls observers, which read the times.
        self._scene_times, self._project_times = scene_times, project_times
        self._replace(document, edits)

    async def discard(self) -> None:
        """Close the document and discard its unsaved changes."""
        with self.document.retiring():
            await self._closed.store(self.document, self.history, self._unsaved)
            await self._journal.clear()
        self._scene_times = self._project_times = Times()
        self._replace(Document())

    async def forget_history(self, document: str) -> None:
        """Delete the history of a closed scene or project. Raise OSError on failure."""
        await self._closed.forget(document)

    def set_aside(self) -> Callable[[], None]:
        """Hide the document. Return the function that opens it again with its unsaved changes.

        No other document may be opened until then. The document stays in the journal, so it is open after a restart.

        Raises:
            RequestRefused: An edit is being written.
        """
        if self._pending:
            raise RequestRefused("An edit is in progress. Try again.")
        hidden = self.document, self.history, self.removed_types, self._scene_times, self._project_times, self._unsaved
        number, based_on = self._number, self._based_on

        def show_again() -> None:
            document, self.history, self.removed_types, self._scene_times, self._project_times, unsaved = hidden
            self._number, self._based_on = number, based_on
            self._show(document, unsaved)

        self.history, self.removed_types = History(self._limit), set()
        self._scene_times = self._project_times = Times()
        self._number = self._based_on = 0
        self._show(Document(), Unsaved())
        return show_again

    def _replace(self, document: Document, edits: Sequence[Edit] = ()) -> None:
        self.history.clear()
        for edit in edits:
            self.history.append(edit)
        self.removed_types.clear()
        self._number = self._based_on = edits[-1].number if edits else 0
        self._show(document, Unsaved())

    def _show(self, document: Document, unsaved: Unsaved) -> None:
        self.document, self._unsaved = document, unsaved
        self._forget_snapshots()
        for notify in self.on_change:
            notify(None)

    async def save(self) -> None:
        """Save the scene and the project if they have changes. Raise StorageError on failure."""
        storage = self._storage
        if self.scene_changed:
            saved = await self._save(storage.put_scene(self.require_scene()), scene=True)
            self._scene_times = self._scene_times.after_comparison(differs=self._unsaved.scene, saved=saved)
            self._forget_snapshots()
        if self.project_changed:
            saved = await self._save(storage.put_project(self.require_project()), scene=False)
            self._project_times = self._project_times.after_comparison(differs=self._unsaved.project, saved=saved)
            self._forget_snapshots()
        # Not awaited, since a restart compares the journal with the saved version.
        self._shorten()

    async def _save(self, put: Awaitable[BareScene | BareProject], *, scene: bool) -> BareScene | BareProject:
        # Edits that arrive while the storage is writing are not saved yet.
        unsaved = self._unsaved
        before = unsaved.begin_saving(scene=scene)
        try:
            return await put
        except BaseException:
            unsaved.saving_failed(before, self.document)
            raise

    # ------------------------------------------------------------------------------------------ problems
    def scene_problems(self, scene: Scene) -> list[Message]:
        """Return the problems of a scene, empty if it can be opened."""
        return scene_problems(scene, self._types)
