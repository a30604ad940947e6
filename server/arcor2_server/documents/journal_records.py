"""Records of the journal: documents, edits and the position, each with a checksum."""

import sqlite3
import zlib
from collections.abc import Sequence
from typing import Any, Final

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.project import BareProject
from arcor2_hw.data.scene import BareScene
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message
from arcor2_server.documents.changes import (
    Edit,
    EditKind,
    Item,
    Kind,
    decode_changes,
    decode_items,
    encode_rows,
)

ALL: Final = 2**63 - 1
"""Value of `Base.forget` that drops all edits, also those of another document."""

MAX_NAME: Final = 60
"""Maximum length of a name in a position, characters."""
EDIT_COLUMNS: Final = "number, time, user, changes, request, how, target"
"""Columns of the table `edit` without the checksum."""


class Times(msgspec.Struct, frozen=True):
    """Times at which a document was created, saved, and changed after saving; empty if that did not happen."""

    created: str = ""
    modified: str = ""
    changed: str = ""

    @classmethod
    def of(cls, document: BareScene | BareProject) -> "Times":
        """Return the times of a scene or project."""
        return cls(document.created or "", document.modified or "", document.int_modified or "")

    @property
    def unsaved(self) -> bool:
        """Whether the document has unsaved changes."""
        return not self.modified or bool(self.changed)

    def after_edit(self, time: str, *, differs: bool) -> "Times":
        """Return the times after an edit. `differs`: the document differs from the saved one."""
        return replace(self, changed=time if differs or not self.modified else "")

    def after_comparison(self, *, differs: bool, saved: BareScene | BareProject | None = None) -> "Times":
        """Return the times after the document was compared with the saved version, or was saved at `saved`."""
        changed = self.changed if differs or (saved is None and not self.modified) else ""
        return replace(self if saved is None else Times.of(saved), changed=changed)

    def fields(self) -> dict[str, Any]:
        """Return the times as fields of a scene or project."""
        return {
            "created": self.created or UNSET,
            "modified": self.modified or UNSET,
            "int_modified": self.changed or UNSET,
        }


class RecoveredDocument(msgspec.Struct, frozen=True):
    """The restored document as `items` after edit `number`, and all stored edits."""

    items: list[Item]
    number: int
    scene: Times
    project: Times
    edits: list[Edit]

    @property
    def last(self) -> int:
        """Number of the last edit."""
        return self.edits[-1].number if self.edits else self.number


class Base(msgspec.Struct, frozen=True):
    """A job that writes a complete document: its items after edit `number`.

    Drops stored edits up to `forget`, then stores `edits`, which lead to the document.
    """

    items: list[Item]
    number: int
    scene: Times
    project: Times
    forget: int
    edits: Sequence[Edit] = ()


class Position(msgspec.Struct, frozen=True):
    """The last acknowledged change: its number, author and time.

    `serial` grows by one whenever a document is opened or closed. `document` is empty if none is open.
    """

    serial: int = 0
    number: int = 0
    document: str = ""
    user: str = ""
    time: str = ""

    def after(self, job: Edit | Base | None) -> "Position":
        """Return the position after one more job."""
        match job:
            case Edit():
                return replace(self, number=job.number, user=job.user[:MAX_NAME], time=job.time)
            case Base():
                if job.forget == ALL:
                    return Position(self.serial + 1, job.number, document_of(job.items))
                return replace(self, number=max(self.number, job.number), document=document_of(job.items))
            case None:
                return Position(self.serial + 1)

    @property
    def last_change(self) -> list[Message]:
        """A sentence with the author and time of the last change, if they are known."""
        time = f"{self.time[:19].replace('T', ' ')} UTC"
        last = Message.of("The last one was made by {user} at {time}.", user=self.user, time=time)
        return [last] if self.time else []


class JournalLoss(msgspec.Struct, frozen=True):
    """Data lost by a damaged journal, described for users.

    Attributes:
        reason: How the damage was detected, as a clause.
        lost: The lost data.
        stored_as: The path of the damaged file.
        incomplete: The reopened document differs from the last acknowledged state.
    """

    reason: Message
    lost: Message
    stored_as: str
    incomplete: bool

    @property
    def message(self) -> Message:
        """Sentences about the reason, the lost data, and the path of the damaged file."""
        damaged = Message.of("The journal of unsaved changes is damaged: {reason}.", reason=self.reason)
        stored = [Message.of("The damaged file is stored as {path}.", path=self.stored_as)] if self.stored_as else []
        return Message.joined([damaged, self.lost, *stored])


class JournalDamaged(Arcor2Error):
    """The document in the journal cannot be restored. The message is a clause."""


class JournalContent(msgspec.Struct):
    """The intact content of a journal file, and a description of the damage.

    Attributes:
        serial: See `Position`.
        recovered: The intact document.
        damage: How the damage was detected, as a clause; None without damage.
        lost: The lost data, as sentences.
        incomplete: The intact part differs from the last acknowledged state.
    """

    serial: int = 0
    recovered: RecoveredDocument | None = None
    damage: Message | None = None
    lost: Message | None = None
    incomplete: bool = False


# ---------------------------------------------------------------------------------------------- rows
def write_job(connection: sqlite3.Connection, job: Edit | Base | None, serial: int) -> None:
    """Write one job: append an edit, replace the document, or delete everything (None)."""
    match job:
        case Edit(number, time, user, changes, request, kind, target):
            row = (number, time, user, encode_rows(changes), request, kind.value, target)
            connection.execute("insert into edit values (?, ?, ?, ?, ?, ?, ?, ?)", (*row, edit_checksum(row)))
        case Base(items, number, scene, project, forget, edits):
            times = (msgspec.json.encode(scene).decode(), msgspec.json.encode(project).decode())
            base_row = (encode_rows(items), number, *times)
            checksum = base_checksum(base_row, serial)
            connection.execute("update opening set serial = ?", (serial,))
            connection.execute("insert or replace into base values (1, ?, ?, ?, ?, ?)", (*base_row, checksum))
            connection.execute("delete from edit where number <= ?", (forget,))
            for edit in edits:
                write_job(connection, edit, serial)
        case None:
            connection.execute("update opening set serial = ?", (serial,))
            connection.execute("delete from base")
            connection.execute("delete from edit")


def edit_checksum(row: Sequence[Any]) -> int:
    """Return the checksum of a row of `edit`, given without its last column."""
    number, time, user, changes, *rest = row
    return zlib.crc32(changes, zlib.crc32(repr((number, time, user, *rest)).encode(errors="replace")))


def base_checksum(row: Sequence[Any], serial: int) -> int:
    """Return the checksum of the row of `base`, given without the first and the last column."""
    items, *rest = row
    return zlib.crc32(items, zlib.crc32(repr((*rest, serial)).encode(errors="replace")))


def document_of(items: list[Item]) -> str:
    """Return kind and name of a document: `project 'demo'`; empty if there is none."""
    names = {item.kind: item.value.name for item in items if item.kind in (Kind.SCENE, Kind.PROJECT)}
    if Kind.PROJECT in names:
        return f"project {names[Kind.PROJECT][:MAX_NAME]!r}"
    return f"scene {names[Kind.SCENE][:MAX_NAME]!r}" if Kind.SCENE in names else ""


def _shown(document: str) -> Message:
    """Return the text of `document_of` as a message."""
    kind, _, name = document.partition(" ")
    return Message.of("project {name}" if kind == "project" else "scene {name}", name=name)


def read_content(connection: sqlite3.Connection) -> JournalContent:
    """Read the intact records.

    Raises:
        JournalDamaged: The document itself is damaged.
    """
    (serial,) = connection.execute("select serial from opening").fetchone() or (None,)
    if serial is None:
        raise JournalDamaged("a row is missing")
    content = JournalContent(serial)
    base = connection.execute("select items, edit, scene_times, project_times, sum from base").fetchone()
    rows = connection.execute(f"select {EDIT_COLUMNS}, sum from edit order by number").fetchall()  # noqa: S608
    if base is None:
        if rows:
            raise JournalDamaged("a row is missing")
        return content
    items, number, *times, checksum = base
    if base_checksum((items, number, *times), serial) != checksum:
        raise JournalDamaged("the checksum of the document is wrong")
    intact = {row[0]: row for row in rows if edit_checksum(row[:-1]) == row[-1]}
    first, last = number + 1, number
    while first - 1 in intact:
        first -= 1
    while last + 1 in intact:
        last += 1
    edits = [
        Edit(number, time, user, decode_changes(changes), request, EditKind(kind), target)
        for number, time, user, changes, request, kind, target, _ in (intact[key] for key in range(first, last + 1))
    ]
    scene, project = (msgspec.json.decode(text, type=Times) for text in times)
    content.recovered = RecoveredDocument(decode_items(items), number, scene, project, edits)
    document = document_of(content.recovered.items)
    if beyond := [row[0] for row in rows if row[0] > last]:
        content.damage = _damaged_change(last + 1)
        content.lost, content.incomplete = _lost_changes(document, last, Position(0, beyond[-1])), True
    elif any(row[0] < first for row in rows):
        content.damage = _damaged_change(first - 1)
        content.lost = Message.of(
            "All changes of {document} are present, but those before number {first} cannot be undone.",
            document=_shown(document),
            first=first,
        )
    return content


def note_missing(content: JournalContent, expected: Position) -> None:
    """Add the missing acknowledged changes to the description in `content`."""
    found = content.recovered
    if not expected.document and content.serial <= expected.serial:
        # The document was closed, so the content of the file is saved or discarded.
        if found is not None:
            content.damage = content.damage or Message.of("the newest changes are missing")
        content.recovered, content.lost = None, None
    elif (content.serial, -1 if found is None else found.last) < (expected.serial, expected.number):
        content.damage = content.damage or Message.of("the newest changes are missing")
        if found is not None and content.serial == expected.serial:
            content.lost, content.incomplete = _lost_changes(expected.document, found.last, expected), True
        else:
            # The content belongs to a document that was closed before.
            content.recovered = None
            content.lost = Message.joined(
                [
                    Message.of("Unsaved changes of {document} are lost.", document=_shown(expected.document)),
                    *expected.last_change,
                    Message.of("Open it again: it is as last saved."),
                ]
            )
    content.serial = max(content.serial, expected.serial)


def _damaged_change(number: int) -> Message:
    return Message.of("the checksum of change {number} is wrong, or it is missing", number=number)


def _lost_changes(document: str, last: int, expected: Position) -> Message:
    template = (
        "Change {last} of {document} is lost."
        if expected.number == last + 1
        else "Changes {first} to {last} of {document} are lost."
    )
    lost = Message.of(template, document=_shown(document), first=last + 1, last=expected.number)
    return Message.joined([lost, *expected.last_change, Message.of("Check it before you save it.")])
