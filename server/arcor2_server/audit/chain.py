"""The file of the audit trail: entries chained by digests, so that a removed or edited entry is noticed.

The digest of an entry covers its content and the digest of the entry before it. A small second file, the head, states
the number and digest of the newest entry, so that entries removed at the end are noticed too. A user who may write
both files can replace the whole chain. Compare with an exported digest to detect that.
"""

import hashlib
import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.data.audit import AuditChange, AuditCheck, AuditEntry, AuditQuery
from arcor2_hw.exceptions import StorageError
from arcor2_server.files import FILE_MODE, ensure_private

log = structlog.get_logger(__name__)

HEAD: Final = ".head"
"""Suffix of the name of the second file."""
LIMIT: Final = 200_000
"""Maximum number of entries in the file."""
_PRUNED_AT_ONCE: Final = 10_000
"""Number of entries above the limit at which the oldest are deleted."""
_HEAD_SIZE: Final = 96
"""Length of the head, bytes. Shorter content is padded, so that it is overwritten in one write."""
_BUSY_TIMEOUT: Final = 5.0
"""Time to wait for a lock of the file, s: another process may read it."""
_NO_DIGEST: Final = bytes(32)
"""Digest before the first entry."""
_UNREADABLE: Final = b"unreadable"
"""Placeholder for the digest of a damaged head."""
_FIELDS: Final = tuple(field.name for field in msgspec.structs.fields(AuditEntry))
_COLUMNS: Final = ", ".join(_FIELDS)
_SCHEMA: Final = """
create table if not exists entry (
    number integer primary key, time text not null, outcome text not null, request text not null, target text not null,
    user text not null, role text not null, address text not null, reason text not null, changes text not null,
    digest blob not null
);
create table if not exists pruned (number integer not null, digest blob not null);
"""

Row = tuple[int, str, str, str, str, str, str, str, str, str]
"""The fields of an entry, with its changes as JSON."""
_decode_changes = msgspec.json.Decoder(list[AuditChange]).decode
_INSERT: Final = f"insert into entry ({_COLUMNS}, digest) values ({', '.join('?' * (len(_FIELDS) + 1))})"  # noqa: S608


def row_of(entry: AuditEntry) -> Row:
    """Return the row of an entry."""
    changes = msgspec.json.encode(entry.changes).decode() if entry.changes else ""
    return (
        *(entry.number, entry.time, entry.outcome.value, entry.request, entry.target),
        *(entry.user, entry.role, entry.address, entry.reason, changes),
    )


def _entry_of(row: Row) -> AuditEntry:
    fields = dict(zip(_FIELDS, row, strict=True))
    return msgspec.convert(fields | {"changes": _decode_changes(row[-1]) if row[-1] else []}, AuditEntry)


def _digest_after(previous: bytes, row: Row) -> bytes:
    """Return the digest of an entry that follows an entry with the digest `previous`."""
    return hashlib.sha256(previous + msgspec.json.encode(row)).digest()


class AuditFile:
    """The file of the audit trail. Several processes may write and read it, each with one thread that writes.

    Raises:
        StorageError: each method, if the file cannot be used.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.last = 0
        """Number of the newest entry."""
        self._head = path.with_name(path.name + HEAD)
        self._digest = _NO_DIGEST
        self._connection: sqlite3.Connection | None = None
        self._descriptor = -1

    # ------------------------------------------------------------------------------------------ writing
    def open(self) -> None:
        """Open the file for writing, and create it if it is missing."""
        try:
            ensure_private(self.path)
            ensure_private(self._head)
            # The thread that writes is not the one that opens the file; never do both at the same time.
            self._connection = sqlite3.connect(
                self.path, timeout=_BUSY_TIMEOUT, isolation_level=None, check_same_thread=False
            )
            for pragma in ("journal_mode=wal", "synchronous=full"):
                self._connection.execute(f"pragma {pragma}")
            self._connection.executescript(_SCHEMA)
            self.last, self._digest = _newest(self._connection)
            self._descriptor = os.open(self._head, os.O_WRONLY | os.O_CLOEXEC, FILE_MODE)
        except (sqlite3.Error, OSError) as error:
            self.close()
            raise _unusable(self.path, error) from error

    def require_head(self) -> None:
        """Raise StorageError if entries were removed at the end, so that a new entry does not hide that."""
        number, digest = self._read_head()
        if number > self.last or (number == self.last and digest != self._digest) or digest == _UNREADABLE:
            raise _unusable(self.path, RuntimeError(f"it was edited: the newest entry is not {number}"))

    def append(self, entries: Sequence[AuditEntry]) -> None:
        """Write entries to the disk, with the next numbers."""
        assert self._connection is not None
        try:
            with self._connection:
                self._connection.execute("begin immediate")
                number, digest = _newest(self._connection)
                if number <= self.last:  # no other process has written; removed and edited entries stay noticeable
                    number, digest = self.last, self._digest
                for number, entry in enumerate(entries, number + 1):  # noqa: B020
                    row = row_of(replace(entry, number=number))
                    digest = _digest_after(digest, row)
                    self._connection.execute(_INSERT, (*row, digest))
                self._prune(number)
            self.last, self._digest = number, digest
            head = f"{self.last} {digest.hex()}\n".encode().ljust(_HEAD_SIZE)
            os.pwrite(self._descriptor, head, 0)
        except (sqlite3.Error, OSError) as error:
            raise _unusable(self.path, error) from error

    def _prune(self, last: int) -> None:
        """Delete the oldest entries if there are too many, and keep the digest that the next entry follows."""
        assert self._connection is not None
        (first,) = self._connection.execute("select min(number) from entry").fetchone()
        if last - first < LIMIT + _PRUNED_AT_ONCE:
            return
        until = last - LIMIT
        (digest,) = self._connection.execute("select digest from entry where number = ?", (until,)).fetchone()
        self._connection.execute("delete from pruned")
        self._connection.execute("insert into pruned values (?, ?)", (until, digest))
        self._connection.execute("delete from entry where number <= ?", (until,))

    def close(self) -> None:
        """Close the files."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    # ------------------------------------------------------------------------------------------ reading
    def find(self, query: AuditQuery) -> list[AuditEntry]:
        """Return the selected entries, newest first."""
        conditions, values = ["true"], list[object]()
        if query.before:
            conditions.append("number < ?")
            values.append(query.before)
        if query.outcome:
            conditions.append("outcome = ?")
            values.append(query.outcome)
        if query.text:
            conditions.append(
                "instr(lower(user || ' ' || request || ' ' || target || ' ' || address || ' ' || reason), ?)"
            )
            values.append(query.text.lower())
        where = " and ".join(conditions)
        statement = f"select {_COLUMNS} from entry where {where} order by number desc limit ?"  # noqa: S608
        with self._reading() as connection:
            return [_entry_of(row) for row in connection.execute(statement, (*values, query.limit))]

    def all(self) -> Iterator[AuditEntry]:
        """Return all entries, oldest first."""
        with self._reading() as connection:
            for row in connection.execute(f"select {_COLUMNS} from entry order by number"):  # noqa: S608
                yield _entry_of(row)

    def check(self) -> AuditCheck:
        """Compare all entries with their digests, and the newest with the head."""
        with self._reading() as connection:
            head_number, head_digest = self._read_head()
            pruned = connection.execute("select number, digest from pruned").fetchone()
            number, digest = pruned or (0, _NO_DIGEST)
            first, problem, at_head = 0, "", number == head_number and digest == head_digest
            for *row, stored in connection.execute(f"select {_COLUMNS}, digest from entry order by number"):  # noqa: S608
                if row[0] != number + 1:
                    problem = f"entries {number + 1} to {row[0] - 1} are missing"
                    break
                number, digest = row[0], _digest_after(digest, tuple(row))
                first = first or number
                if stored != digest:
                    problem = f"entry {number} or the one before it was edited"
                    break
                at_head = at_head or (number == head_number and digest == head_digest)
            if not problem and head_number > number:
                problem = f"entries {number + 1} to {head_number} are missing"
            elif not problem and head_number and not at_head:
                problem = f"the digest of entry {head_number} differs from the head {self._head.name}"
            return AuditCheck(problem, first, number, digest.hex())

    def _read_head(self) -> tuple[int, bytes]:
        """Return number and digest of the newest entry, 0 if the head is empty."""
        text = self._head.read_text(errors="replace").split() if self._head.exists() else []
        try:
            return (int(text[0]), bytes.fromhex(text[1])) if text else (0, _NO_DIGEST)
        except (ValueError, IndexError):
            return 1, _UNREADABLE  # `check` reports it as a difference

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        """Open a connection that only reads."""
        try:
            with closing(
                sqlite3.connect(f"{self.path.absolute().as_uri()}?mode=ro", uri=True, timeout=_BUSY_TIMEOUT)
            ) as each:
                yield each
        except (sqlite3.Error, msgspec.MsgspecError, ValueError) as error:
            raise _unusable(self.path, error) from error


def _newest(connection: sqlite3.Connection) -> tuple[int, bytes]:
    found = connection.execute("select number, digest from entry order by number desc limit 1").fetchone()
    found = found or connection.execute("select number, digest from pruned").fetchone()
    return found or (0, _NO_DIGEST)


def _unusable(path: Path, error: BaseException) -> StorageError:
    return StorageError("The audit trail {path} cannot be used: {reason}.", path=path, reason=error)
