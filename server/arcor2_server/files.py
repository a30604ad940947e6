"""Atomic replacement of files, and files that only their owner may read."""

import os
import secrets
import stat
from pathlib import Path
from typing import Final

import structlog

log = structlog.get_logger(__name__)

FILE_MODE: Final = 0o600
DIRECTORY_MODE: Final = 0o700


def ensure_private(path: Path) -> None:
    """Create a file if it is missing, and remove the permissions of group and others.

    Raises:
        OSError: the file cannot be created, or its permissions cannot be changed.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, FILE_MODE)
    try:
        if os.fstat(descriptor).st_mode & 0o077:
            os.fchmod(descriptor, FILE_MODE)
    finally:
        os.close(descriptor)


def tighten(directory: Path) -> None:
    """Remove the permissions of group and others from a directory and its entries. Log what cannot be changed."""
    for path in (directory, *directory.iterdir()):
        try:
            status = path.lstat()
            if status.st_mode & 0o077 and not stat.S_ISLNK(status.st_mode):
                path.chmod(DIRECTORY_MODE if stat.S_ISDIR(status.st_mode) else FILE_MODE)
        except OSError as error:
            log.warning("other users may read a file of the data directory", path=str(path), reason=error.strerror)


def write_private(path: Path, content: bytes) -> None:
    """Replace a file that only its owner may read, as `replace_file` does. Raise OSError if that fails."""
    replace_file(path, content)


def replace_file(
    path: Path,
    content: bytes,
    *,
    mode: int = FILE_MODE,
    durable: bool = True,
    temporary: Path | None = None,
) -> None:
    """Write a file atomically: after a crash it has either the old or the new content.

    Args:
        path: the file.
        content: its new content.
        mode: permissions of the file before the umask; by default only the owner may read it.
        durable: flush the content to the disk before the file is replaced.
        temporary: prefix of the path of the temporary file, on the same file system; None: hidden, next to `path`.

    Raises:
        OSError: the file cannot be written. The old file is unchanged.
    """
    start = path.with_name(f".{path.name}") if temporary is None else temporary
    fresh = start.with_name(f"{start.name}.{secrets.token_hex(6)}")
    descriptor = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        fresh.replace(path)
    except BaseException:
        fresh.unlink(missing_ok=True)
        raise


def sync_directory(directory: Path) -> None:
    """Flush the entries of a directory to the disk, so that renaming and deleting is durable.

    Raises:
        OSError: the directory cannot be flushed.
    """
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def aside(path: Path, stamp: str) -> Path:
    """Return an unused path next to a damaged file to which it can be moved."""
    stamp = stamp.replace(":", "").replace("-", "").partition(".")[0]
    found, number = path.with_name(f"{path.stem}.damaged-{stamp}{path.suffix}"), 1
    while found.exists():
        number += 1
        found = path.with_name(f"{path.stem}.damaged-{stamp}-{number}{path.suffix}")
    return found
