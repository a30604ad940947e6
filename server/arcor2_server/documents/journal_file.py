"""The journal's SQLite file: writes edits and detects damage.

Every row has a checksum. A second small file, the position, names the last acknowledged change. It is written after
each commit without waiting for the disk, and survives the end of the process. With it a journal that lost its newest
changes (a missing or damaged write-ahead log) is detected.
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
from arcor2_hw.exceptions import message_of
from arcor2_hw.messages import Message
from arcor2_server.documents.changes import Edit
from arcor2_server.documents.journal_records import (
    EDIT_COLUMNS,
    Base,
    JournalContent,
    JournalDamaged,
    JournalLoss,
    Position,
    RecoveredDocument,
    base_checksum,
    document_of,
    edit_checksum,
    note_missing,
    read_content,
    write_job,
)
from arcor2_server.files import FILE_MODE, damaged_copy_path, ensure_private

log = structlog.get_logger(__name__)

FORMAT: Final = 3
"""Version of the file format, stored in SQLite's user_version. A file with a newer version is treated as damaged."""

CHECKPOINT_PAGES: Final = 200
"""Number of pages in the write-ahead log at which SQLite moves them to the database."""

BUSY_TIMEOUT: Final = 5.0
"""Time limit for another process that has the file open (a server that is shutting down) to close it, s."""

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
_MIGRATE_FROM_1: Final = """
alter table edit add column request text not null default '';
alter table edit add column how text not null default 'edit';
alter table edit add column target integer not null default 0;
"""
"""Format 1 has no kinds of edit."""
_MIGRATE_FROM_2: Final = """
alter table base add column sum integer not null default 0;
alter table edit add column sum integer not null default 0;
create table opening (id integer primary key check (id = 1), serial integer not null) strict;
insert into opening values (1, 0);
"""
"""Format 2 has no checksums."""


class JournalFile:
    """The SQLite file and the position file, used by one thread. Methods raise sqlite3.Error and OSError.

    `convert` changes the restored content. If it does, the content is written into a new file, so that nothing of the
    old content remains.
    """

    def __init__(
        self, path: Path, convert: Callable[[RecoveredDocument], RecoveredDocument] = lambda found: found
    ) -> None:
        self._path = path
        self._convert = convert
        self._position_path = path.with_suffix(".position")
        self._connection: sqlite3.Connection | None = None
        self._descriptor = -1
        self.position = Position()

    def open(self) -> tuple[RecoveredDocument | None, JournalLoss | None]:
        """Open or create the files. Return the document that an earlier server left open, and its lost changes.

        A damaged file is renamed, and its intact content is written into a new one.
        """
        expected = _read_position(self._position_path)
        exists = self._path.exists() and self._path.stat().st_size > 0
        copy = self._copy()
        try:
            content = self._read()
            if expected is not None:
                note_missing(content, expected)
        except BaseException:
            _unlink(copy)
            raise
        loss = None
        found = content.recovered
        if found is not None:
            content.recovered = self._convert(found)
        if content.damage or content.recovered is not found:
            self.close()
            fresh = self._write_new_file(content)
            stored = self._rename_damaged(copy) if exists and content.damage else None
            if content.damage:
                log.error(
                    "journal damaged",
                    reason=str(content.damage),
                    lost=str(content.lost or ""),
                    stored_as=str(stored or ""),
                )
            _with_ending(self._path, "-wal").unlink(missing_ok=True)
            fresh.replace(self._path)
            self._connection = _connect(self._path)
            _recover(self._connection)
            if content.damage and content.lost:
                loss = JournalLoss(
                    content.damage, content.lost, "" if stored is None else str(stored), content.incomplete
                )
        _unlink(copy)
        recovered = content.recovered
        self.position = Position(content.serial)
        if recovered is not None:
            self.position = Position(content.serial, recovered.last, document_of(recovered.items))
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
        """Write jobs to the disk in one transaction."""
        assert self._connection is not None
        position = self.position
        if len(jobs) == 1 and isinstance(jobs[0], Edit):
            write_job(self._connection, jobs[0], position.serial)  # one statement is a transaction of its own
            position = position.after(jobs[0])
        else:
            with self._connection:
                self._connection.execute("begin immediate")
                for job in jobs:
                    position = position.after(job)
                    write_job(self._connection, job, position.serial)
        self.position = position
        self._write_position()

    def extend_log(self) -> None:
        """Extend the write-ahead log to its full length.

        A commit that overwrites a part of the file takes half as long as one that extends it (0.12 ms, not 0.24 ms).
        """
        assert self._connection is not None
        connection = self._connection
        try:
            with connection:
                connection.execute("begin immediate")
                connection.execute(
                    "drop table if exists extent"
                )  # left over from a server that was killed at this point
                connection.execute("create table extent (content blob)")
                connection.execute("insert into extent values (zeroblob(?))", (CHECKPOINT_PAGES * 4096,))
            with connection:
                connection.execute("drop table extent")
            connection.execute("pragma wal_checkpoint(restart)").fetchall()
        except sqlite3.Error as error:
            log.warning("write-ahead log of the journal cannot be extended", error=str(error))

    # ------------------------------------------------------------------------------------------ content
    def _read(self) -> JournalContent:
        try:
            ensure_private(self._path)
            self._connection = _connect(self._path)
            return _recover(self._connection)
        except BaseException as error:
            self.close()
            if not _is_damage(error, self._path):
                raise
            lost = Message.of("Unsaved changes of the scene or project that was open are lost.")
            return JournalContent(damage=message_of(error), lost=lost)

    def _write_new_file(self, content: JournalContent) -> Path:
        """Write the intact content into a new file next to the damaged one."""
        path = self._path.with_name(f".{self._path.stem}.new{self._path.suffix}")
        _unlink(path)
        ensure_private(path)
        with closing(_connect(path)) as connection:
            _recover(connection)
            with connection:
                connection.execute("begin immediate")
                connection.execute("update opening set serial = ?", (content.serial,))
                if (found := content.recovered) is not None:
                    base = Base(found.items, found.number, found.scene, found.project, 0, found.edits)
                    write_job(connection, base, content.serial)
        return path

    # ------------------------------------------------------------------------------------------ other files
    def _write_position(self) -> None:
        content = msgspec.json.encode(self.position)
        line = b"%s %08x\n" % (content, zlib.crc32(content))
        try:
            os.pwrite(self._descriptor, line.ljust(POSITION_SIZE), 0)
        except OSError as error:
            log.warning("position of the journal cannot be written", error=str(error))

    def _copy(self) -> Path | None:
        """Copy the files of a server that did not shut down: SQLite drops the damaged part of a write-ahead log."""
        log_file = _with_ending(self._path, "-wal")
        if not self._path.exists() or not log_file.exists() or not log_file.stat().st_size:
            return None
        copy = self._path.with_name(f".{self._path.stem}.before{self._path.suffix}")
        for ending in ("", "-wal"):
            target = _with_ending(copy, ending)
            ensure_private(target)
            shutil.copyfile(_with_ending(self._path, ending), target)
        return copy

    def _rename_damaged(self, copy: Path | None) -> Path:
        """Rename the damaged files; return the new path of the database."""
        stored = damaged_copy_path(self._path, now())
        source = copy or self._path
        for ending in ("", "-wal", "-shm"):
            if _with_ending(source, ending).exists():
                _with_ending(source, ending).rename(_with_ending(stored, ending))
            _with_ending(self._path, ending).unlink(missing_ok=True)
        return stored


def _with_ending(path: Path, ending: str) -> Path:
    return path.with_name(path.name + ending)


def _unlink(path: Path | None) -> None:
    """Delete a database with its write-ahead log."""
    if path is not None:
        for ending in ("", "-wal"):
            _with_ending(path, ending).unlink(missing_ok=True)


def _connect(path: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(path, timeout=BUSY_TIMEOUT, isolation_level=None, check_same_thread=False)
    connection.text_factory = lambda text: text.decode(errors="replace")  # the checksum detects damaged text
    return connection


# ---------------------------------------------------------------------------------------------- recovery
_DAMAGE: Final = frozenset({sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR})
"""SQLite's codes of a damaged file. Other errors (permissions, full disk, locked file) are reported to the operator."""


def _is_damage(error: BaseException, path: Path) -> bool:
    if not isinstance(error, sqlite3.OperationalError):
        return isinstance(error, (sqlite3.DatabaseError, msgspec.DecodeError, ValueError, JournalDamaged))
    code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF
    if code in (sqlite3.SQLITE_READONLY, sqlite3.SQLITE_CANTOPEN):
        # Bytes 18 and 19 are the file format versions for writing and reading: 2 with a write-ahead log.
        with path.open("rb") as file:
            return file.read(20)[18:] not in (b"\1\1", b"\2\2", b"")
    return code in _DAMAGE


def _recover(connection: sqlite3.Connection) -> JournalContent:
    """Convert the file to the present format, and read the intact records. Raise JournalDamaged if there are none."""
    # Refuses a second server on the same directory, and needs no shared memory file.
    connection.execute("pragma locking_mode = exclusive")
    connection.execute("pragma journal_mode = wal")
    connection.execute("pragma synchronous = full")
    connection.execute(f"pragma wal_autocheckpoint = {CHECKPOINT_PAGES}")
    (version,) = connection.execute("pragma user_version").fetchone()
    if version == 0:
        _migrate(connection, _BASE + _EDIT + _MIGRATE_FROM_2)
        return JournalContent()
    if version not in (1, 2, FORMAT):
        raise JournalDamaged("its format is {format}, this version knows {known}", format=version, known=FORMAT)
    (check,) = connection.execute("pragma quick_check(1)").fetchone()
    if version != FORMAT:
        if check != "ok":
            raise JournalDamaged(check)
        _migrate(connection, (_MIGRATE_FROM_1 if version == 1 else "") + _MIGRATE_FROM_2)
    content = read_content(connection)
    if check != "ok":
        content.damage = content.damage or Message.of(check)
    return content


def _migrate(connection: sqlite3.Connection, statements: str) -> None:
    with connection:
        connection.execute("begin immediate")
        for statement in statements.split(";"):
            connection.execute(statement)
        for row in connection.execute("select items, edit, scene_times, project_times from base").fetchall():
            connection.execute("update base set sum = ?", (base_checksum(row, 0),))
        for row in connection.execute(f"select {EDIT_COLUMNS} from edit").fetchall():  # noqa: S608
            connection.execute("update edit set sum = ? where number = ?", (edit_checksum(row), row[0]))
        connection.execute(f"pragma user_version = {FORMAT}")


def _read_position(path: Path) -> Position | None:
    """Return the last acknowledged change, None if the file is missing or damaged."""
    try:
        content, _, checksum = path.read_bytes().strip().rpartition(b" ")
        if int(checksum, 16) != zlib.crc32(content):
            return None
        return msgspec.json.decode(content, type=Position)
    except (OSError, ValueError, msgspec.DecodeError):
        return None
