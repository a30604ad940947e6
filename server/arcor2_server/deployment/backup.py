"""Backups of a data directory in one file, made while the server runs, and their restoration.

A backup contains the state of one moment: all SQLite files are read in transactions that begin together. It has the
state that a crash at this moment would leave, which the next start handles. A manifest with digests comes last, so that
an incomplete file is recognised.
"""

import contextlib
import hashlib
import os
import shutil
import socket
import sqlite3
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import IO, Final

import msgspec

from arcor2_hw.data.base import Data, now
from arcor2_hw.exceptions import InvalidData, StorageError
from arcor2_hw.files import sync
from arcor2_server.files import DIRECTORY_MODE, FILE_MODE

FORMAT: Final = 1
"""Version of the format of backups."""
MANIFEST: Final = "backup.json"
BACKUPS: Final = "backups"
"""Directory of the data directory for backups before upgrades."""
REPLACED_PREFIX: Final = "before-restore"
"""Start of the names of directories with the data that a restoration has replaced."""
LOCK: Final = "lock"
"""The file that a server locks."""
MAX_ENTRIES: Final = 1_000_000
MAX_MANIFEST: Final = 256 * 1024 * 1024
BUSY_TIMEOUT: Final = 5.0
ATTEMPTS: Final = 5
"""Number of attempts to read all files, which may be deleted during the backup."""
_CHUNK: Final = 1024 * 1024
_PAGES: Final = 256
"""Number of pages of an SQLite file that are copied at once."""
_SQLITE: Final = b"SQLite format 3\0"
_LOG_HEADER: Final = 32
"""Length of the header of a write-ahead log, bytes (sqlite.org/fileformat.html)."""
JOURNAL: Final = "journal.sqlite"
"""The SQLite file that a server locks exclusively."""
_DERIVED: Final = frozenset({"analysis.msgpack", "problems.msgpack", "prepared"})
"""Files that the server can compute again."""
_READ_FIRST: Final = (".position", ".head")
"""Suffixes of files that name the newest entry of an SQLite file. They may be older than that file, but not newer."""
_UNPACKING: Final = ".restore-unpacking"
"""A backup that is being unpacked. After an interruption it is deleted."""
_READY: Final = ".restore-ready"
"""A complete backup, while the present files are moved to the directory below."""
_REPLACED: Final = ".restore-replaced"
_MOVING: Final = ".restore-moving"
"""A complete backup, while its files are moved to the data directory."""
_DATE: Final = (1980, 1, 1, 0, 0, 0)


class BackupEntry(Data, frozen=True):
    """Size in bytes and SHA-256 digest of a file."""

    size: int
    sha256: str


class Manifest(Data, frozen=True):
    """The content of a backup.

    Attributes:
        format: Version of the format.
        version: Version of ARCOR2-HW that wrote it.
        created: Time of the backup (UTC).
        host: Name of the machine.
        files: The files by their path in the data directory.
    """

    format: int
    version: str
    created: str
    host: str
    files: dict[str, BackupEntry]

    @property
    def size(self) -> int:
        """Size of all files, bytes."""
        return sum(entry.size for entry in self.files.values())


class _FileDeleted(Exception):
    """A file was deleted before it was copied."""


def write_backup(data_dir: Path, target: Path, version: str) -> Manifest:
    """Write the state of a data directory into a new file, which only its owner may read.

    The server may be running. It can read and write during the backup.

    Args:
        data_dir: the data directory.
        target: the file; it is complete as soon as it exists.
        version: version of ARCOR2-HW.

    Raises:
        StorageError: the data cannot be read, or the file cannot be written.
    """
    temporary = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        for attempt in range(ATTEMPTS):
            descriptor = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, FILE_MODE)
            with os.fdopen(descriptor, "wb") as file:
                try:
                    manifest = _write(data_dir, file, version, target.parent)
                except _FileDeleted:
                    if attempt == ATTEMPTS - 1:
                        raise
                    continue
                file.flush()
                os.fsync(file.fileno())
            temporary.rename(target)
            sync(target.parent)
            return manifest
        raise AssertionError("unreachable")
    except (OSError, sqlite3.Error, _FileDeleted) as error:
        raise StorageError("{directory} cannot be backed up: {reason}.", directory=data_dir, reason=error) from error
    finally:
        temporary.unlink(missing_ok=True)


def _write(data_dir: Path, file: IO[bytes], version: str, scratch: Path) -> Manifest:
    paths = sorted(_files(data_dir))
    databases = [path for path in paths if _is_sqlite(data_dir / path)]
    entries: dict[str, BackupEntry] = {}
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive, contextlib.ExitStack() as stack:
        first = [path for path in paths if path.endswith(_READ_FIRST)]
        for path in first:
            entries[path] = _add(archive, file, path, data_dir / path)
        # The journal first, so that a document saved in between is in both, as after a crash.
        databases.sort(key=lambda path: path != JOURNAL)
        snapshots = [
            (
                path,
                stack.enter_context((_exclusive_snapshot if path == JOURNAL else _snapshot)(data_dir / path, scratch)),
            )
            for path in databases
        ]
        # A snapshot may list files, such as those of the history. The files that exist now are those in its list.
        present = sorted(_files(data_dir))
        if missing := set(paths).difference(present):
            raise _FileDeleted(", ".join(sorted(missing)))
        for path in present:
            if path not in entries and path not in databases:
                entries[path] = _add(archive, file, path, data_dir / path)
        for path, snapshot in snapshots:
            copy = stack.enter_context(_copied(snapshot, scratch))
            entries[path] = _add(archive, file, path, copy)
        manifest = Manifest(FORMAT, version, now(), socket.gethostname(), entries)
        archive.writestr(zipfile.ZipInfo(MANIFEST, _DATE), msgspec.json.format(msgspec.json.encode(manifest), indent=1))
    return manifest


def _files(directory: Path, prefix: str = "") -> Iterator[str]:
    """Yield the relative paths of the files that belong into a backup."""
    with os.scandir(directory) as found:
        for entry in found:
            name = entry.name
            if not prefix and (name in _DERIVED or _is_excluded(name)):
                continue
            # Names that start with a dot are files that are being written.
            if name.startswith(".") or name.endswith(("-wal", "-shm", "-journal")):
                continue
            if entry.is_dir(follow_symlinks=False):
                yield from _files(Path(entry.path), f"{prefix}{name}/")
            elif entry.is_file(follow_symlinks=False):
                yield prefix + name


def _is_excluded(name: str) -> bool:
    """Return whether an entry of the data directory is neither copied nor replaced."""
    return name in (LOCK, BACKUPS) or name.startswith(REPLACED_PREFIX)


def _is_sqlite(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(len(_SQLITE)) == _SQLITE
    except FileNotFoundError as error:
        raise _FileDeleted(str(path)) from error


@contextlib.contextmanager
def _snapshot(path: Path, _scratch: Path) -> Iterator[sqlite3.Connection]:
    """Connect to an SQLite file and begin a transaction that sees its present state until it ends."""
    with contextlib.closing(sqlite3.connect(path, isolation_level=None, timeout=BUSY_TIMEOUT)) as connection:
        connection.execute("begin")
        connection.execute("select count(*) from sqlite_master").fetchone()
        yield connection


@contextlib.contextmanager
def _exclusive_snapshot(path: Path, scratch: Path) -> Iterator[sqlite3.Connection]:
    """Copy an SQLite file that another process has locked, and connect to the copy.

    The write-ahead log contains all pages that changed since its last restart. If it was not restarted while the
    database and then the log were copied, the copies together have a consistent state: that of the last transaction
    that is complete in the log.
    """
    copy = scratch / f".backup-{os.getpid()}-journal.sqlite"
    log, copied_log = path.with_name(f"{path.name}-wal"), copy.with_name(f"{copy.name}-wal")
    try:
        for _ in range(ATTEMPTS):
            started = _log_start(log)
            for source, target in ((path, copy), (log, copied_log)):
                content = source.read_bytes() if source.exists() else b""
                with os.fdopen(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, FILE_MODE), "wb") as file:
                    file.write(content)
            if _log_start(log) == started == copied_log.read_bytes()[:_LOG_HEADER]:
                break
        else:
            raise StorageError("{path} changes too fast to be copied.", path=path)
        with _snapshot(copy, scratch) as connection:
            yield connection
    finally:
        for made in scratch.glob(f"{copy.name}*"):
            made.unlink()


def _log_start(log: Path) -> bytes:
    """Return the header of a write-ahead log, which changes with each restart of the log."""
    try:
        with log.open("rb") as file:
            return file.read(_LOG_HEADER)
    except FileNotFoundError:
        return b""


@contextlib.contextmanager
def _copied(snapshot: sqlite3.Connection, directory: Path) -> Iterator[Path]:
    """Copy a snapshot into a temporary file in the directory."""
    path = directory / f".backup-{os.getpid()}.sqlite"
    os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, FILE_MODE))
    try:
        with contextlib.closing(sqlite3.connect(path)) as copy:
            copy.execute("pragma synchronous=off")
            snapshot.backup(copy, pages=_PAGES)
            # The copy is one file, although its header may state that there is a write-ahead log.
            copy.execute("pragma journal_mode=delete")
        yield path
    finally:
        path.unlink(missing_ok=True)


def _add(archive: zipfile.ZipFile, file: IO[bytes], name: str, path: Path) -> BackupEntry:
    """Add a file to an archive that is written into `file`; return its size and digest."""
    digest, size = hashlib.sha256(), 0
    info = zipfile.ZipInfo(name, _DATE)
    info.compress_type = zipfile.ZIP_DEFLATED
    try:
        source = path.open("rb")
    except FileNotFoundError as error:
        raise _FileDeleted(str(path)) from error
    with source, archive.open(info, "w", force_zip64=True) as target:
        while chunk := source.read(_CHUNK):
            digest.update(chunk)
            size += len(chunk)
            target.write(chunk)
            # Flushing in small parts avoids delaying the server, which flushes edits to the same disk.
            file.flush()
            os.fdatasync(file.fileno())
    return BackupEntry(size, digest.hexdigest())


# ------------------------------------------------------------------------------------------------ restoring
def read_manifest(archive: zipfile.ZipFile) -> Manifest:
    """Return the manifest of a backup. All paths are inside of the data directory.

    Raises:
        InvalidData: the file is not a complete backup, or was written by a newer version.
    """
    try:
        info = archive.getinfo(MANIFEST)
    except KeyError:
        raise InvalidData("The file is not a backup, or it is incomplete.") from None
    if info.file_size > MAX_MANIFEST or len(archive.infolist()) > MAX_ENTRIES:
        raise InvalidData("The backup has too many files.")
    content = archive.read(info)
    try:
        written = msgspec.json.decode(content, type=dict[str, msgspec.Raw])
        if (version := msgspec.json.decode(written.get("format", b"0"), type=int)) != FORMAT:
            raise InvalidData(
                "The backup has the format {version}; this version reads {format}.", version=version, format=FORMAT
            )
        manifest = msgspec.json.decode(content, type=Manifest)
    except msgspec.DecodeError as error:
        raise InvalidData("The backup has an invalid list of files: {reason}.", reason=error) from error
    names = [one.filename for one in archive.infolist() if one.filename != MANIFEST]
    if sorted(names) != sorted(manifest.files):
        raise InvalidData("The backup contains other files than it lists.")
    for name in names:
        path = PurePosixPath(name)
        if (
            path.is_absolute()
            or ".." in path.parts
            or "\\" in name
            or str(path) != name
            or name.startswith(".")
            or _is_excluded(path.parts[0])
        ):
            raise InvalidData("The backup contains the invalid path {path}.", path=name)
    return manifest


def restore_backup(source: Path, data_dir: Path) -> Manifest:
    """Replace the content of a data directory, which no server may be using, with that of a backup.

    Everything is unpacked and checked before the first file is replaced. The replaced files are moved to a directory
    whose name starts with `before-restore`.

    Raises:
        InvalidData: the file is not a complete backup, or it is damaged. Nothing was replaced.
        StorageError: the file cannot be read, or the data directory cannot be written.
    """
    finish_restoration(data_dir)
    unpacked = data_dir / _UNPACKING
    try:
        with zipfile.ZipFile(source) as archive:
            manifest = read_manifest(archive)
            free = shutil.disk_usage(data_dir).free
            if manifest.size > free:
                raise StorageError(
                    "The backup needs {needed} MB; the disk of {directory} has {free} MB free space.",
                    needed=manifest.size // 10**6,
                    directory=data_dir,
                    free=free // 10**6,
                )
            unpacked.mkdir(DIRECTORY_MODE)
            for name, entry in manifest.files.items():
                _unpack(archive, name, entry, unpacked / name)
        for path in unpacked.rglob("*"):
            if path.is_dir():
                path.chmod(DIRECTORY_MODE)
        unpacked.rename(data_dir / _READY)
        sync(data_dir)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError) as error:
        raise InvalidData("The backup {path} is damaged: {reason}.", path=source, reason=error) from error
    except OSError as error:
        raise StorageError("The backup {path} cannot be restored: {reason}.", path=source, reason=error) from error
    finally:
        shutil.rmtree(unpacked, ignore_errors=True)
    finish_restoration(data_dir)
    return manifest


def finish_restoration(data_dir: Path) -> None:
    """Complete a restoration that was interrupted after its backup was unpacked. Raises StorageError."""
    ready, replaced, moving = data_dir / _READY, data_dir / _REPLACED, data_dir / _MOVING
    try:
        shutil.rmtree(data_dir / _UNPACKING, ignore_errors=True)
        if ready.exists():
            replaced.mkdir(DIRECTORY_MODE, exist_ok=True)
            for entry in list(data_dir.iterdir()):
                if not _is_excluded(entry.name) and entry not in (ready, replaced):
                    entry.rename(replaced / entry.name)
            sync(data_dir)
            ready.rename(moving)
        if moving.exists():
            for entry in list(moving.iterdir()):
                entry.rename(data_dir / entry.name)
            sync(data_dir)
            moving.rmdir()
        if replaced.exists():
            replaced.rename(_unused_path(data_dir))
    except OSError as error:
        raise StorageError("{directory} cannot be restored: {reason}.", directory=data_dir, reason=error) from error


def _unused_path(data_dir: Path) -> Path:
    """Return an unused path for replaced files."""
    stamp = now()[:19].replace(":", "").replace("-", "")
    path, number = data_dir / f"{REPLACED_PREFIX}-{stamp}", 1
    while path.exists():
        number += 1
        path = data_dir / f"{REPLACED_PREFIX}-{stamp}-{number}"
    return path


def _unpack(archive: zipfile.ZipFile, name: str, entry: BackupEntry, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    digest, size = hashlib.sha256(), 0
    descriptor = os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, FILE_MODE)
    with os.fdopen(descriptor, "wb") as file, archive.open(name) as source:
        while size <= entry.size and (chunk := source.read(_CHUNK)):
            digest.update(chunk)
            size += len(chunk)
            file.write(chunk)
        file.flush()
        os.fsync(file.fileno())
    if size != entry.size or digest.hexdigest() != entry.sha256:
        raise InvalidData("The file {path} of the backup is damaged.", path=name)
