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
from arcor2_server.documents.changes import (
    Edit,
    How,
    Item,
    Kind,
    decode_changes,
    decode_items,
    encode_changes,
    encode_items,
)

ALL: Final = 2**63 - 1
"""As `Base.forget`: drop all edits, those of another document too."""

LONGEST_NAME: Final = 60
"""Characters of a name in a position."""
COLUMNS: Final = "number, time, user, changes, request, how, target"


class Times(msgspec.Struct, frozen=True):
    """Times at which a document was created, saved, and changed after it was saved; empty if it was not."""

    created: str = ""
    modified: str = ""
    changed: str = ""

    @classmethod
    def of(cls, document: BareScene | BareProject) -> "Times":
        """Return the times of a scene or project."""
        return cls(document.created or "", document.modified or "", document.int_modified or "")

    @property
    def unsaved(self) -> bool:
        """Whether there is anything that is not saved."""
        return not self.modified or bool(self.changed)

    def touched(self, time: str, *, differs: bool) -> "Times":
        """Return the times after a change, which may have brought a document back to what is saved."""
        return replace(self, changed=time if differs or not self.modified else "")

    def settled(self, *, differs: bool, saved: BareScene | BareProject | None = None) -> "Times":
        """Return the times of a document that was compared with what is saved, or was saved."""
        changed = self.changed if differs or (saved is None and not self.modified) else ""
        return replace(self if saved is None else Times.of(saved), changed=changed)

    def fields(self) -> dict[str, Any]:
        """Return the times as fields of a scene or project."""
        return {
            "created": self.created or UNSET,
            "modified": self.modified or UNSET,
            "int_modified": self.changed or UNSET,
        }


class Recovered(msgspec.Struct, frozen=True):
    """The content of the journal: the document as `items` after edit `number`, and all stored edits."""

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
    """A complete document: its items after edit `number`.

    Stored edits up to `forget` are dropped. Then `edits`, which lead to the document, are stored.
    """

    items: list[Item]
    number: int
    scene: Times
    project: Times
    forget: int
    edits: Sequence[Edit] = ()


class Position(msgspec.Struct, frozen=True):
    """The last acknowledged change: the opening of which document, its number, author and time.

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
                return replace(self, number=job.number, user=job.user[:LONGEST_NAME], time=job.time)
            case Base():
                if job.forget == ALL:
                    return Position(self.serial + 1, job.number, document_of(job.items))
                return replace(self, number=max(self.number, job.number), document=document_of(job.items))
            case None:
                return Position(self.serial + 1)

    @property
    def last_change(self) -> str:
        """A clause that names the last change."""
        return f", the last one by {self.user} at {self.time[:19].replace('T', ' ')} UTC" if self.time else ""


class Loss(msgspec.Struct, frozen=True):
    """What a damaged journal lost, as sentences for users.

    `incomplete`: the reopened document differs from the last acknowledged state.
    """

    reason: str
    lost: str
    stored_as: str
    incomplete: bool

    def __str__(self) -> str:
        stored = f" The damaged file is stored as {self.stored_as}." if self.stored_as else ""
        return f"The journal of unsaved changes is damaged: {self.reason}. {self.lost}{stored}"


class Damaged(Exception):
    """The content of the file cannot be used."""


class Reading(msgspec.Struct):
    """The content of a file: `recovered` is intact, `lost` describes the rest, `damage` how it was detected."""

    serial: int = 0
    recovered: Recovered | None = None
    damage: str = ""
    lost: str = ""
    incomplete: bool = False


# ---------------------------------------------------------------------------------------------- rows
def write(connection: sqlite3.Connection, job: Edit | Base | None, serial: int) -> None:
    """Write one job: append an edit, begin with a whole document, or forget everything (None)."""
    match job:
        case Edit(number, time, user, changes, request, how, of):
            row = (number, time, user, encode_changes(changes), request, how.value, of)
            connection.execute("insert into edit values (?, ?, ?, ?, ?, ?, ?, ?)", (*row, edit_sum(row)))
        case Base(items, number, scene, project, forget, edits):
            times = (msgspec.json.encode(scene).decode(), msgspec.json.encode(project).decode())
            whole = (encode_items(items), number, *times)
            connection.execute("update opening set serial = ?", (serial,))
            connection.execute(
                "insert or replace into base values (1, ?, ?, ?, ?, ?)", (*whole, base_sum(whole, serial))
            )
            connection.execute("delete from edit where number <= ?", (forget,))
            for edit in edits:
                write(connection, edit, serial)
        case None:
            connection.execute("update opening set serial = ?", (serial,))
            connection.execute("delete from base")
            connection.execute("delete from edit")


def edit_sum(row: Sequence[Any]) -> int:
    """Return the checksum of a row of `edit`, given without its last column."""
    number, time, user, changes, *rest = row
    return zlib.crc32(changes, zlib.crc32(repr((number, time, user, *rest)).encode(errors="replace")))


def base_sum(row: Sequence[Any], serial: int) -> int:
    """Return the checksum of the row of `base`, given without the first and the last column."""
    items, *rest = row
    return zlib.crc32(items, zlib.crc32(repr((*rest, serial)).encode(errors="replace")))


def document_of(items: list[Item]) -> str:
    """Return kind and name of what is open."""
    names = {item.kind: item.value.name for item in items if item.kind in (Kind.SCENE, Kind.PROJECT)}
    if Kind.PROJECT in names:
        return f"project {names[Kind.PROJECT][:LONGEST_NAME]!r}"
    return f"scene {names[Kind.SCENE][:LONGEST_NAME]!r}" if Kind.SCENE in names else ""


def read_rows(connection: sqlite3.Connection) -> Reading:
    """Read what is intact. Raises Damaged when the document itself is not."""
    (serial,) = connection.execute("select serial from opening").fetchone() or (None,)
    if serial is None:
        raise Damaged("a row is missing")
    reading = Reading(serial)
    base = connection.execute("select items, edit, scene_times, project_times, sum from base").fetchone()
    rows = connection.execute(f"select {COLUMNS}, sum from edit order by number").fetchall()  # noqa: S608
    if base is None:
        if rows:
            raise Damaged("a row is missing")
        return reading
    items, number, *times, checksum = base
    if base_sum((items, number, *times), serial) != checksum:
        raise Damaged("the checksum of the document is wrong")
    intact = {row[0]: row for row in rows if edit_sum(row[:-1]) == row[-1]}
    first, last = number + 1, number
    while first - 1 in intact:
        first -= 1
    while last + 1 in intact:
        last += 1
    edits = [
        Edit(number, time, user, decode_changes(changes), request, How(how), of)
        for number, time, user, changes, request, how, of, _ in (intact[key] for key in range(first, last + 1))
    ]
    scene, project = (msgspec.json.decode(text, type=Times) for text in times)
    reading.recovered = Recovered(decode_items(items), number, scene, project, edits)
    document = document_of(reading.recovered.items)
    if beyond := [row[0] for row in rows if row[0] > last]:
        reading.damage = f"the checksum of change {last + 1} is wrong, or it is missing"
        reading.lost, reading.incomplete = _lost_changes(document, last, Position(0, beyond[-1])), True
    elif any(row[0] < first for row in rows):
        reading.damage = f"the checksum of change {first - 1} is wrong, or it is missing"
        reading.lost = f"All changes of {document} are present, but those before number {first} cannot be undone."
    return reading


def compare(reading: Reading, expected: Position) -> None:
    """Note in `reading` what is missing of the changes that were acknowledged."""
    found = reading.recovered
    if not expected.document and reading.serial <= expected.serial:
        # Everything was closed. What the file still holds was discarded or saved.
        if found is not None:
            reading.damage = reading.damage or "the newest changes are missing"
        reading.recovered, reading.lost = None, ""
    elif (reading.serial, -1 if found is None else found.last) < (expected.serial, expected.number):
        reading.damage = reading.damage or "the newest changes are missing"
        if found is not None and reading.serial == expected.serial:
            reading.lost, reading.incomplete = _lost_changes(expected.document, found.last, expected), True
        else:
            # What is left belongs to a document that was closed before.
            reading.recovered = None
            reading.lost = (
                f"Unsaved changes of {expected.document} are lost{expected.last_change}. "
                "Open it again: it is as last saved."
            )
    reading.serial = max(reading.serial, expected.serial)


def _lost_changes(document: str, last: int, expected: Position) -> str:
    which = f"Change {expected.number}" if expected.number == last + 1 else f"Changes {last + 1} to {expected.number}"
    are = "is" if expected.number == last + 1 else "are"
    return f"{which} of {document} {are} lost{expected.last_change}. Check it before you save it."
