"""A damaged journal: either every acknowledged change is restored, or the loss is reported and the file is kept."""

import random
import shutil
import sqlite3
from pathlib import Path

import pytest

from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_server.documents.changes import Change, Edit, Kind
from arcor2_server.documents.document import Document
from arcor2_server.documents.journal_file import JournalFile
from arcor2_server.documents.journal_records import ALL, Base, JournalLoss, RecoveredDocument, Times

EDITS = 40
REBASED = 12
"""The edit after which the journal starts with a new base, as when the scene is saved."""


def scene(name: str) -> Base:
    return Base(Document.of(Scene(name=name, id=name)).items(), 0, Times(created="a"), Times(), ALL)


def edit(number: int) -> Edit:
    added = SceneObject(f"object_{number}", "Type" * 20, id=f"obj_{number}")
    time = f"2026-01-01T10:00:{number:02}.000Z"
    return Edit(number, time, "alice", [Change(Kind.OBJECT, added.id, "", number + 1, None, added)])


def objects(found: RecoveredDocument | None) -> list[str]:
    """Return the names of the objects of the recovered document."""
    if found is None:
        return []
    document = Document(found.items)
    for each in found.edits:
        if each.number > found.number:
            document.apply(each.changes)
    return [item.value.name for item in document.of_kind(Kind.OBJECT)]


ALL_OBJECTS = [f"object_{number}" for number in range(1, EDITS + 1)]


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a directory as a killed server leaves it: some changes in the database, the latest in the log."""
    directory = tmp_path_factory.mktemp("running")
    file = JournalFile(directory / "journal.sqlite")
    file.open()
    file.extend_log()
    file.commit([scene("closed")])
    file.commit([edit(1), edit(2)])
    file.commit([None])
    file.commit([scene("open")])
    document = Document(scene("open").items)
    for number in range(1, EDITS + 1):
        file.commit([edit(number)])
        if number <= REBASED:
            document.apply(edit(number).changes)
        if number == REBASED:
            file.commit([Base(document.items(), number, Times(), Times(), forget=2)])
        if number == EDITS // 2:
            assert file._connection is not None
            file._connection.execute("pragma wal_checkpoint(passive)").fetchall()
    copy = tmp_path_factory.mktemp("killed") / "data"
    shutil.copytree(directory, copy)
    file.close()
    return copy


def reopened(directory: Path) -> tuple[RecoveredDocument | None, JournalLoss | None]:
    file = JournalFile(directory / "journal.sqlite")
    try:
        return file.open()
    finally:
        file.close()


def check(directory: Path, damage: str) -> JournalLoss | None:
    """Open the journal; assert that it is complete or reports the loss, and that it can be used again."""
    found, loss = reopened(directory)
    whole = objects(found) == ALL_OBJECTS
    assert whole or loss is not None, damage
    if loss is not None:
        assert "scene 'open'" in loss.lost.text, damage
        assert whole or "lost" in loss.lost.text, damage
        assert not loss.stored_as or Path(loss.stored_as).exists(), damage
        # The reopened document is never older than the reported loss.
        assert objects(found) == ALL_OBJECTS[: len(objects(found))], damage
    again, loss_again = reopened(directory)
    assert objects(again) == objects(found), damage
    assert loss_again is None, damage
    return loss


def test_a_killed_server_loses_nothing(killed: Path, tmp_path: Path) -> None:
    shutil.copytree(killed, tmp_path / "data")
    assert check(tmp_path / "data", "none") is None
    assert sorted(path.name for path in (tmp_path / "data").iterdir()) == ["journal.position", "journal.sqlite"]


@pytest.mark.parametrize("name", ["journal.sqlite", "journal.sqlite-wal", "journal.position"])
def test_a_flipped_byte_is_harmless_or_reported(killed: Path, tmp_path: Path, name: str) -> None:
    size = (killed / name).stat().st_size
    content = (killed / name).read_bytes()
    used = [at for at in range(size) if content[at]]  # a zero is mostly unused space
    chance = random.Random(name)
    losses = 0
    for number in range(40):
        directory = tmp_path / str(number)
        shutil.copytree(killed, directory)
        at, mask = chance.choice(used), chance.randrange(1, 256)
        damaged = bytearray(content)
        damaged[at] ^= mask
        (directory / name).write_bytes(damaged)
        losses += check(directory, f"byte {at} of {name} xor {mask}") is not None
        shutil.rmtree(directory)
    assert losses == 0 if name == "journal.position" else losses > 0


def test_a_missing_log_is_reported(killed: Path, tmp_path: Path) -> None:
    shutil.copytree(killed, tmp_path / "data")
    (tmp_path / "data" / "journal.sqlite-wal").unlink()
    loss = check(tmp_path / "data", "no log")
    assert loss is not None
    assert (
        f"to {EDITS} of scene 'open' are lost. The last one was made by alice at 2026-01-01 10:00:40 UTC."
        in loss.lost.text
    )
    assert Path(loss.stored_as).exists()


def test_a_missing_database_is_reported(killed: Path, tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    shutil.copy(killed / "journal.position", tmp_path / "data")
    loss = check(tmp_path / "data", "no database")
    assert loss is not None
    assert "scene 'open'" in str(loss.message)


def test_a_truncated_log_is_harmless_or_reported(killed: Path, tmp_path: Path) -> None:
    for number, part in enumerate((0.02, 0.1, 0.3, 0.6)):
        directory = tmp_path / str(number)
        shutil.copytree(killed, directory)
        log = directory / "journal.sqlite-wal"
        log.write_bytes(log.read_bytes()[: int(log.stat().st_size * part)])
        check(directory, f"{part} of the log")


def test_damage_in_changes_that_only_undo_needs_is_not_a_loss_of_the_document(killed: Path, tmp_path: Path) -> None:
    shutil.copytree(killed, tmp_path / "data")
    connection = sqlite3.connect(tmp_path / "data" / "journal.sqlite")
    connection.execute("update edit set user = 'mallory' where number = 7")
    connection.commit()
    connection.close()
    found, loss = reopened(tmp_path / "data")
    assert objects(found) == ALL_OBJECTS
    assert found is not None
    assert [each.number for each in found.edits] == list(range(8, EDITS + 1))
    assert loss is not None
    assert loss.reason.text == "the checksum of change 7 is wrong, or it is missing"
    assert "those before number 8 cannot be undone" in loss.lost.text
    assert not loss.incomplete


@pytest.mark.parametrize(
    ("number", "lost"),
    [(30, "Changes 30 to 40 of scene 'open' are lost"), (EDITS, "Change 40 of scene 'open' is lost")],
)
def test_changes_after_a_missing_one_are_reported(killed: Path, tmp_path: Path, number: int, lost: str) -> None:
    shutil.copytree(killed, tmp_path / "data")
    connection = sqlite3.connect(tmp_path / "data" / "journal.sqlite")
    connection.execute("delete from edit where number = ?", (number,))
    connection.commit()
    connection.close()
    found, loss = reopened(tmp_path / "data")
    assert objects(found) == ALL_OBJECTS[: number - 1]
    assert loss is not None
    assert loss.lost.text.startswith(lost)
    assert loss.incomplete


def test_a_document_that_was_closed_is_not_reopened(killed: Path, tmp_path: Path) -> None:
    shutil.copytree(killed, tmp_path / "data")
    file = JournalFile(tmp_path / "data" / "journal.sqlite")
    file.open()
    file.commit([None])
    shutil.copy(tmp_path / "data" / "journal.position", tmp_path)
    file.close()
    for name in ("journal.sqlite", "journal.sqlite-wal"):
        shutil.copy(killed / name, tmp_path / "data")
    found, loss = reopened(tmp_path / "data")
    assert found is None
    assert loss is None  # it was saved or discarded
    assert list((tmp_path / "data").glob("journal.damaged-*.sqlite"))
