"""Atomic replacement of files."""

import os
import secrets
from pathlib import Path
from typing import Final

FILE_MODE: Final = 0o600


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


def sync(path: Path) -> None:
    """Flush a file, or the entries of a directory, to the disk, so that renaming and deleting is durable.

    Raises:
        OSError: it cannot be flushed.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
