"""The stored outbox: what the service has to get, on disk before anybody is told that it is; and the orders at hand."""

import contextlib
import fcntl
import hashlib
import os
import sqlite3
import threading
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Final, NamedTuple

from arcor2_hw.data.base import Data, Timestamp, now
from arcor2_hw.exceptions import NotConnected, Refused, StorageError

_SCHEMA: Final = """
CREATE TABLE IF NOT EXISTS message (
    number INTEGER PRIMARY KEY AUTOINCREMENT, key TEXT NOT NULL UNIQUE, order_id TEXT NOT NULL, path TEXT NOT NULL,
    body BLOB NOT NULL, stored TEXT NOT NULL, state TEXT NOT NULL DEFAULT 'waiting', why TEXT NOT NULL DEFAULT '',
    since TEXT NOT NULL DEFAULT '');
CREATE INDEX IF NOT EXISTS message_state ON message (state, number);
CREATE TABLE IF NOT EXISTS open_order (
    id TEXT PRIMARY KEY, product TEXT NOT NULL, quantity INTEGER NOT NULL, reported INTEGER NOT NULL DEFAULT 0,
    taken TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS asking (key TEXT PRIMARY KEY);
PRAGMA user_version = 1;
"""
_VERSION: Final = 1
LOOK_AGAIN: Final = 0.02
"""Time between looks whether the file is free, s."""


class Message(NamedTuple):
    """One thing the service has to get."""

    number: int
    key: str
    order_id: str
    path: str
    body: bytes


class Order(NamedTuple):
    """An order at hand: of `quantity` pieces `reported` have their result stored."""

    id: str
    product: str
    quantity: int
    reported: int = 0


class OutboxState(Data, frozen=True):
    """How the outbox is: so many wait, the oldest since then; so many were refused and are kept aside."""

    waiting: int
    refused: int
    since: Timestamp | None = None
    last_error: str = ""


class Aside(NamedTuple):
    """What the service has refused, when, and in which words."""

    key: str
    order_id: str
    body: str
    since: Timestamp
    why: str


def file_of(directory: str, station: str, url: str) -> Path:
    """Return the outbox's file: one per station and service, so that no result goes to another service."""
    if directory:
        folder = Path(directory).expanduser()
    else:
        base = os.environ.get("XDG_DATA_HOME", "")
        folder = (Path(base) if base.startswith("/") else Path.home() / ".local" / "share") / "arcor2-hw" / "outbox"
    return folder / f"{station}-{hashlib.sha256(url.encode()).hexdigest()[:12]}.sqlite"


class Outbox:
    """A file with the messages of one station to one service; held by one process at a time.

    Whatever returns has been written through to the disk. Raises StorageError naming device and file.
    """

    def __init__(self, who: str, file: Path) -> None:
        self._who, self.file = who, file
        self._one = threading.Lock()
        self._database: sqlite3.Connection | None = None
        self._held: IO[bytes] | None = None

    def open(self, patience: float = 0.0) -> None:
        """Open. Raises Refused when another program has it open, and does not end within `patience` s."""
        deadline = time.monotonic() + patience
        with self._one:
            if self._database is not None:
                return
            try:
                self.file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
                self._held = self.file.with_suffix(".lock").open("ab")
                self._lock(deadline)
                database = sqlite3.connect(self.file, check_same_thread=False, isolation_level=None)
            except BlockingIOError:
                self._release()
                raise Refused(
                    "{device}: its outbox is open in another program", str(self.file), device=self._who
                ) from None
            except (OSError, sqlite3.Error) as e:
                self._release()
                raise self._broken(e) from e
            self._database = database
            try:
                if database.execute("PRAGMA user_version").fetchone()[0] not in (0, _VERSION):
                    raise sqlite3.DatabaseError("it was written by a later version")
                database.execute("PRAGMA journal_mode = WAL")
                database.execute("PRAGMA synchronous = FULL")
                database.executescript(_SCHEMA)
            except sqlite3.Error as e:
                self._close()
                raise self._broken(e) from e

    def _lock(self, deadline: float) -> None:
        """Have the file alone: who closed it just now may still wait for the answer to a last request."""
        assert self._held is not None
        while True:
            try:
                fcntl.flock(self._held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if time.monotonic() >= deadline:
                    raise
                time.sleep(LOOK_AGAIN)
            else:
                return

    def close(self) -> None:
        """Close; does nothing when closed. What waits stays on disk."""
        with self._one:
            self._close()

    def _close(self) -> None:
        if self._database is not None:
            self._database.close()
            self._database = None
        self._release()

    def _release(self) -> None:
        if self._held is not None:
            self._held.close()
            self._held = None

    def _broken(self, error: Exception) -> StorageError:
        return StorageError(
            "{device}: its outbox cannot be read or written: {reason}", str(self.file), device=self._who, reason=error
        )

    @contextlib.contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """Have a transaction that is on disk when it ends."""
        with self._one:
            if self._database is None:
                raise NotConnected("{device} is not connected", device=self._who)
            try:
                self._database.execute("BEGIN IMMEDIATE")
                try:
                    yield self._database
                    self._database.execute("COMMIT")
                except BaseException:
                    if self._database.in_transaction:
                        self._database.execute("ROLLBACK")
                    raise
            except sqlite3.Error as e:
                raise self._broken(e) from e

    @contextlib.contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        with self._one:
            if self._database is None:
                raise NotConnected("{device} is not connected", device=self._who)
            try:
                yield self._database
            except sqlite3.Error as e:
                raise self._broken(e) from e

    # -------------------------------------------------------------------------------- messages
    def add(self, path: str, order_id: str, body: bytes, *, piece: bool = False, last: bool = False) -> str:
        """Store a message and give its key. `piece`: it counts as one of its order; `last`: the order ends with it."""
        key = uuid.uuid4().hex
        with self._writing() as database:
            database.execute(
                "INSERT INTO message (key, order_id, path, body, stored) VALUES (?, ?, ?, ?, ?)",
                (key, order_id, path, body, now()),
            )
            if piece:
                database.execute("UPDATE open_order SET reported = reported + 1 WHERE id = ?", (order_id,))
                database.execute("DELETE FROM open_order WHERE id = ? AND reported >= quantity", (order_id,))
            if last:
                database.execute("DELETE FROM open_order WHERE id = ?", (order_id,))
        return key

    def heads(self) -> list[Message]:
        """Return the first waiting message of each order, the oldest first."""
        with self._reading() as database:
            rows = database.execute(
                "SELECT number, key, order_id, path, body FROM message WHERE number IN "
                "(SELECT min(number) FROM message WHERE state = 'waiting' GROUP BY order_id) ORDER BY number"
            ).fetchall()
        return [Message(*row) for row in rows]

    def delivered(self, message: Message) -> None:
        """Forget a message: the service has it."""
        with self._writing() as database:
            database.execute("DELETE FROM message WHERE number = ?", (message.number,))

    def put_aside(self, message: Message, why: str) -> None:
        """Keep a message that the service refused; it is not sent again by itself."""
        with self._writing() as database:
            database.execute(
                "UPDATE message SET state = 'refused', why = ?, since = ? WHERE number = ?",
                (why, now(), message.number),
            )

    def send_aside_again(self) -> int:
        """Have what was refused sent again, under the same keys; give how many."""
        with self._writing() as database:
            return database.execute("UPDATE message SET state = 'waiting' WHERE state = 'refused'").rowcount

    def note_aside(self) -> int:
        """Note that somebody has dealt with what was refused; it stays in the file. Give how many."""
        with self._writing() as database:
            return database.execute("UPDATE message SET state = 'noted' WHERE state = 'refused'").rowcount

    def aside(self) -> list[Aside]:
        """Return what was refused."""
        with self._reading() as database:
            rows = database.execute(
                "SELECT key, order_id, body, since, why FROM message WHERE state = 'refused' ORDER BY number"
            ).fetchall()
        return [Aside(key, order, body.decode(), since, why) for key, order, body, since, why in rows]

    def state(self, last_error: str) -> OutboxState:
        """Return how many wait, and since when."""
        with self._reading() as database:
            waiting, since = database.execute(
                "SELECT count(*), min(stored) FROM message WHERE state = 'waiting'"
            ).fetchone()
            (refused,) = database.execute("SELECT count(*) FROM message WHERE state = 'refused'").fetchone()
        return OutboxState(waiting, refused, since, last_error)

    # -------------------------------------------------------------------------------- orders
    def order(self) -> Order | None:
        """Return the oldest order that is not all reported."""
        with self._reading() as database:
            row = database.execute(
                "SELECT id, product, quantity, reported FROM open_order ORDER BY taken, rowid LIMIT 1"
            ).fetchone()
        return None if row is None else Order(*row)

    def asking(self) -> str:
        """Return the key to ask for an order with: the same until it was answered."""
        with self._writing() as database:
            row = database.execute("SELECT key FROM asking").fetchone()
            key: str = uuid.uuid4().hex if row is None else row[0]
            if row is None:
                database.execute("INSERT INTO asking VALUES (?)", (key,))
        return key

    def answered(self, order: Order | None) -> None:
        """Note the answer: an order to be worked at, or None."""
        with self._writing() as database:
            database.execute("DELETE FROM asking")
            if order is not None:
                database.execute(
                    "INSERT OR IGNORE INTO open_order (id, product, quantity, taken) VALUES (?, ?, ?, ?)",
                    (order.id, order.product, order.quantity, now()),
                )
