"""Stores the records of alarms in an SQLite file next to the journal, so that they do not depend on the database."""

import asyncio
import sqlite3
from collections.abc import Awaitable, Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar

import msgspec
import structlog
from sqlalchemy import delete, select

from arcor2_hw.data.alarms import AlarmRecord
from arcor2_hw.data.base import now
from arcor2_hw.exceptions import StorageError
from arcor2_hw.messages import Message
from arcor2_server.files import damaged_copy_path, ensure_private
from arcor2_server.storage.models import AlarmRow
from arcor2_server.storage.outbox import OutboxKind, Waiting, next_numbers
from arcor2_server.storage.store import Storage

log = structlog.get_logger(__name__)
R = TypeVar("R")

TAKEN_OVER: Final = 1
"""Version of the file (SQLite's user_version) that contains the records of older servers."""
_BUSY_TIMEOUT: Final = 5.0
_SCHEMA: Final = (
    "create table if not exists alarm (number integer primary key, document blob not null) strict",
    # Alarms that have to be sent to the fleet, each with the number of the transmission.
    "create table if not exists outbox (alarm integer primary key, number integer not null unique) strict",
)

_encode: Final = msgspec.json.Encoder().encode
_decode: Final = msgspec.json.Decoder(AlarmRecord).decode


class AlarmStore:
    """The stored records of alarms. All methods may raise StorageError.

    Args:
        path: the file.
        storage: the database, in which older servers have stored the records.
        sends: whether changed records have to be sent to the fleet; `outbox` contains them.
    """

    def __init__(self, path: Path, storage: Storage, *, sends: bool = False) -> None:
        self._path, self._storage = path, storage
        self.outbox = AlarmOutbox(self._in_thread, self._opened) if sends else None
        self._connection: sqlite3.Connection | None = None
        self._thread = ThreadPoolExecutor(1, "alarms")

    async def open(self) -> Message | None:
        """Open or create the file, and take over the records of the database once.

        Returns:
            A message about a damaged file, which was renamed; otherwise None.
        """
        problem = await self._in_thread(self._open)
        async with self._storage.reading() as session:
            rows = list(await session.execute(select(AlarmRow.number, AlarmRow.document)))
        await self._in_thread(self._take_over, [(row.number, row.document) for row in rows])
        if rows:
            async with self._storage.writing(documents=False) as session:
                await session.execute(delete(AlarmRow))
        return problem

    async def close(self) -> None:
        """Close the file."""
        await self._in_thread(self._close)
        self._thread.shutdown()

    async def all(self) -> list[AlarmRecord]:
        """Return all records, oldest first, without unreadable ones."""
        return await self._in_thread(self._all)

    async def put(self, records: Iterable[AlarmRecord], deleted: set[int]) -> None:
        """Store records, and delete those with the given numbers. They are on disk when this returns."""
        await self._in_thread(self._put, [(record.number, _encode(record)) for record in records], deleted)
        if self.outbox is not None:
            for notify in self.outbox.on_added:
                notify()

    # -------------------------------------------------------------------------------- in the thread
    async def _in_thread(self, function: Callable[..., R], *arguments: object) -> R:
        try:
            return await asyncio.get_running_loop().run_in_executor(self._thread, partial(function, *arguments))
        except (sqlite3.Error, OSError) as error:
            raise StorageError(
                "The records of alarms in {path} cannot be used: {reason}", path=self._path, reason=error
            ) from error

    def _open(self) -> Message | None:
        try:
            self._connect()
            return None
        except sqlite3.OperationalError:  # the file cannot be written, but it is not damaged
            raise
        except sqlite3.DatabaseError as error:
            self._close()
            stored = damaged_copy_path(self._path, now())
            for ending in ("", "-wal", "-shm"):
                if (part := self._path.with_name(self._path.name + ending)).exists():
                    part.rename(stored.with_name(stored.name + ending))
            self._connect(user_version=TAKEN_OVER)  # the records in the database are older
            return Message.of(
                "The records of alarms were damaged: {reason}. They are stored as {file}.",
                reason=error,
                file=stored.name,
            )

    def _connect(self, user_version: int | None = None) -> None:
        ensure_private(self._path)
        self._connection = connection = sqlite3.connect(
            self._path, timeout=_BUSY_TIMEOUT, isolation_level=None, check_same_thread=False
        )
        for pragma in ("journal_mode=wal", "synchronous=full"):
            connection.execute(f"pragma {pragma}")
        if (verdict := connection.execute("pragma quick_check(1)").fetchone()[0]) != "ok":
            raise sqlite3.DatabaseError(verdict)
        for statement in _SCHEMA:
            connection.execute(statement)
        if user_version is not None:
            connection.execute(f"pragma user_version={user_version}")

    def _close(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _opened(self) -> sqlite3.Connection:
        if self._connection is None:
            raise StorageError("The records of alarms are closed.")
        return self._connection

    def _take_over(self, rows: list[tuple[int, bytes]]) -> None:
        connection = self._opened()
        if connection.execute("pragma user_version").fetchone()[0] >= TAKEN_OVER:
            return
        with connection:
            connection.execute("begin immediate")
            connection.executemany("insert or ignore into alarm values (?, ?)", rows)
            connection.execute(f"pragma user_version={TAKEN_OVER}")

    def _all(self) -> list[AlarmRecord]:
        found = []
        for (document,) in self._opened().execute("select document from alarm order by number"):
            try:
                found.append(_decode(document))
            except msgspec.MsgspecError as error:
                log.warning("record of an alarm left out", reason=str(error))
        return found

    def _put(self, rows: list[tuple[int, bytes]], deleted: set[int]) -> None:
        connection = self._opened()
        with connection:
            connection.execute("begin immediate")
            connection.executemany("insert or replace into alarm values (?, ?)", rows)
            gone = [(number,) for number in deleted]
            connection.executemany("delete from alarm where number = ?", gone)
            connection.executemany("delete from outbox where alarm = ?", gone)
            if self.outbox is not None:
                self.outbox.add([number for number, _ in rows])


class AlarmOutbox:
    """The records that have to be sent, in the file of the alarms. A changed record replaces its earlier version.

    Args:
        in_thread: runs a function in the thread of the file.
        connection: returns the open file; called in this thread.
    """

    def __init__(self, in_thread: Callable[..., Awaitable[Any]], connection: Callable[[], sqlite3.Connection]) -> None:
        self._in_thread, self._connection = in_thread, connection
        self.on_added: list[Callable[[], None]] = []
        """Called after records were added."""

    def add(self, alarms: list[int]) -> None:
        """Add changed records within the transaction that stores them, in the thread of the file."""
        connection = self._connection()
        (last,) = connection.execute("select coalesce(max(number), 0) from outbox").fetchone()
        rows = zip(alarms, next_numbers(last, len(alarms)), strict=True)
        connection.executemany("insert or replace into outbox values (?, ?)", rows)

    async def count(self) -> int:
        """Return the number of waiting records."""
        (found,) = await self._query("select count(*) from outbox")
        return int(found[0])

    async def first(self, limit: int) -> list[Waiting]:
        """Return the records that wait longest."""
        query = "select o.number, document from outbox o join alarm a on a.number = o.alarm order by o.number limit ?"
        rows = await self._query(query, limit)
        return [Waiting(number, OutboxKind.ALARM, document) for number, document in rows]

    async def remove(self, numbers: Iterable[int]) -> None:
        """Remove records, because the broker has stored them."""
        removed = [(number,) for number in numbers]
        await self._in_thread(lambda: self._connection().executemany("delete from outbox where number = ?", removed))

    async def _query(self, query: str, *values: int) -> list[tuple[Any, ...]]:
        found: list[tuple[Any, ...]] = await self._in_thread(
            lambda: self._connection().execute(query, values).fetchall()
        )
        return found
