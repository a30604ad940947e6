"""The records of the journal: times, positions, checksums, and reports of losses."""

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.messages import Message
from arcor2_server.documents import journal_file
from arcor2_server.documents.document import Document
from arcor2_server.documents.journal_records import (
    Base,
    JournalContent,
    JournalLoss,
    Position,
    RecoveredDocument,
    Times,
    base_checksum,
    document_of,
    edit_checksum,
    note_missing,
)
from tests.server.session.test_journal_file import SAVED, edit, scene


def test_times_show_whether_a_document_is_unsaved() -> None:
    never, changed = Times("c", "", "x"), replace(SAVED, changed="x")
    assert [times.unsaved for times in (Times(), never, SAVED, changed)] == [True, True, False, True]
    assert SAVED.after_edit("t", differs=True) == replace(SAVED, changed="t")
    assert changed.after_edit("t", differs=False) == SAVED
    assert never.after_edit("t", differs=False) == replace(never, changed="t")
    assert changed.after_comparison(differs=False) == SAVED
    assert changed.after_comparison(differs=True) == changed
    assert never.after_comparison(differs=False) == never
    saved = Scene(name="cell", created="c2", modified="m2", int_modified="i2")
    assert changed.after_comparison(differs=False, saved=saved) == Times("c2", "m2", "")
    assert changed.after_comparison(differs=True, saved=saved) == Times("c2", "m2", "x")
    assert Times.of(saved) == Times("c2", "m2", "i2")
    assert Times.of(Scene(name="cell")) == Times()
    assert SAVED.fields() == {"created": SAVED.created, "modified": SAVED.modified, "int_modified": UNSET}
    assert Times("", "", "x").fields() == {"created": UNSET, "modified": UNSET, "int_modified": "x"}


def test_a_position_has_a_limited_size() -> None:
    position = Position().after(scene("n" * 300)).after(edit(1, "u" * 300))
    assert len(position.user) == 60
    assert position.document == f"scene {'n' * 60!r}"
    assert len(msgspec.json.encode(position)) < journal_file.POSITION_SIZE
    assert [str(each) for each in position.last_change] == [
        f"The last one was made by {'u' * 60} at 2026-01-01 10:00:01 UTC."
    ]
    assert Position().last_change == []


def test_opening_and_closing_a_document_are_counted() -> None:
    opened = Position(4, 9, "scene 'cell'").after(scene("other"))
    assert opened == Position(5, 0, "scene 'other'")
    assert opened.after(None) == Position(6)
    assert Position(6).after(None) == Position(7)


def test_a_project_is_named_before_its_scene() -> None:
    document = Document.of(Scene(name="cell", id="s"), Project(name="sorting", scene_id="s", id="p"))
    assert document_of(document.items()) == "project 'sorting'"
    assert document_of([]) == ""
    later = Base(document.items(), 3, SAVED, Times(), forget=2)
    assert Position(4, 9, "scene 'cell'").after(later) == Position(4, 9, "project 'sorting'")


def test_checksums_cover_every_column() -> None:
    row = [1, "time", "user", b"changes", "request", "edit", 0]
    other = [2, "", "", b"", "", "", 1]
    changed = [[*row[:at], other[at], *row[at + 1 :]] for at in range(len(row))]
    assert len({edit_checksum(each) for each in (row, *changed)}) == len(row) + 1
    row, other = [b"items", 1, "scene", "project"], [b"", 2, "", ""]
    changed = [[*row[:at], other[at], *row[at + 1 :]] for at in range(len(row))]
    assert len({base_checksum(each, 1) for each in (row, *changed)} | {base_checksum(row, 2)}) == len(row) + 2


def test_a_loss_is_a_text_for_users() -> None:
    loss = JournalLoss(Message.of("reason"), Message.of("Everything is lost."), "journal.damaged", incomplete=False)
    assert str(loss.message) == (
        "The journal of unsaved changes is damaged: reason. Everything is lost."
        " The damaged file is stored as journal.damaged."
    )
    assert str(replace(loss, stored_as="").message).endswith("Everything is lost.")


def test_closed_documents_stay_closed() -> None:
    found = RecoveredDocument(scene().items, 0, SAVED, Times(), [])
    closed = JournalContent(3, found)
    note_missing(closed, Position(4))
    assert (closed.recovered, closed.lost, closed.damage, closed.serial) == (
        None,
        None,
        Message.of("the newest changes are missing"),
        4,
    )
    empty = JournalContent(4, None, Message.of("check failed"), Message.of("something"))
    note_missing(empty, Position(4))
    assert (str(empty.damage), empty.lost) == ("check failed", None)
    newer = JournalContent(5, found)
    note_missing(newer, Position(4))
    assert (newer.recovered, newer.serial, newer.damage) == (found, 5, None)
