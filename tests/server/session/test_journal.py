"""The journal's thread: the order of jobs, one commit for all that wait, and failures."""

import asyncio
import sqlite3
import threading
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from arcor2_hw.exceptions import StorageError
from arcor2_server.documents.changes import Edit
from arcor2_server.documents.journal import Journal
from arcor2_server.documents.journal_file import JournalFile
from arcor2_server.documents.journal_records import Base, RecoveredDocument
from tests.server.session.test_journal_file import edit, numbers, reopened, scene

Jobs = Sequence[Edit | Base | None]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "journal.sqlite"


class Disk:
    """Records the commits of the journal, delays them or lets them fail."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.commits: list[Jobs] = []
        self.error: Exception | None = None
        self.ready = threading.Event()
        self.ready.set()
        real = JournalFile.commit

        def commit(file: JournalFile, jobs: Jobs) -> None:
            self.ready.wait(30)
            if self.error is not None:
                raise self.error
            self.commits.append(jobs)
            real(file, jobs)

        monkeypatch.setattr(JournalFile, "commit", commit)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(monkeypatch)


@pytest.fixture
async def journal(path: Path, disk: Disk) -> AsyncIterator[Journal]:
    journal = Journal(path)
    assert await journal.open() is None
    yield journal
    await journal.close()


async def test_jobs_are_stored_in_order(journal: Journal, path: Path) -> None:
    await journal.rebase(scene())
    await asyncio.gather(*(journal.append(edit(number)) for number in range(1, 50)))
    await journal.close()
    assert numbers(reopened(path)[0]) == list(range(1, 50))
    await journal.open()
    await journal.clear()
    await journal.close()
    assert reopened(path) == (None, None)


async def test_jobs_that_wait_are_stored_in_one_commit(journal: Journal, disk: Disk) -> None:
    await journal.rebase(scene())
    disk.ready.clear()
    first = journal.append(edit(1))
    while not journal._jobs.empty():
        await asyncio.sleep(0)
    others = [journal.append(edit(number)) for number in (2, 3, 4)]
    assert not first.done()
    disk.ready.set()
    await asyncio.gather(first, *others)
    assert [len(jobs) for jobs in disk.commits] == [1, 1, 3]


async def test_closing_stores_waiting_jobs(journal: Journal, path: Path, disk: Disk) -> None:
    disk.ready.clear()
    waiting = [journal.rebase(scene()), journal.append(edit(1))]
    closing = asyncio.create_task(journal.close())
    await asyncio.sleep(0)
    disk.ready.set()
    await closing
    await asyncio.gather(*waiting)
    assert numbers(reopened(path)[0]) == [1]
    with pytest.raises(StorageError, match="The journal is closed"):
        journal.append(edit(2))
    await journal.close()


async def test_a_journal_that_is_not_open_refuses_jobs(path: Path) -> None:
    with pytest.raises(StorageError, match="The journal is closed"):
        Journal(path).clear()


async def test_after_a_failure_jobs_fail_until_the_next_epoch(path: Path, disk: Disk) -> None:
    epochs: list[str] = []

    def failed() -> None:
        epochs.append("failed")
        journal.next_epoch()

    journal = Journal(path, failed)
    await journal.open()
    await journal.rebase(scene())
    disk.error = sqlite3.OperationalError("database or disk is full")
    disk.ready.clear()
    before = [journal.append(edit(number)) for number in (1, 2, 3)]
    disk.ready.set()
    results = await asyncio.gather(*before, return_exceptions=True)
    assert all(isinstance(result, StorageError) for result in results)
    assert str(path) in str(results[0])
    assert "disk is full" in str(results[0])
    assert epochs == ["failed"], "the edits are reverted once"
    disk.error = None
    await journal.append(edit(1))
    disk.error = OSError("no such device")
    with pytest.raises(StorageError, match="no such device"):
        await journal.append(edit(2))
    assert epochs == ["failed", "failed"]
    disk.error = None
    await journal.append(edit(2))
    await journal.close()
    assert numbers(reopened(path)[0]) == [1, 2]


async def test_without_a_next_epoch_nothing_more_is_stored(journal: Journal, disk: Disk) -> None:
    disk.error = OSError("no such device")
    with pytest.raises(StorageError):
        await journal.rebase(scene())
    disk.error = None
    with pytest.raises(StorageError, match="no such device"):
        await journal.append(edit(1))
    assert disk.commits == []
    journal.next_epoch()
    await journal.rebase(scene())
    assert len(disk.commits) == 1


async def test_a_caller_that_is_cancelled_does_not_stop_the_journal(journal: Journal, disk: Disk, path: Path) -> None:
    await journal.rebase(scene())
    disk.ready.clear()
    journal.append(edit(1)).cancel()
    later = journal.append(edit(2))
    disk.ready.set()
    await later
    await journal.close()
    assert numbers(reopened(path)[0]) == [1, 2]


async def test_the_error_names_an_unusable_file(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "missing" / "journal.sqlite")
    with pytest.raises(StorageError, match=r"The journal .*missing/journal\.sqlite cannot be used"):
        await journal.open()
    await journal.close()


async def test_recovered_documents_are_converted_and_losses_reported(path: Path, disk: Disk) -> None:
    journal = Journal(path)
    await journal.open()
    for job in (scene(), edit(1), edit(2), edit(3)):
        await (journal.rebase(job) if isinstance(job, Base) else journal.append(job))
    assert journal.loss is None
    await journal.close()
    with sqlite3.connect(path) as connection:
        connection.execute("delete from edit where number = 3")
    connection.close()

    def convert(found: RecoveredDocument) -> RecoveredDocument:
        return replace(found, edits=found.edits[:1])

    journal = Journal(path, convert=convert)
    found: Any = await journal.open()
    assert numbers(found) == [1]
    assert journal.loss is not None
    assert journal.loss.lost.text.startswith("Change 3 of scene 'cell' is lost")
    await journal.close()
