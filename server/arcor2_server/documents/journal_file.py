"""The file of the journal: what is written to it, and how damage is found when it is read.

Every row has a checksum. A second small file, the position, names the last acknowledged change; it is written after
each commit without waiting for the disk. It survives the end of the process, so a journal that lost its newest changes
(a missing or damaged write-ahead log) is recognised.
"""

import os
import shutil
import sqlite3
import zlib
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Final

import msgspec
import structlog

from arcor2_hw.data.base import now
from arcor2_server.documents.changes import Edit
from arcor2_server.documents.journal_records import (
    COLUMNS,
    Base,
    Damaged,
    Loss,
    Position,
    Reading,
    Recovered,
    base_sum,
    compare,
    document_of,
    edit_sum,
    read_rows,
    write,
)
from arcor2_server.files import FILE_MODE, aside, ensure_private

log = structlog.get_logger(__name__)

FORMAT: Final = 3
"""Version of the file, stored in SQLite's user_version; a newer one is set aside as a damaged file is."""

CHECKPOINT_PAGES: Final = 200
"""Pages of the write-ahead log that are written before it starts again at its beginning."""

BUSY_TIMEOUT: Final = 5.0
"""Time to wait for another process that has the file open (a server that is just ending), s."""

POSITION_SIZE: Final = 1024
"""Size of the position file, bytes."""

_BASE: Final = """
create table base (id integer primary key check (id = 1), items blob not null, edit integer not null,
                   scene_times text not null, project_times text not null) strict;
"""
_EDIT: Final = """
create table edit (number integer primary key, time text not null, user text not null, changes blob not null,
                   request text not null default '', how text not null default 'edit', target integer not null default 0
                  ) strict;
"""
_FROM_1: Final = """
alter table edit add column request text not null default '';
alter table edit add column how text not null default 'edit';
alter table edit add column target integer not null default 0;
"""
"""Format 1 does not store the kind of an edit."""
_FROM_2: Final = """
alter table base add column sum integer not null default 0;
alter table edit add column sum integer not null default 0;
create table opening (id integer primary key check (id = 1), serial integer not null) strict;
insert into opening values (1, 0);
"""
"""Format 2 has no checksums."""


class JournalFile:
    """The SQLite file and the position file. Used by one thread. Methods raise sqlite3.Error and OSError."""

    def __init__(self, path: Path, convert: Callable[[Recovered], Recovered] = lambda found: found) -> None:
        self._path = path
        self._convert = convert
        self._position_path = path.with_suffix(".position")
        self._connection: sqlite3.Connection | None = None
        self._descriptor = -1
        self.position = Position()

    def open(self) -> tuple[Recovered | None, Loss | None]:
        """Open or create the files. Returns what an earlier server left open, and what of it is lost.

        A damaged file is stored under another name, and what is intact goes into a new one. What `convert` changes is
        written into a new file, so that nothing of the old one is left.
        """
        expected = _read_position(self._position_path)
        exists = self._path.exists() and self._path.stat().st_size > 0
        copy = self._copy()
        try:
            reading = self._read()
            if expected is not None:
                compare(reading, expected)
        except BaseException:
            self._discard(copy)
            raise
        loss = None
        found = reading.recovered
        if found is not None:
            reading.recovered = self._convert(found)
        if reading.damage or reading.recovered is not found:
            self.close()
            fresh = self._written_anew(reading)
            stored = self._set_aside(copy) if exists and reading.damage else None
            if reading.damage:
                log.error("journal damaged", reason=reading.damage, lost=reading.lost, stored_as=str(stored or ""))
            _beside(self._path, "-wal").unlink(missing_ok=True)
            fresh.replace(self._path)
            self._connection = _connect(self._path)
            _recover(self._connection)
            if reading.lost:
                loss = Loss(reading.damage, reading.lost, "" if stored is None else str(stored), reading.incomplete)
        self._discard(copy)
        recovered = reading.recovered
        self.position = Position(reading.serial)
        if recovered is not None:
            self.position = Position(reading.serial, recovered.last, document_of(recovered.items))
        ensure_private(self._position_path)
        self._descriptor = os.open(self._position_path, os.O_WRONLY | os.O_CLOEXEC, FILE_MODE)
        self._write_position()
        return recovered, loss

    def close(self) -> None:
        """Close the files."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def commit(self, jobs: Sequence[Edit | Base | None]) -> None:
        """Write jobs in one transaction; they are on the disk when this returns."""
        assert self._connection is not None
        position = self.position
        if len(jobs) == 1 and isinstance(jobs[0], Edit):
            write(self._connection, jobs[0], position.serial)  # one statement is a transaction of its own
            position = position.after(jobs[0])
        else:
            # One transaction for all that waited: one wait for the disk.
            with self._connection:
                self._connection.execute("begin immediate")
                for job in jobs:
                    position = position.after(job)
                    write(self._connection, job, position.serial)
        self.position = position
        self._write_position()

    def extend_log(self) -> None:
        """Write as much of the log as is used between checkpoints.

        A commit that overwrites takes the disk half as long as one by which the file grows (0.12 ms to 0.24 ms).
        """
        assert self._connection is not None
        connection = self._connection
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

    # ------------------------------------------------------------------------------------------ reading
    def _read(self) -> Reading:
        try:
            ensure_private(self._path)
            self._connection = _connect(self._path)
            return _recover(self._connection)
        except sqlite3.OperationalError as error:
            self.close()
            if not _is_damage(error, self._path):
                raise
            reason = str(error)
        except (sqlite3.DatabaseError, msgspec.DecodeError, ValueError, Damaged) as error:
            self.close()
            reason = str(error)
        except BaseException:
            self.close()
            raise
        return Reading(damage=reason, lost="Unsaved changes of the scene or project that was open are lost.")

    def _written_anew(self, reading: Reading) -> Path:
        """Write what is intact into a new file next to the other one."""
        path = self._path.with_name(f".{self._path.stem}.new{self._path.suffix}")
        for ending in ("", "-wal"):
            _beside(path, ending).unlink(missing_ok=True)
        ensure_private(path)
        with closing(_connect(path)) as connection:
            _recover(connection)
            with connection:
                connection.execute("begin immediate")
                connection.execute("update opening set serial = ?", (reading.serial,))
                if (found := reading.recovered) is not None:
                    base = Base(found.items, found.number, found.scene, found.project, forget=0)
                    jobs: list[Edit | Base] = [base, *found.edits]
                    for job in jobs:
                        write(connection, job, reading.serial)
        return path

    # ------------------------------------------------------------------------------------------ other files
    def _write_position(self) -> None:
        content = msgspec.json.encode(self.position)
        line = b"%s %08x\n" % (content, zlib.crc32(content))
        try:
            os.pwrite(self._descriptor, line.ljust(POSITION_SIZE), 0)
        except OSError as error:
            log.warning("the position of the journal cannot be written", error=str(error))

    def _copy(self) -> Path | None:
        """Copy the files of a server that did not end in order: SQLite drops what it cannot use of the log."""
        log_file = _beside(self._path, "-wal")
        if not self._path.exists() or not log_file.exists() or not log_file.stat().st_size:
            return None
        copy = self._path.with_name(f".{self._path.stem}.before{self._path.suffix}")
        for ending in ("", "-wal"):
            target = _beside(copy, ending)
            ensure_private(target)
            shutil.copyfile(_beside(self._path, ending), target)
        return copy

    def _discard(self, copy: Path | None) -> None:
        if copy is not None:
            for ending in ("", "-wal"):
                _beside(copy, ending).unlink(missing_ok=True)

    def _set_aside(self, copy: Path | None) -> Path:
        """Move the damaged files to another name; return that of the database."""
        stored = aside(self._path, now())
        source = copy or self._path
        for ending in ("", "-wal", "-shm"):
            if _beside(source, ending).exists():
                _beside(source, ending).rename(_beside(stored, ending))
            _beside(self._path, ending).unlink(missing_ok=True)
        return stored


def _beside(path: Path, ending: str) -> Path:
    return path.with_name(path.name + ending)


def _connect(path: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(path, timeout=BUSY_TIMEOUT, isolation_level=None, check_same_thread=False)
    connection.text_factory = lambda text: text.decode(errors="replace")  # its checksum is wrong then
    return connection


# ---------------------------------------------------------------------------------------------- recovery
_DAMAGE: Final = frozenset({sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR})
"""What SQLite reports of a file that is not ours; anything else (no right, no space, locked) is for the user."""


def _is_damage(error: sqlite3.Error, path: Path) -> bool:
    code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF
    if code in (sqlite3.SQLITE_READONLY, sqlite3.SQLITE_CANTOPEN):
        # Bytes 18 and 19 are the version that is needed to write and to read: 2 with a write-ahead log.
        with path.open("rb") as file:
            return file.read(20)[18:] not in (b"\1\1", b"\2\2", b"")
    return code in _DAMAGE


def _recover(connection: sqlite3.Connection) -> Reading:
    """Bring the file to the present format, and read what is intact. Raises Damaged when nothing can be used."""
    # One owner: a second server on the same directory is refused, and no shared memory file is needed.
    connection.execute("pragma locking_mode = exclusive")
    connection.execute("pragma journal_mode = wal")
    connection.execute("pragma synchronous = full")
    connection.execute(f"pragma wal_autocheckpoint = {CHECKPOINT_PAGES}")
    (version,) = connection.execute("pragma user_version").fetchone()
    if version == 0:
        _bring_up_to_date(connection, _BASE + _EDIT + _FROM_2)
        return Reading()
    if version not in (1, 2, FORMAT):
        raise Damaged(f"its format is {version}, this version knows {FORMAT}")
    (check,) = connection.execute("pragma quick_check(1)").fetchone()
    if version != FORMAT:
        if check != "ok":
            raise Damaged(check)
        _bring_up_to_date(connection, (_FROM_1 if version == 1 else "") + _FROM_2)
    reading = read_rows(connection)
    if check != "ok":
        reading.damage = reading.damage or check
    return reading


def _bring_up_to_date(connection: sqlite3.Connection, statements: str) -> None:
    with connection:
        connection.execute("begin immediate")
        for statement in statements.split(";"):
            connection.execute(statement)
        for row in connection.execute("select items, edit, scene_times, project_times from base").fetchall():
            connection.execute("update base set sum = ?", (base_sum(row, 0),))
        for row in connection.execute(f"select {COLUMNS} from edit").fetchall():  # noqa: S608
            connection.execute("update edit set sum = ? where number = ?", (edit_sum(row), row[0]))
        connection.execute(f"pragma user_version = {FORMAT}")


def _read_position(path: Path) -> Position | None:
    """Return the last acknowledged change, None where it is unknown."""
    try:
        content, _, checksum = path.read_bytes().strip().rpartition(b" ")
        if int(checksum, 16) != zlib.crc32(content):
            return None
        return msgspec.json.decode(content, type=Position)
    except (OSError, ValueError, msgspec.DecodeError):
        return None
