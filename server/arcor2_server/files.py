"""Files that only their owner may read."""

import os
import stat
from pathlib import Path
from typing import Final

import structlog

from arcor2_hw.files import FILE_MODE as FILE_MODE, replace_file as replace_file

log = structlog.get_logger(__name__)

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


def restrict_permissions(directory: Path) -> None:
    """Remove the permissions of group and others from a directory and its entries. Log failures."""
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


def damaged_copy_path(path: Path, stamp: str) -> Path:
    """Return an unused path next to a damaged file to which it can be moved."""
    stamp = stamp.replace(":", "").replace("-", "").partition(".")[0]
    found, number = path.with_name(f"{path.stem}.damaged-{stamp}{path.suffix}"), 1
    while found.exists():
        number += 1
        found = path.with_name(f"{path.stem}.damaged-{stamp}-{number}{path.suffix}")
    return found
