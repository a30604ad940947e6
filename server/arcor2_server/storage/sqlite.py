"""What SQLite needs beside SQLAlchemy: a look whether the file opens, and how it is to keep what is written."""

import contextlib
import sqlite3
from pathlib import Path
from typing import Any

from arcor2_hw.exceptions import StorageError


def check_opens(path: Path) -> None:
    """Raise StorageError where there is no opening the file.

    aiosqlite leaves a thread to itself after an open that failed, which then speaks to a loop that may be closed.
    """
    try:
        with contextlib.closing(sqlite3.connect(path)):
            return
    except sqlite3.Error as error:
        raise StorageError(f"cannot use the database {path}: {error}", detail=str(error)) from error


def prepare(connection: Any, _record: Any) -> None:
    """Set up a connection that was just made."""
    cursor = connection.cursor()
    # FULL: in WAL mode only then is every commit flushed before it returns.
    for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=5000"):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()
