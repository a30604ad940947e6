"""Settings of SQLite: integrity check and write durability."""

import contextlib
import sqlite3
from pathlib import Path
from typing import Any

from sqlalchemy import text
from sqlalchemy.ext.asyncio import AsyncEngine

from arcor2_hw.exceptions import StorageError
from arcor2_server.files import ensure_private


def check_opens(path: Path) -> None:
    """Create the file, readable only by its owner, and check that it can be opened. Raise StorageError if not.

    aiosqlite itself must not fail to open it, since its thread would then call an event loop that may be closed.
    """
    try:
        ensure_private(path)
        with contextlib.closing(sqlite3.connect(path)):
            return
    except (sqlite3.Error, OSError) as error:
        raise StorageError(
            "The database {path} cannot be used: {reason}.", detail=str(error), path=path, reason=error
        ) from error


def prepare(connection: Any, _record: Any) -> None:
    """Set up a new connection."""
    cursor = connection.cursor()
    # In WAL mode, only FULL flushes every commit to the disk.
    for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=5000"):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


async def purge(engine: AsyncEngine) -> None:
    """Overwrite replaced and deleted data of an SQLite database."""
    if engine.dialect.name != "sqlite":
        return
    async with engine.connect() as plain:
        connection = await plain.execution_options(isolation_level="AUTOCOMMIT")
        for statement in ("VACUUM", "PRAGMA wal_checkpoint(TRUNCATE)"):
            await connection.execute(text(statement))
