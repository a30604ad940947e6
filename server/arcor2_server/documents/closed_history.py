"""Histories of closed documents: stored on close, continued when the document is opened again."""

import asyncio
import hashlib
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import now
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.messages import Message
from arcor2_server.documents.changes import (
    FILE_NAMES,
    OF_SCENE,
    Change,
    Edit,
    EditKind,
    Item,
    Kind,
    decode_changes,
    decode_items,
)
from arcor2_server.documents.document import UNTIMED, Document
from arcor2_server.documents.history import History
from arcor2_server.documents.unsaved import Unsaved
from arcor2_server.files import DIRECTORY_MODE, write_private
from arcor2_server.storage.damage_notices import DataDamage

log = structlog.get_logger(__name__)

CLOSED_LIMIT: Final = 100
"""Maximum number of closed documents whose history is stored. The document that was closed first is dropped first."""


class ClosedHistory(msgspec.Struct, frozen=True):
    """The edits of a closed document, and its items after the last edit."""

    document: str
    items: list[Item]
    edits: list[Edit]


class _EditRow(msgspec.Struct, frozen=True, rename=FILE_NAMES):
    number: int
    time: str
    user: str
    changes: msgspec.Raw
    request: str
    kind: EditKind
    target: int


class _Stored(msgspec.Struct, frozen=True):
    document: str
    items: msgspec.Raw
    edits: list[_EditRow]


class ClosedHistories:
    """The histories of closed documents, one file each."""

    def __init__(self, directory: Path, damage: DataDamage) -> None:
        self._directory = directory
        self._damage = damage
        self._latest: ClosedHistory | None = None
        """The history of the document closed last, which is often opened next, as by "Save and run"."""

    async def store(self, document: Document, history: History, unsaved: Unsaved) -> None:
        """Store the history of a document that is about to be closed, up to the saved version."""
        item = next((item for kind in (Kind.PROJECT, Kind.SCENE) for item in document.of_kind(kind)), None)
        if item is None:
            return
        closed = history_to_close(item.id, document, history, unsaved)
        try:
            if closed is None:
                await self.forget(item.id)
            else:
                self._latest = None
                await asyncio.to_thread(self._write, closed)
                self._latest = closed
        except OSError as error:
            log.warning("undo history is not stored", document=item.id, reason=str(error))

    async def reopen(self, scene: Scene, project: Project | None) -> tuple[Document, list[Edit]]:
        """Return the document of a scene or project with its history.

        The history is empty if no stored one leads to it.
        """
        opened = project or scene
        closed = self._latest
        if closed is None or closed.document != opened.id:
            closed = await self._load(opened)
        continued = None if closed is None else continue_history(closed, scene, project)
        return continued or (Document.of(scene, project), [])

    async def _load(self, opened: Scene | Project) -> ClosedHistory | None:
        path = self._path(opened.id)
        try:
            return await asyncio.to_thread(_read, path)
        except FileNotFoundError:
            pass
        except OSError as error:
            log.error("undo history cannot be read", file=str(path), reason=str(error))
        except (zlib.error, ValueError) as error:
            what = Message.of("Edits of {name!r} from before it was opened cannot be undone.", name=opened.name)
            self._damage.set_aside(path, what, error)
        return None

    async def forget(self, document: str) -> None:
        """Delete the history of a document. Raise OSError on failure."""
        self._latest = None
        await asyncio.to_thread(self._path(document).unlink, missing_ok=True)

    def _write(self, history: ClosedHistory) -> None:
        self._directory.mkdir(mode=DIRECTORY_MODE, exist_ok=True)
        write_private(self._path(history.document), zlib.compress(msgspec.json.encode(history), 1))
        stored = sorted(self._directory.glob("*.history"), key=lambda file: file.stat().st_mtime_ns)
        for oldest in stored[:-CLOSED_LIMIT]:
            oldest.unlink()

    def _path(self, document: str) -> Path:
        # An id may contain characters that are not allowed in file names.
        return self._directory / f"{hashlib.sha256(document.encode()).hexdigest()}.history"


def _read(path: Path) -> ClosedHistory:
    """Read a stored history. Raise OSError, or zlib.error or ValueError if the file is damaged."""
    stored = msgspec.json.decode(zlib.decompress(path.read_bytes()), type=_Stored)
    edits = [
        Edit(row.number, row.time, row.user, decode_changes(row.changes), row.request, row.kind, row.target)
        for row in stored.edits
    ]
    return ClosedHistory(stored.document, decode_items(stored.items), edits)


# ---------------------------------------------------------------------------------------------- closing
def history_to_close(key: str, document: Document, history: History, unsaved: Unsaved) -> ClosedHistory | None:
    """Return the history up to the saved version, None if no revision equals it.

    Later edits are dropped, since closing discards them.
    """
    edits, unsaved, discarded = list(history), unsaved.copy(), list[Change]()
    while edits and (unsaved.scene or unsaved.project):
        for change in reversed(edits.pop().changes):
            discarded.append(change.inverse())
            unsaved.note(discarded[-1])
    if not edits or unsaved.scene or unsaved.project:
        return None
    if discarded:
        document = Document(document.items())
        document.apply(discarded)
    return ClosedHistory(key, document.items(), edits)


# ---------------------------------------------------------------------------------------------- opening
def continue_history(
    closed: ClosedHistory, scene: Scene, project: Project | None
) -> tuple[Document, list[Edit]] | None:
    """Return the saved document and its history; None if the history does not lead to it.

    Changes made outside of the editor since the document was closed become a last edit without a user.
    """
    # Only the items are needed. A second document with its indexes would double the time.
    saved = [
        Item(change.kind, change.id, change.parent, change.rank, change.after)
        for change in Document().changes_to_fill(scene, project)
    ]
    of_scene = project is None
    # The scene of a project has its own history, so its present items are used.
    items = [item for item in closed.items if (item.kind in OF_SCENE) is of_scene]
    items += [item for item in saved if (item.kind in OF_SCENE) is not of_scene]
    document = Document(items)
    changes = differences(document, saved)
    document.apply(changes)
    # Changes do not cover the order and the action point of items, so these may still differ.
    untimed = replace(scene, **UNTIMED), project and replace(project, **UNTIMED)
    if (document.scene, document.project) != untimed:
        return None
    edits = closed.edits
    if changes:
        edits = [*edits, Edit(edits[-1].number + 1, now(), "", changes, kind=EditKind.EXTERNAL)]
    return document, edits


def differences(document: Document, wanted: Iterable[Item]) -> list[Change]:
    """Return the changes that turn the items of a document into the wanted ones."""
    changes, found = [], set()
    for item in wanted:
        found.add((item.kind, item.id))
        present = document.find(item.kind, item.id)
        if present is None:
            changes.append(document.add(item.kind, item.id, item.value, item.parent))
        elif present.value != item.value:
            changes.append(document.update(item.kind, item.id, item.value))
    removed = [item for item in document.items() if (item.kind, item.id) not in found]
    return [document.remove(item.kind, item.id) for item in reversed(removed)] + changes
