"""Writes edits to the disk before they are acknowledged, and restores them after a restart."""

import asyncio
import queue
import sqlite3
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import structlog

from arcor2_hw.exceptions import StorageError
from arcor2_server.documents.changes import Edit
from arcor2_server.documents.journal_file import JournalFile
from arcor2_server.documents.journal_records import Base, JournalLoss, RecoveredDocument

log = structlog.get_logger(__name__)

_Job = tuple[Edit | Base | None, int, "asyncio.Future[None]"]


class Journal:
    """The journal of the open document: a thread with one file. Waiting jobs are written in one commit, in order.

    After a failure all jobs of the same epoch fail, also later ones, because they depend on the lost edits.

    Args:
        path: The SQLite file.
        on_failure: Called in the event loop before the callers get their StorageError. It has to revert the edits
            and to start a new epoch.
        convert: Changes the restored content; called by the thread.
    """

    def __init__(
        self,
        path: Path,
        on_failure: Callable[[], None] = lambda: None,
        convert: Callable[[RecoveredDocument], RecoveredDocument] = lambda found: found,
    ) -> None:
        self._path = path
        self._convert = convert
        self._on_failure = on_failure
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._epoch = 0
        self._failed_epoch = -1
        self._failure = StorageError()
        self.loss: JournalLoss | None = None

    async def open(self) -> RecoveredDocument | None:
        """Start the thread, and return the document that an earlier server left open. `loss` describes damage.

        Raises:
            StorageError: The file cannot be read or written.
        """
        self._loop = asyncio.get_running_loop()
        started: asyncio.Future[RecoveredDocument | None] = self._loop.create_future()
        self._thread = threading.Thread(target=self._run, args=(started,), name="journal", daemon=True)
        self._thread.start()
        return await started

    async def close(self) -> None:
        """Write the waiting jobs, and stop the thread."""
        if self._thread is not None:
            self._jobs.put(None)
            await asyncio.to_thread(self._thread.join)
            self._thread = None

    # ------------------------------------------------------------------------------------------ jobs
    def append(self, edit: Edit) -> "asyncio.Future[None]":
        """Append an edit; the future is done when it is on the disk."""
        return self._put(edit)

    def rebase(self, base: Base) -> "asyncio.Future[None]":
        """Replace the base document of the edits by another document, or by its state after a later edit."""
        return self._put(base)

    def clear(self) -> "asyncio.Future[None]":
        """Delete everything, since no document is open."""
        return self._put(None)

    def next_epoch(self) -> None:
        """Accept jobs again after a failure."""
        self._epoch += 1

    def _put(self, job: Edit | Base | None) -> "asyncio.Future[None]":
        if self._loop is None or self._thread is None:
            raise StorageError("The journal is closed.")
        done: asyncio.Future[None] = self._loop.create_future()
        self._jobs.put((job, self._epoch, done))
        return done

    # ------------------------------------------------------------------------------------------ the thread
    def _run(self, started: "asyncio.Future[RecoveredDocument | None]") -> None:
        assert self._loop is not None
        with closing(JournalFile(self._path, self._convert)) as file:
            try:
                recovered, self.loss = file.open()
            except (sqlite3.Error, OSError, StorageError) as error:
                failure = StorageError("The journal {path} cannot be used: {reason}.", path=self._path, reason=error)
                self._loop.call_soon_threadsafe(_resolve, started, None, failure)
                return
            self._loop.call_soon_threadsafe(_resolve, started, recovered, None)
            file.extend_log()
            stopped = False
            while not stopped:
                batch = [self._jobs.get()]
                while not self._jobs.empty():
                    batch.append(self._jobs.get())
                stopped = None in batch
                self._write_batch(file, [job for job in batch if job is not None])

    def _write_batch(self, file: JournalFile, batch: list[_Job]) -> None:
        assert self._loop is not None
        refused = [done for _, epoch, done in batch if epoch <= self._failed_epoch]
        if refused:
            self._loop.call_soon_threadsafe(self._finish, refused, self._failure, None)
        accepted = [job for job in batch if job[1] > self._failed_epoch]
        if not accepted:
            return
        futures = [done for _, _, done in accepted]
        try:
            file.commit([job for job, _, _ in accepted])
        except (sqlite3.Error, OSError) as error:
            self._failed_epoch = accepted[-1][1]
            self._failure = StorageError(
                "The change could not be stored, {path} cannot be written: {reason}.", path=self._path, reason=error
            )
            log.error("journal cannot be written", path=str(self._path), error=str(error))
            self._loop.call_soon_threadsafe(self._finish, futures, self._failure, self._failed_epoch)
        else:
            self._loop.call_soon_threadsafe(self._finish, futures, None, None)

    def _finish(self, futures: "list[asyncio.Future[None]]", error: StorageError | None, epoch: int | None) -> None:
        if epoch is not None and epoch == self._epoch:
            self._on_failure()
        for future in futures:
            _resolve(future, None, error)


def _resolve(future: "asyncio.Future[Any]", result: Any, error: Exception | None) -> None:
    if future.done():
        return  # cancelled by the caller
    if error is None:
        future.set_result(result)
    else:
        future.set_exception(error)
