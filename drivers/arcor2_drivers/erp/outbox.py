"""Outbox: a file with the messages that the service has not accepted yet, and with the open orders."""

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

from arcor2_hw import messages
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
LOCK_PERIOD: Final = 0.02
"""Time between attempts to lock the file, s."""


class Message(NamedTuple):
    """A message to the service."""

    number: int
    key: str
    order_id: str
    path: str
    body: bytes


class Order(NamedTuple):
    """An open order of `quantity` pieces; the results of `reported` of them are stored."""

    id: str
    product: str
    quantity: int
    reported: int = 0


class OutboxState(Data, frozen=True):
    """Numbers of waiting and refused messages, time of the oldest waiting message, and the last delivery error."""

    waiting: int
    refused: int
    since: Timestamp | None = None
    last_error: str = ""


class RefusedMessage(NamedTuple):
    """A message that the service refused, when, and why."""

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
    """A file with the messages of one station to one service. One process at a time can open it.

    Every change is on disk when the method returns. Methods raise StorageError when the file cannot be read or written,
    NotConnected when it is closed.
    """

    def __init__(self, who: str | messages.Message, file: Path) -> None:
        self._who, self.file = who, file
        self._one = threading.Lock()
        self._database: sqlite3.Connection | None = None
        self._lock_file: IO[bytes] | None = None

    def open(self, patience: float = 0.0) -> None:
        """Open the file. Raises Refused when another program keeps it open for `patience` s."""
        deadline = time.monotonic() + patience
        with self._one:
            if self._database is not None:
                return
            try:
                self.file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
                self._lock_file = self.file.with_suffix(".lock").open("ab")
                self._lock(deadline)
                database = sqlite3.connect(self.file, check_same_thread=False, isolation_level=None)
            except BlockingIOError:
                self._release()
                raise Refused(
                    "{device}: another program has opened the outbox", str(self.file), device=self._who
                ) from None
            except (OSError, sqlite3.Error) as e:
                self._release()
                raise self._broken(e) from e
            self._database = database
            try:
                if database.execute("PRAGMA user_version").fetchone()[0] not in (0, _VERSION):
                    raise sqlite3.DatabaseError("it was written by a newer version of this software")
                database.execute("PRAGMA journal_mode = WAL")
                database.execute("PRAGMA synchronous = FULL")
                database.executescript(_SCHEMA)
            except sqlite3.Error as e:
                self._close()
                raise self._broken(e) from e

    def _lock(self, deadline: float) -> None:
        """Lock the file. A sender that was just stopped may keep it until its last request ends."""
        assert self._lock_file is not None
        while True:
            try:
                fcntl.flock(self._lock_file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if time.monotonic() >= deadline:
                    raise
                time.sleep(LOCK_PERIOD)
            else:
                return

    def close(self) -> None:
        """Close the file; does nothing when closed. Waiting messages stay on disk."""
        with self._one:
            self._close()

    def _close(self) -> None:
        if self._database is not None:
            self._database.close()
            self._database = None
        self._release()

    def _release(self) -> None:
        if self._lock_file is not None:
            self._lock_file.close()
            self._lock_file = None

    def _broken(self, error: Exception) -> StorageError:
        return StorageError(
            "{device}: the outbox cannot be read or written: {reason}", str(self.file), device=self._who, reason=error
        )

    @contextlib.contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """Run a transaction; it is on disk when the context ends."""
        with self._reading() as database:
            database.execute("BEGIN IMMEDIATE")
            try:
                yield database
                database.execute("COMMIT")
            except BaseException:
                if database.in_transaction:
                    database.execute("ROLLBACK")
                raise

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
    def add(self, path: str, order_id: str, body: bytes, *, piece: bool = False, last: bool = False) -> None:
        """Store a message.

        Args:
            path: Path of the request, from the service's URL.
            order_id: Order that the message belongs to.
            body: Body of the request.
            piece: Whether it reports a piece of the order.
            last: Whether the order ends with it.
        """
        with self._writing() as database:
            database.execute(
                "INSERT INTO message (key, order_id, path, body, stored) VALUES (?, ?, ?, ?, ?)",
                (uuid.uuid4().hex, order_id, path, body, now()),
            )
            if piece:
                database.execute("UPDATE open_order SET reported = reported + 1 WHERE id = ?", (order_id,))
                database.execute("DELETE FROM open_order WHERE id = ? AND reported >= quantity", (order_id,))
            if last:
                database.execute("DELETE FROM open_order WHERE id = ?", (order_id,))

    def heads(self) -> list[Message]:
        """Return the first waiting message of each order, oldest first."""
        with self._reading() as database:
            rows = database.execute(
                "SELECT number, key, order_id, path, body FROM message WHERE number IN "
                "(SELECT min(number) FROM message WHERE state = 'waiting' GROUP BY order_id) ORDER BY number"
            ).fetchall()
        return [Message(*row) for row in rows]

    def delivered(self, message: Message) -> None:
        """Delete a message that the service has accepted."""
        with self._writing() as database:
            database.execute("DELETE FROM message WHERE number = ?", (message.number,))

    def mark_refused(self, message: Message, reason: str) -> None:
        """Mark a message as refused by the service. It is sent again only after `resend_refused`."""
        with self._writing() as database:
            database.execute(
                "UPDATE message SET state = 'refused', why = ?, since = ? WHERE number = ?",
                (reason, now(), message.number),
            )

    def resend_refused(self) -> int:
        """Queue the refused messages for delivery again, with the same keys. Return their number."""
        with self._writing() as database:
            return database.execute("UPDATE message SET state = 'waiting' WHERE state = 'refused'").rowcount

    def acknowledge_refused(self) -> int:
        """Mark refused messages as acknowledged; they stay in the file. Return their number."""
        with self._writing() as database:
            return database.execute("UPDATE message SET state = 'noted' WHERE state = 'refused'").rowcount

    def refused(self) -> list[RefusedMessage]:
        """Return the refused messages."""
        with self._reading() as database:
            rows = database.execute(
                "SELECT key, order_id, body, since, why FROM message WHERE state = 'refused' ORDER BY number"
            ).fetchall()
        return [RefusedMessage(key, order, body.decode(), since, why) for key, order, body, since, why in rows]

    def state(self, last_error: str) -> OutboxState:
        """Return the state of the outbox."""
        with self._reading() as database:
            waiting, since = database.execute(
                "SELECT count(*), min(stored) FROM message WHERE state = 'waiting'"
            ).fetchone()
            (refused,) = database.execute("SELECT count(*) FROM message WHERE state = 'refused'").fetchone()
        return OutboxState(waiting, refused, since, last_error)

    # -------------------------------------------------------------------------------- orders
    def order(self) -> Order | None:
        """Return the oldest order that is not reported completely."""
        with self._reading() as database:
            row = database.execute(
                "SELECT id, product, quantity, reported FROM open_order ORDER BY taken, rowid LIMIT 1"
            ).fetchone()
        return None if row is None else Order(*row)

    def request_key(self) -> str:
        """Return the key for requesting an order. It stays the same until `end_request`."""
        with self._writing() as database:
            row = database.execute("SELECT key FROM asking").fetchone()
            key: str = uuid.uuid4().hex if row is None else row[0]
            if row is None:
                database.execute("INSERT INTO asking VALUES (?)", (key,))
        return key

    def end_request(self, order: Order | None) -> None:
        """Store the order that the service returned, if any; the next request has a new key."""
        with self._writing() as database:
            database.execute("DELETE FROM asking")
            if order is not None:
                database.execute(
                    "INSERT OR IGNORE INTO open_order (id, product, quantity, taken) VALUES (?, ?, ?, ?)",
                    (order.id, order.product, order.quantity, now()),
                )
