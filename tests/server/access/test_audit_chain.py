"""The file of the audit trail reveals edited and removed entries."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from arcor2_hw.data.audit import AuditEntry, AuditOutcome, AuditQuery
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import StorageError
from arcor2_server.audit import chain, trail
from arcor2_server.audit.chain import AuditFile
from arcor2_server.audit.command_line import note_command
from arcor2_server.audit.export import csv_chunks
from arcor2_server.audit.trail import AuditTrail
from tests.waiting import wait_for


def entry(number: int) -> AuditEntry:
    return AuditEntry(number, f"2026-01-01T00:00:{number % 60:02}+00:00", AuditOutcome.DONE, f"Request{number}")


def append(file: AuditFile, *numbers: int) -> None:
    file.append([entry(number) for number in numbers])


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file with the entries 1 to 5."""
    with closing(AuditFile(tmp_path / "audit.sqlite")) as file:
        file.open()
        append(file, 1, 2, 3)
        append(file, 4, 5)
    return file.path


def change(path: Path, statement: str) -> None:
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(statement)


def reopened(path: Path, redact: bool = False) -> AuditTrail:
    return AuditTrail(path, (lambda text: text.replace("secret", "***")) if redact else str)


def test_entries_continue_after_a_restart(path: Path) -> None:
    with closing(AuditFile(path)) as file:
        file.open()
        append(file, 6)
        assert [each.number for each in file.all()] == [1, 2, 3, 4, 5, 6]
        assert (file.check().problem, file.check().last) == ("", 6)


@pytest.mark.parametrize(
    ("statement", "problem"),
    [
        ("update entry set user = 'eve' where number = 2", "entry 2 or the one before it was edited"),
        ("update entry set digest = x'00' where number = 2", "entry 2 or the one before it was edited"),
        ("delete from entry where number = 3", "entries 3 to 3 are missing"),
        ("delete from entry where number > 3", "entries 4 to 5 are missing"),
        ("delete from entry where number < 3", "entries 1 to 2 are missing"),
        ("delete from entry", "entries 1 to 5 are missing"),
        ("update entry set number = 6 where number = 5", "entries 5 to 5 are missing"),
    ],
)
def test_edited_and_removed_entries_are_found(path: Path, statement: str, problem: str) -> None:
    change(path, statement)
    assert AuditFile(path).check().problem == problem


def test_the_command_line_adds_entries_while_the_server_writes(path: Path) -> None:
    with closing(AuditFile(path)) as server:
        server.open()
        append(server, 6)
        note_command(path, "token add", "tablet")
        append(server, 8)
        assert [(each.number, each.request) for each in server.all()][-3:] == [
            (6, "Request6"),
            (7, "arcor2-hw token add"),
            (8, "Request8"),
        ]
        assert server.check().problem == ""


def test_a_new_entry_does_not_hide_removed_ones(path: Path) -> None:
    with closing(AuditFile(path)) as server:
        server.open()
        change(path, "delete from entry where number = 5")
        with pytest.raises(StorageError, match="edited"):
            note_command(path, "token add", "tablet")
        append(server, 6)
        assert server.check().problem == "entries 5 to 5 are missing"


def test_a_new_chain_does_not_match_the_head(path: Path) -> None:
    head = (path.parent / "audit.sqlite.head").read_bytes()
    path.unlink()
    with closing(AuditFile(path)) as file:
        file.open()
        file.append([AuditEntry(n, entry(n).time, AuditOutcome.DONE, "Forged") for n in range(1, 6)])
    (path.parent / "audit.sqlite.head").write_bytes(head)
    assert "the digest of entry 5 differs from the head" in AuditFile(path).check().problem


def test_the_oldest_entries_are_deleted(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chain, "LIMIT", 3)
    monkeypatch.setattr(chain, "_PRUNED_AT_ONCE", 4)
    with closing(AuditFile(path)) as file:
        file.open()
        for number in range(6, 12):
            append(file, number)
        numbers = [each.number for each in file.all()]
        assert numbers[-3:] == [9, 10, 11]
        assert len(numbers) <= 7
        assert file.check().problem == ""
    change(path, f"delete from entry where number = {numbers[0]}")
    assert AuditFile(path).check().problem == f"entries {numbers[0]} to {numbers[0]} are missing"


def test_entries_are_found_by_text_outcome_and_number(path: Path) -> None:
    file = AuditFile(path)
    assert [each.number for each in file.find(AuditQuery(limit=2))] == [5, 4]
    assert [each.number for each in file.find(AuditQuery(limit=2, before=4))] == [3, 2]
    assert [each.number for each in file.find(AuditQuery(text="request3"))] == [3]
    assert file.find(AuditQuery(outcome="refused")) == []
    assert file.find(AuditQuery(text="%")) == []


def test_a_formula_is_exported_as_text() -> None:
    (content,) = csv_chunks([AuditEntry(1, entry(1).time, AuditOutcome.REFUSED, "=1+1")])
    assert b",'=1+1," in content


@pytest.mark.parametrize("damage", ["update entry set user = 'eve' where number = 2", None])
async def test_a_file_with_a_problem_is_kept_and_a_new_one_started(path: Path, damage: str | None) -> None:
    if damage is None:
        path.write_bytes(b"not a database" * 1000)
    else:
        change(path, damage)
    audit = reopened(path)
    problem = await audit.open()
    audit.close()
    (stored,) = path.parent.glob("audit.damaged-*.sqlite")
    assert problem is not None
    assert stored.name in problem.text
    assert [(each.number, each.reason) for each in AuditFile(path).all()] == [(1, problem.text)]
    again = reopened(path)
    assert await again.open() is None
    again.close()


async def test_reasons_are_redacted_and_large_changes_are_counted(path: Path) -> None:
    class Change:
        kind, id, before, after = "project", "1", None, "x" * trail.MAX_CHANGES

    audit = reopened(path, redact=True)
    await audit.open()
    audit.note(AuditOutcome.REFUSED, "AddAction", role=Role.OPERATOR, reason="the secret is wrong")
    audit.note(AuditOutcome.DONE, "ImportScript", changes=[Change()])
    audit.close()
    large, refused = AuditFile(path).find(AuditQuery(limit=2))
    assert (refused.reason, refused.role) == ("the *** is wrong", "operator")
    assert (large.changes, large.reason[:17]) == ([], "Changed items: 1.")


async def test_entries_wait_while_the_file_cannot_be_written(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trail, "RETRY_AFTER", 0.01)
    monkeypatch.setattr(trail, "COLLECTION_TIME", 0.0)
    monkeypatch.setattr(trail, "MAX_WAITING", 2)
    write, attempts, full = AuditFile.append, [], True

    def append_if_room(file: AuditFile, rows: list[chain.Row]) -> None:
        attempts.append(len(rows))
        if full:
            raise StorageError("the disk is full")
        write(file, rows)

    monkeypatch.setattr(AuditFile, "append", append_if_room)
    audit = reopened(path)
    await audit.open()
    for name in ("A", "B", "C"):
        audit.note(AuditOutcome.DONE, name)
    wait_for(lambda: attempts and attempts[-1] == 3 and len(attempts) > 5)  # two entries, and one about the loss
    full = False
    wait_for(lambda: AuditFile(path).check().last == 8)
    audit.close()
    lost, last, first = AuditFile(path).find(AuditQuery(limit=3))
    assert (first.request, last.request, lost.reason) == ("B", "C", "Lost entries: 1. The file could not be written.")
