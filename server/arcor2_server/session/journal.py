"""Edits of the open document on disk before they are acknowledged; what a restart goes on with."""

import asyncio
import queue
import sqlite3
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any, Final

import msgspec
import structlog
from msgspec import UNSET

from arcor2_hw.data.base import now
from arcor2_hw.data.project import BareProject
from arcor2_hw.data.scene import BareScene
from arcor2_hw.exceptions import StorageError
from arcor2_server.session.changes import (
    Edit,
    How,
    Item,
    decode_changes,
    decode_items,
    encode_changes,
    encode_items,
)

log = structlog.get_logger(__name__)

FORMAT: Final = 2
"""Version of the file, kept in SQLite's user_version; a newer one is set aside as a damaged file is."""

CHECKPOINT_PAGES: Final = 200
"""Pages of the write-ahead log that are written before it starts again at its beginning."""

BUSY_TIMEOUT: Final = 5.0
"""Seconds to wait for another process that has the file (a server that is just ending)."""

ALL: Final = 2**63 - 1
"""As `Base.forget`: drop all edits, those of another document too."""

_SCHEMA: Final = """
create table base (id integer primary key check (id = 1), items blob not null, edit integer not null,
                   scene_times text not null, project_times text not null) strict;
create table edit (number integer primary key, time text not null, user text not null, changes blob not null,
                   request text not null default '', how text not null default 'edit', target integer not null default 0
                  ) strict;
"""

_FROM_1: Final = """
alter table edit add column request text not null default '';
alter table edit add column how text not null default 'edit';
alter table edit add column target integer not null default 0;
"""
"""Format 1 did not keep why an edit was made."""


class Times(msgspec.Struct, frozen=True):
    """When a document was created, saved, and changed after it was saved; empty where it was not."""

    created: str = ""
    modified: str = ""
    changed: str = ""

    @classmethod
    def of(cls, document: BareScene | BareProject) -> "Times":
        """Take the times of a scene or project."""
        return cls(document.created or "", document.modified or "", document.int_modified or "")

    @property
    def unsaved(self) -> bool:
        """Whether there is anything that is not saved."""
        return not self.modified or bool(self.changed)

    def fields(self) -> dict[str, Any]:
        """Give the times as fields of a scene or project."""
        return {
            "created": self.created or UNSET,
            "modified": self.modified or UNSET,
            "int_modified": self.changed or UNSET,
        }


class Recovered(msgspec.Struct, frozen=True):
    """What the journal held: the document as `items` after edit `number`, and all edits that are kept."""

    items: list[Item]
    number: int
    scene: Times
    project: Times
    edits: list[Edit]


class Base(msgspec.Struct, frozen=True):
    """A whole document to begin with: its items after edit `number`; edits up to `forget` are dropped."""

    items: list[Item]
    number: int
    scene: Times
    project: Times
    forget: int


_Job = tuple[Edit | Base | None, int, "asyncio.Future[None]"]


class Journal:
    """One thread with one SQLite file. Jobs that wait together go to the disk in one commit, in order.

    After a failure all jobs of the same epoch fail, those that come later too: what they build on is not kept.
    `on_failure` is called in the event loop before the waiting callers get their StorageError; it has to take the
    edits back and to begin a new epoch (`next_epoch`).
    """

    def __init__(self, path: Path, on_failure: Callable[[], None] = lambda: None) -> None:
        self._path = path
        self._on_failure = on_failure
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._epoch = 0
        self._failed_epoch = -1
        self._failure = StorageError()

    # ------------------------------------------------------------------------------------------ life
    async def open(self) -> Recovered | None:
        """Start; gives what an earlier server left open. A damaged file is set aside.

        Raises StorageError when the directory cannot be written.
        """
        self._loop = asyncio.get_running_loop()
        started: asyncio.Future[Recovered | None] = self._loop.create_future()
        self._thread = threading.Thread(target=self._run, args=(started,), name="journal", daemon=True)
        self._thread.start()
        return await started

    async def close(self) -> None:
        """Write what waits, and end the thread."""
        if self._thread is not None:
            self._jobs.put(None)
            await asyncio.to_thread(self._thread.join)
            self._thread = None

    # ------------------------------------------------------------------------------------------ jobs
    def append(self, edit: Edit) -> "asyncio.Future[None]":
        """Put an edit at the end; the future is done when it is on the disk."""
        return self._put(edit)

    def rebase(self, base: Base) -> "asyncio.Future[None]":
        """Begin with another document, or with the same one at a later edit."""
        return self._put(base)

    def clear(self) -> "asyncio.Future[None]":
        """Forget everything: nothing is open."""
        return self._put(None)

    def next_epoch(self) -> None:
        """Go on after a failure."""
        self._epoch += 1

    def _put(self, job: Edit | Base | None) -> "asyncio.Future[None]":
        if self._loop is None or self._thread is None:
            raise StorageError("The journal is closed.")
        done: asyncio.Future[None] = self._loop.create_future()
        self._jobs.put((job, self._epoch, done))
        return done

    # ------------------------------------------------------------------------------------------ the thread
    def _run(self, started: "asyncio.Future[Recovered | None]") -> None:
        assert self._loop is not None
        try:
            connection, recovered = _open(self._path)
        except (sqlite3.Error, OSError) as error:
            failure = StorageError(f"The journal {self._path} cannot be used: {error}.")
            self._loop.call_soon_threadsafe(_resolve, started, None, failure)
            return
        with closing(connection):
            self._loop.call_soon_threadsafe(_resolve, started, recovered, None)
            _extend_log(connection)
            ending = False
            while not ending:
                batch = [self._jobs.get()]
                while not self._jobs.empty():
                    batch.append(self._jobs.get())
                ending = None in batch
                self._write_batch(connection, [job for job in batch if job is not None])

    def _write_batch(self, connection: sqlite3.Connection, batch: list[_Job]) -> None:
        assert self._loop is not None
        late = [done for _, epoch, done in batch if epoch <= self._failed_epoch]
        if late:
            self._loop.call_soon_threadsafe(self._finish, late, self._failure, None)
        live = [job for job in batch if job[1] > self._failed_epoch]
        if not live:
            return
        futures = [done for _, _, done in live]
        try:
            if len(live) == 1 and isinstance(live[0][0], Edit):
                _write(connection, live[0][0])  # one statement is a transaction of its own
            else:
                # One transaction for all that waited: one wait for the disk.
                with connection:
                    connection.execute("begin immediate")
                    for job, _, _ in live:
                        _write(connection, job)
        except (sqlite3.Error, OSError) as error:
            self._failed_epoch = live[-1][1]
            self._failure = StorageError(f"The change could not be kept, {self._path} cannot be written: {error}.")
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
        return  # whoever waited was cancelled
    if error is None:
        future.set_result(result)
    else:
        future.set_exception(error)


def _write(connection: sqlite3.Connection, job: Edit | Base | None) -> None:
    match job:
        case Edit(number, time, user, changes, request, how, of):
            row = (number, time, user, encode_changes(changes), request, how.value, of)
            connection.execute("insert into edit values (?, ?, ?, ?, ?, ?, ?)", row)
        case Base(items, number, scene, project, forget):
            times = (msgspec.json.encode(scene).decode(), msgspec.json.encode(project).decode())
            whole = (encode_items(items), number, *times)
            connection.execute("insert or replace into base values (1, ?, ?, ?, ?)", whole)
            connection.execute("delete from edit where number <= ?", (forget,))
        case None:
            connection.execute("delete from base")
            connection.execute("delete from edit")


# ---------------------------------------------------------------------------------------------- opening the file
_DAMAGED: Final = frozenset({sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR})
"""What SQLite says of a file that is none of ours; anything else (no right, no space, locked) is told to the user."""


def _open(path: Path) -> tuple[sqlite3.Connection, Recovered | None]:
    connection = sqlite3.connect(path, timeout=BUSY_TIMEOUT, isolation_level=None, check_same_thread=False)
    try:
        return connection, _recover(connection)
    except sqlite3.OperationalError as error:
        connection.close()
        if error.sqlite_errorcode & 0xFF not in _DAMAGED:
            raise
        reason = str(error)
    except (sqlite3.DatabaseError, msgspec.DecodeError, ValueError, _WrongFormat) as error:
        connection.close()
        reason = str(error)
    except BaseException:
        connection.close()
        raise
    aside = _set_aside(path)
    log.error("the journal is damaged and was set aside: unsaved changes are lost", kept_as=str(aside), reason=reason)
    connection = sqlite3.connect(path, timeout=BUSY_TIMEOUT, isolation_level=None, check_same_thread=False)
    try:
        return connection, _recover(connection)
    except BaseException:
        connection.close()
        raise


class _WrongFormat(Exception):
    pass


def _recover(connection: sqlite3.Connection) -> Recovered | None:
    # One owner: a second server on the same directory is refused, and no shared memory file is needed.
    connection.execute("pragma locking_mode = exclusive")
    connection.execute("pragma journal_mode = wal")
    connection.execute("pragma synchronous = full")
    connection.execute(f"pragma wal_autocheckpoint = {CHECKPOINT_PAGES}")
    (version,) = connection.execute("pragma user_version").fetchone()
    if version == 0:
        connection.executescript(f"begin immediate; {_SCHEMA} pragma user_version = {FORMAT}; commit;")
        return None
    if version not in (1, FORMAT):
        raise _WrongFormat(f"format {version} is not {FORMAT}")
    (check,) = connection.execute("pragma quick_check(1)").fetchone()
    if check != "ok":
        raise _WrongFormat(check)
    if version == 1:
        connection.executescript(f"begin immediate; {_FROM_1} pragma user_version = {FORMAT}; commit;")
    row = connection.execute("select items, edit, scene_times, project_times from base").fetchone()
    if row is None:
        return None
    columns = "number, time, user, changes, request, how, target"
    rows = connection.execute(f"select {columns} from edit order by number").fetchall()  # noqa: S608
    edits = [
        Edit(number, time, user, decode_changes(changes), request, How(how), of)
        for number, time, user, changes, request, how, of in rows
    ]
    following = [edit.number for edit in edits if edit.number > row[1]]
    if following != list(range(row[1] + 1, row[1] + 1 + len(following))):
        raise _WrongFormat("an edit is missing")
    scene, project = (msgspec.json.decode(text, type=Times) for text in row[2:])
    return Recovered(decode_items(row[0]), row[1], scene, project, edits)


def _extend_log(connection: sqlite3.Connection) -> None:
    """Write as much of the log as is used between checkpoints.

    A commit that overwrites takes the disk half as long as one by which the file grows (0.12 ms to 0.24 ms).
    """
    try:
        with connection:
            connection.execute("begin immediate")
            connection.execute("drop table if exists extent")  # of a server that was killed just here
            connection.execute("create table extent (content blob)")
            connection.execute("insert into extent values (zeroblob(?))", (CHECKPOINT_PAGES * 4096,))
        with connection:
            connection.execute("drop table extent")
        connection.execute("pragma wal_checkpoint(restart)").fetchall()
    except sqlite3.Error as error:
        log.warning("no room ahead for the journal", error=str(error))


def _set_aside(path: Path) -> Path:
    stamp = now().replace(":", "").replace("-", "").partition(".")[0]
    aside = path.with_name(f"{path.stem}.damaged-{stamp}{path.suffix}")
    number = 1
    while aside.exists():
        number += 1
        aside = path.with_name(f"{path.stem}.damaged-{stamp}-{number}{path.suffix}")
    for ending in ("", "-wal", "-shm"):
        part = path.with_name(path.name + ending)
        if part.exists():
            part.rename(aside.with_name(aside.name + ending))
    return aside
