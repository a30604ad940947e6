"""Creates the database or migrates it to the present schema."""

from pathlib import Path
from typing import Any, Final

import sqlalchemy
from sqlalchemy import Connection, inspect, text
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.ext.asyncio import AsyncEngine

from arcor2_hw.exceptions import StorageError
from arcor2_server.storage.models import Base

REVISION: Final = "0011"
"""The newest revision in `migrations/versions`."""
KNOWN_REVISIONS: Final = frozenset(
    {"0001", "0002", "0003", "0004", "0005", "0006", "0007", "0008", "0009", "0010", REVISION}
)
"""All revisions from which a database can be migrated."""
MIGRATIONS: Final = Path(__file__).parent / "migrations"
CHECKED_SIZE: Final = 64 * 1024 * 1024
"""Maximum size of an SQLite database that is checked for damage at start, bytes."""


async def create_or_migrate(engine: AsyncEngine, place: str) -> None:
    """Create or migrate the schema.

    Args:
        engine: The engine of the database.
        place: The path or address of the database for messages.

    Raises:
        StorageError: The database is damaged, not writable or of a newer version.
    """
    try:
        async with engine.begin() as connection:
            await connection.run_sync(_create_or_migrate, place)
    except SQLAlchemyError as error:
        if engine.dialect.name == "postgresql":
            from arcor2_server.storage.postgresql import unreachable

            if (lost := unreachable(error, place)) is not None:
                raise lost from error
        raise StorageError(
            "The database {place} cannot be used: {reason}.", detail=str(error), place=place, reason=_reason(error)
        ) from error
    except OSError as error:
        raise StorageError("The database {place} cannot be used: {reason}.", place=place, reason=error) from error


def _create_or_migrate(connection: Connection, place: str) -> None:
    if connection.dialect.name == "postgresql":
        from arcor2_server.storage import postgresql

        postgresql.check_collation(connection, place)
        # A command may start at the same time as the server.
        connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": postgresql.LOCK + 1})
    found = _examine(connection)
    if found is None:
        _create(connection)
    elif found not in KNOWN_REVISIONS | {REVISION}:
        raise StorageError(
            "The database {place} has the schema {found!r}, which this version does not support. Update arcor2-hw.",
            place=place,
            found=found,
        )
    elif found != REVISION:
        migrate(connection)


def _reason(error: SQLAlchemyError) -> str:
    return str(getattr(error, "orig", None) or error)


def _examine(connection: Connection) -> str | None:
    """Return the revision of the schema, None if the database is empty; check an SQLite file for damage."""
    if connection.dialect.name == "sqlite":
        pages = connection.scalar(text("PRAGMA page_count")) or 0
        size = connection.scalar(text("PRAGMA page_size")) or 0
        if pages * size <= CHECKED_SIZE:
            verdict = connection.scalar(text("PRAGMA quick_check(1)"))
            if verdict != "ok":
                raise sqlalchemy.exc.DatabaseError("quick_check", None, Exception(f"damaged: {verdict}"))
        # A write shows whether the file and its directory are writable.
        connection.execute(text("PRAGMA user_version = 1"))
    tables = inspect(connection).get_table_names()
    if "alembic_version" not in tables:
        if tables:
            raise sqlalchemy.exc.DatabaseError("schema", None, Exception("it is not a database of this program"))
        return None
    return connection.scalar(text("SELECT version_num FROM alembic_version")) or ""


def _create(connection: Connection) -> None:
    # Migrations are not used, since Alembic takes 0.3 s to import. A test checks that they create the same schema.
    Base.metadata.create_all(connection)
    connection.execute(text("CREATE TABLE alembic_version (version_num VARCHAR(32) NOT NULL PRIMARY KEY)"))
    connection.execute(text("INSERT INTO alembic_version VALUES (:revision)"), {"revision": REVISION})


def migrate(connection: Connection, target: str = "head") -> None:
    """Run the migrations over an open connection."""
    from alembic import command

    config = alembic_config()
    config.attributes["connection"] = connection
    command.upgrade(config, target)


def alembic_config() -> Any:
    """Return the configuration of Alembic for our migrations."""
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    return config
