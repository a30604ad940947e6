"""Files that only their owner may read: databases, tokens, secrets."""

import os
import stat
import tempfile
from pathlib import Path
from typing import Final

import structlog

log = structlog.get_logger(__name__)

FILE_MODE: Final = 0o600
DIRECTORY_MODE: Final = 0o700


def ensure_private(path: Path) -> None:
    """Create a file if it is missing, and take the rights of group and others away. Raises OSError."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, FILE_MODE)
    try:
        if os.fstat(descriptor).st_mode & 0o077:
            os.fchmod(descriptor, FILE_MODE)
    finally:
        os.close(descriptor)


def tighten(directory: Path) -> None:
    """Take the rights of group and others away from a directory and what is directly in it, where we own it."""
    for path in (directory, *directory.iterdir()):
        try:
            status = path.lstat()
            if status.st_mode & 0o077 and not stat.S_ISLNK(status.st_mode):
                path.chmod(DIRECTORY_MODE if stat.S_ISDIR(status.st_mode) else FILE_MODE)
        except OSError as error:
            log.warning("others may read a file of the data directory", path=str(path), reason=error.strerror)


def write_private(path: Path, content: bytes) -> None:
    """Replace a file in one step: after a crash it is the old one or the new one. Raises OSError."""
    descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")  # mode 0600
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def aside(path: Path, stamp: str) -> Path:
    """Return an unused name next to a damaged file under which it can be stored."""
    stamp = stamp.replace(":", "").replace("-", "").partition(".")[0]
    found, number = path.with_name(f"{path.stem}.damaged-{stamp}{path.suffix}"), 1
    while found.exists():
        number += 1
        found = path.with_name(f"{path.stem}.damaged-{stamp}-{number}{path.suffix}")
    return found
