"""Reads and writes packages as zip archives and directories. Equal files give equal archives."""

import io
import os
import shutil
import stat
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path, PurePosixPath
from typing import Final

from arcor2_hw.exceptions import InvalidPackage, StorageError
from arcor2_hw.files import sync
from arcor2_server.storage.packages import MAX_FILES, inside

Files = Mapping[str, bytes]
"""Content by relative path with slashes."""

MAX_READ: Final = 64 * 1024 * 1024
"""Maximum total size of the files read from a package, bytes, counted while unpacking: a zip may state false sizes."""
_CHUNK: Final = 1 << 20
_EPOCH: Final = (1980, 1, 1, 0, 0, 0)
"""Time stamp of all entries, the earliest one of the format. With real times, archives of the same files would
differ."""
_MODE: Final = (stat.S_IFREG | 0o644) << 16


def _checked(path: str) -> str:
    parts = PurePosixPath(path).parts
    if not parts or path.startswith("/") or ".." in parts or "\\" in path or "\0" in path:
        raise InvalidPackage("invalid path in the package: {path!r}", path=path)
    return path


def to_zip(files: Files) -> bytes:
    """Return the files as a zip archive, sorted by path."""
    with io.BytesIO() as buffer:
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
            for path in sorted(files):
                entry = zipfile.ZipInfo(_checked(path), _EPOCH)
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = _MODE
                entry.create_system = 3  # Unix, also on other systems
                archive.writestr(entry, files[path])
        return buffer.getvalue()


def from_zip(data: Path | bytes, wanted: Callable[[PurePosixPath], bool], largest: int = MAX_READ) -> dict[str, bytes]:
    """Return the wanted files of a zip archive, at most `largest` bytes in total. All paths are checked.

    Raises:
        InvalidPackage: the archive is damaged or too large, has paths outside of it, links or duplicate files.
        StorageError: the file cannot be read.
    """
    found: dict[str, bytes] = {}
    left = largest
    try:
        with zipfile.ZipFile(io.BytesIO(data) if isinstance(data, bytes) else data) as archive:
            entries = archive.infolist()
            if len(entries) > MAX_FILES:
                raise InvalidPackage("The package has more than {max_files} files.", max_files=MAX_FILES)
            seen: set[PurePosixPath] = set()
            for entry in entries:
                path = inside(entry)
                if path in seen:
                    raise InvalidPackage("The package has the file {filename!r} twice.", filename=entry.filename[:80])
                seen.add(path)
                if entry.is_dir() or not wanted(path):
                    continue
                content = bytearray()
                with archive.open(entry) as source:
                    while chunk := source.read(min(_CHUNK, left + 1)):
                        left -= len(chunk)
                        if left < 0:
                            raise InvalidPackage(
                                "The files of the package are larger than {largest} bytes.", largest=largest
                            )
                        content += chunk
                found[path.as_posix()] = bytes(content)
    except OSError as error:
        raise StorageError("the package cannot be read: {reason}", reason=error.strerror or error) from error
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, ValueError) as error:
        raise InvalidPackage("The package is not a valid zip archive: {reason}.", reason=error) from error
    return found


def write(files: Files, directory: Path) -> None:
    """Write the files to a new directory, atomically and durably.

    Raises:
        StorageError: the directory cannot be written.
    """
    try:
        directory.parent.mkdir(parents=True, exist_ok=True)
        # In the same directory, so that it can be renamed; with a leading dot, which a package id never has.
        temporary = Path(tempfile.mkdtemp(prefix=f".{directory.name}-", dir=directory.parent))
    except OSError as error:
        raise StorageError(
            "packages cannot be written into {parent}: {reason}", parent=directory.parent, reason=error.strerror
        ) from error
    try:
        # script.py last: it makes the directory a package, and a crash must not leave an incomplete one.
        for path, content in sorted(files.items(), key=lambda entry: entry[0] == "script.py"):
            file = temporary / _checked(path)
            file.parent.mkdir(parents=True, exist_ok=True)
            with file.open("wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
        temporary.chmod(0o755)
        temporary.rename(directory)
        sync(directory.parent)
    except OSError as error:
        raise StorageError(
            "package {name} cannot be written: {reason}", str(directory), name=directory.name, reason=error.strerror
        ) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
