"""Copies all rows of the database in the data directory to PostgreSQL."""

from msgspec.structs import replace
from sqlalchemy import func, insert, select

from arcor2_hw.exceptions import Conflict, NotFound
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.database import check_lengths
from arcor2_server.storage.models import Base
from arcor2_server.storage.store import Storage

_BATCH = 100
"""Number of rows that are read and written at once; each may have some hundred kilobytes."""


async def copy_to_postgresql(settings: ServerSettings) -> dict[str, int]:
    """Copy all rows in one transaction; return their number by table. The SQLite file is left unchanged.

    Args:
        settings: `database_url` is the destination, whose tables must be empty; they are created if missing.

    Raises:
        NotFound: The data directory contains no database.
        Conflict: The destination contains data.
        TextTooLong: A text is longer than its column. Nothing was copied.
        InvalidData: A text contains the character NUL. Nothing was copied.
        StorageError: A database cannot be used, or another server uses the destination.
    """
    if not settings.documents_database.exists():
        raise NotFound("The data directory {path} contains no database.", path=settings.data_dir)
    source = await Storage.open(replace(settings, database_url=""))
    try:
        destination = await Storage.open(settings)
        try:
            return await _copy(source, destination)
        finally:
            await destination.close()
    finally:
        await source.close()


async def _copy(source: Storage, destination: Storage) -> dict[str, int]:
    counts = {}
    async with source.reading() as reading, destination.writing() as writing:
        for table in Base.metadata.sorted_tables:
            if await writing.scalar(select(func.count()).select_from(table)):
                raise Conflict(
                    "The database {place} contains data already: the table {table} is not empty. Nothing was copied.",
                    place=destination.place,
                    table=table.name,
                )
            counts[table.name] = 0
            rows = await reading.stream(select(table))
            async for batch in rows.mappings().partitions(_BATCH):
                values = [dict(row) for row in batch]
                for row in values:
                    check_lengths(table, row)
                await writing.execute(insert(table), values)
                counts[table.name] += len(values)
    return counts
