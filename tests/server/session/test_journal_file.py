"""The file of the journal, without a server."""

import re
import sqlite3
import stat
from contextlib import closing
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_server.documents import journal_file
from arcor2_server.documents.changes import Change, Edit, Kind, encode_rows
from arcor2_server.documents.document import Document
from arcor2_server.documents.journal_file import JournalFile
from arcor2_server.documents.journal_records import (
    ALL,
    Base,
    JournalContent,
    JournalLoss,
    Position,
    RecoveredDocument,
    Times,
)

SAVED = Times("2026-01-01T09:00:00.000Z", "2026-01-01T09:30:00.000Z", "")


def scene(name: str = "cell", number: int = 0, forget: int = ALL, edits: tuple[Edit, ...] = ()) -> Base:
    return Base(Document.of(Scene(name=name, id=name)).items(), number, SAVED, Times(), forget, edits)


def edit(number: int, user: str = "alice") -> Edit:
    added = SceneObject(f"object_{number}", "Table", id=f"obj_{number}")
    time = f"2026-01-01T10:00:{number:02}.000Z"
    return Edit(number, time, user, [Change(Kind.OBJECT, added.id, "", number, None, added)], "AddObjectToScene")


def reopened(path: Path) -> tuple[RecoveredDocument | None, JournalLoss | None]:
    with closing(JournalFile(path)) as file:
        return file.open()


def numbers(found: RecoveredDocument | None) -> list[int]:
    assert found is not None
    return [each.number for each in found.edits]


def change(path: Path, statement: str) -> None:
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(statement)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return the path of a journal with an open scene and five edits."""
    path = tmp_path / "journal.sqlite"
    with closing(JournalFile(path)) as file:
        assert file.open() == (None, None)
        file.commit([scene()])
        file.commit([edit(1)])
        file.commit([edit(number) for number in range(2, 6)])
    return path


def test_a_new_journal_is_empty_and_private(tmp_path: Path) -> None:
    path = tmp_path / "journal.sqlite"
    with closing(JournalFile(path)) as file:
        assert file.open() == (None, None)
        assert file.position == Position()
        file.extend_log()
    assert reopened(path) == (None, None)
    for name in ("journal.sqlite", "journal.position"):
        assert stat.S_IMODE((tmp_path / name).stat().st_mode) == 0o600
    assert (tmp_path / "journal.position").stat().st_size == 1024


def test_committed_jobs_are_read_again(path: Path) -> None:
    found, loss = reopened(path)
    assert loss is None
    assert found is not None
    assert numbers(found) == [1, 2, 3, 4, 5]
    assert found.edits == [edit(number) for number in range(1, 6)]
    assert found.items == scene().items
    assert (found.number, found.last, found.scene, found.project) == (0, 5, SAVED, Times())


def test_the_position_follows_each_commit(path: Path) -> None:
    with closing(JournalFile(path)) as file:
        file.open()
        assert file.position == Position(1, 5, "scene 'cell'")
        file.commit([edit(6, "bob"), edit(7, "eve")])
        assert file.position == Position(1, 7, "scene 'cell'", "eve", edit(7).time)
        written = path.with_suffix(".position").read_bytes().strip().rpartition(b" ")[0]
        assert msgspec.json.decode(written, type=Position) == file.position
        file.commit([scene("other", 7)])
        assert file.position == Position(2, 7, "scene 'other'")
        file.commit([None])
        assert file.position == Position(3)
    assert reopened(path) == (None, None)


def test_a_later_base_drops_older_edits(path: Path) -> None:
    with closing(JournalFile(path)) as file:
        file.open()
        file.commit([scene("cell", 4, forget=2)])
        assert file.position.number == 5
    found, loss = reopened(path)
    assert loss is None
    assert found is not None
    assert (found.number, found.last, numbers(found)) == (4, 5, [3, 4, 5])
    with closing(JournalFile(path)) as file:
        file.open()
        file.commit([scene("cell", 9, ALL, (edit(8), edit(9)))])
    assert numbers(reopened(path)[0]) == [8, 9]


def test_a_failed_commit_changes_nothing(path: Path) -> None:
    with closing(JournalFile(path)) as file:
        file.open()
        position = file.position
        with pytest.raises(sqlite3.IntegrityError):
            file.commit([edit(6), edit(5)])
        assert file.position == position
        file.commit([edit(6)])
    assert numbers(reopened(path)[0]) == [1, 2, 3, 4, 5, 6]


def test_the_log_is_reused_instead_of_growing(path: Path) -> None:
    with closing(JournalFile(path)) as file:
        file.open()
        file.extend_log()
        log = path.with_name("journal.sqlite-wal")
        size = log.stat().st_size
        assert size > journal_file.CHECKPOINT_PAGES * 4096
        for number in range(6, 20):
            file.commit([edit(number)])
        assert log.stat().st_size == size
    change(path, "create table extent (content blob)")
    with closing(JournalFile(path)) as file:
        file.open()
        file.extend_log()
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("select 1 from sqlite_master where name = 'extent'").fetchone() is None


def test_a_full_disk_is_not_an_error_for_the_log(
    path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with closing(JournalFile(path)) as file:
        file.open()
        monkeypatch.setattr(journal_file, "CHECKPOINT_PAGES", 2**40)
        file.extend_log()
        file.commit([edit(6)])
    assert numbers(reopened(path)[0])[-1] == 6


def test_a_position_that_cannot_be_written_is_not_an_error(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with closing(JournalFile(path)) as file:
        file.open()

        def full(*_: object) -> int:
            raise OSError("disk full")

        monkeypatch.setattr(journal_file.os, "pwrite", full)
        file.commit([edit(6)])
    monkeypatch.undo()
    found, loss = reopened(path)
    assert loss is None
    assert numbers(found)[-1] == 6


def test_a_converted_document_leaves_nothing_of_the_old_one(path: Path, tmp_path: Path) -> None:
    assert b"object_5" in path.read_bytes()

    def convert(found: RecoveredDocument) -> RecoveredDocument:
        return replace(found, edits=found.edits[:2])

    with closing(JournalFile(path, convert)) as file:
        found, loss = file.open()
        assert numbers(found) == [1, 2]
        assert loss is None
        assert file.position.serial == 1
        file.commit([edit(3, "after")])
    assert sorted(each.name for each in tmp_path.iterdir()) == ["journal.position", "journal.sqlite"]
    assert b"object_5" not in path.read_bytes()
    found, loss = reopened(path)
    assert numbers(found) == [1, 2, 3]
    assert loss is None


@pytest.mark.parametrize("version", [1, 2])
def test_older_formats_are_converted(tmp_path: Path, version: int) -> None:
    path = tmp_path / "journal.sqlite"
    base, changes = scene(), [edit(1), edit(2)]
    times = [msgspec.json.encode(each).decode() for each in (base.scene, base.project)]
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(
            "create table base (id integer primary key check (id = 1), items blob not null, edit integer not null,"
            " scene_times text not null, project_times text not null) strict"
        )
        connection.execute("insert into base values (1, ?, 0, ?, ?)", (encode_rows(base.items), *times))
        later = (
            ", request text not null default '', how text not null default 'edit', target integer not null default 0"
        )
        connection.execute(
            "create table edit (number integer primary key, time text not null, user text not null,"
            f" changes blob not null{later if version == 2 else ''}) strict"
        )
        for each in changes:
            row = (each.number, each.time, each.user, encode_rows(each.changes))
            connection.execute("insert into edit (number, time, user, changes) values (?, ?, ?, ?)", row)
        connection.execute(f"pragma user_version = {version}")
    for _ in range(2):
        found, loss = reopened(path)
        assert loss is None
        assert numbers(found) == [1, 2]
        assert found is not None
        assert found.items == base.items
        assert found.edits[0].request == ""


@pytest.mark.parametrize("version", [4, 99, -1])
def test_a_file_of_unknown_format_is_renamed(path: Path, version: int) -> None:
    change(path, f"pragma user_version = {version}")
    found, loss = reopened(path)
    assert found is None
    assert loss is not None
    assert f"its format is {version}" in loss.reason.text
    assert "Unsaved changes of scene 'cell' are lost. The last one was made by" in loss.lost.text
    assert not loss.incomplete
    with closing(sqlite3.connect(loss.stored_as)) as stored:
        assert stored.execute("select count(*) from edit").fetchone() == (5,)
    assert reopened(path) == (None, None)


@pytest.mark.parametrize(
    ("statement", "remaining", "lost"),
    [
        ("update edit set user = 'eve' where number = 5", [1, 2, 3, 4], r"Change 5 of scene 'cell' is lost"),
        ("update edit set sum = 0 where number = 4", [1, 2, 3], r"Changes 4 to 5 of scene 'cell' are lost"),
        ("delete from edit where number = 3", [1, 2], r"Changes 3 to 5 of scene 'cell' are lost"),
        (
            "delete from edit where number > 3",
            [1, 2, 3],
            r"Changes 4 to 5 of .* are lost\. The last one was made by alice",
        ),
        ("delete from edit", [], r"Changes 1 to 5 of scene 'cell' are lost"),
    ],
)
def test_missing_and_damaged_edits_are_reported(path: Path, statement: str, remaining: list[int], lost: str) -> None:
    change(path, statement)
    found, loss = reopened(path)
    assert numbers(found) == remaining
    assert loss is not None
    assert re.match(lost, loss.lost.text)
    assert loss.incomplete
    assert Path(loss.stored_as).exists()
    found, loss = reopened(path)
    assert numbers(found) == remaining
    assert loss is None


@pytest.mark.parametrize(
    ("statement", "reason"),
    [
        ("update base set sum = sum + 1", "the checksum of the document is wrong"),
        ("update base set edit = 1", "the checksum of the document is wrong"),
        ("update opening set serial = 7", "the checksum of the document is wrong"),
        ("delete from base", "a row is missing"),
        ("delete from opening", "a row is missing"),
        ("drop table base", "no such table: base"),
    ],
)
def test_a_damaged_document_is_lost_and_reported(path: Path, statement: str, reason: str) -> None:
    change(path, statement)
    found, loss = reopened(path)
    assert found is None
    assert loss is not None
    assert loss.reason.text == reason
    assert "scene 'cell'" in loss.lost.text
    assert not loss.incomplete
    assert reopened(path) == (None, None)


def test_without_a_position_the_content_of_the_file_is_used(path: Path) -> None:
    position = path.with_suffix(".position")
    for content in (b"", b"{}", b"nonsense 00000000", b'{"serial": 9} 00000000'):
        position.write_bytes(content)
        found, loss = reopened(path)
        assert numbers(found) == [1, 2, 3, 4, 5]
        assert loss is None
    position.unlink()
    change(path, "delete from edit where number = 5")
    found, loss = reopened(path)
    assert numbers(found) == [1, 2, 3, 4]
    assert loss is None, "nothing records the fifth change any more"


def test_an_older_document_is_not_reopened_for_a_newer_one(path: Path, tmp_path: Path) -> None:
    old = path.read_bytes()
    with closing(JournalFile(path)) as file:
        file.open()
        file.commit([scene("new")])
    path.write_bytes(old)
    found, loss = reopened(path)
    assert found is None
    assert loss is not None
    assert loss.lost.text == "Unsaved changes of scene 'new' are lost. Open it again: it is as last saved."
    with closing(JournalFile(path)) as file:
        file.open()
        assert file.position.serial == 2, "each opening has its own number"


def test_a_second_owner_is_refused(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal_file, "BUSY_TIMEOUT", 0.01)
    with closing(JournalFile(path)) as file:
        file.open()
        with pytest.raises(sqlite3.OperationalError, match="locked"):
            reopened(path)
        file.commit([edit(6)])
    assert numbers(reopened(path)[0])[-1] == 6


@pytest.mark.parametrize("code", [sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_READONLY])
def test_an_error_of_the_disk_is_not_taken_for_damage(path: Path, monkeypatch: pytest.MonkeyPatch, code: int) -> None:
    error = sqlite3.OperationalError("disk")
    error.sqlite_errorcode = code  # type: ignore[misc]
    content = path.read_bytes()

    def fail(_: sqlite3.Connection) -> JournalContent:
        raise error

    monkeypatch.setattr(journal_file, "_recover", fail)
    with pytest.raises(sqlite3.OperationalError, match="disk"):
        reopened(path)
    monkeypatch.undo()
    assert path.read_bytes() == content
    assert [each.name for each in path.parent.glob("journal.damaged*")] == []


def test_a_file_of_another_format_version_is_damaged(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[18:20] = b"\7\7"
    path.write_bytes(content)
    found, loss = reopened(path)
    assert found is None
    assert loss is not None
    assert Path(loss.stored_as).read_bytes()[18:20] == b"\7\7"


def test_closing_twice_is_allowed(path: Path) -> None:
    file = JournalFile(path)
    file.close()
    file.open()
    file.close()
    file.close()
