"""Connections to PostgreSQL: their settings, the check of the collation, and the lock that excludes other servers.

All writes use one connection, as with SQLite. This connection holds an advisory lock of the database. A server that
lost the connection therefore cannot write before it has the lock again.
"""

import os
import re
import socket
from typing import Any, Final

import sqlalchemy
from sqlalchemy import URL, event, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, SQLAlchemyError
from sqlalchemy.ext.asyncio import AsyncEngine, create_async_engine

from arcor2_hw.exceptions import DatabaseInUse, DatabaseUnreachable, StorageError

DRIVER: Final = "postgresql+psycopg"
"""The driver in the URL of the database."""
LOCK: Final = 0x6172636F72320001
"""Key of the advisory lock: `arcor2` in ASCII, and a number."""
LOCK_WAIT: Final = 2.0
"""Time that a start waits for the lock, s: PostgreSQL may notice the end of the previous server late."""
READERS: Final = 4
"""Number of connections for reading that are kept open; as many more are opened when needed."""
_SETTINGS: Final = {
    "connect_timeout": "5",
    "keepalives_idle": "10",
    "keepalives_interval": "5",
    "keepalives_count": "3",
    "tcp_user_timeout": "25000",
    # The same for the other end, so that the lock of a machine without power is released after 25 s.
    "options": "-c tcp_keepalives_idle=10 -c tcp_keepalives_interval=5 -c tcp_keepalives_count=3",
}
_HOLDER: Final = """
    SELECT application_name, host(client_addr), to_char(backend_start, 'YYYY-MM-DD HH24:MI:SS TZ')
    FROM pg_locks JOIN pg_stat_activity USING (pid)
    WHERE locktype = 'advisory' AND granted AND objsubid = 1 AND classid = %s AND objid = %s
      AND database = (SELECT oid FROM pg_database WHERE datname = current_database())
"""
_COLLATION: Final = """
    SELECT current_database(), pg_encoding_to_char(encoding), datcollate,
           pg_encoding_to_char(encoding) = 'UTF8' AND 'B' < 'a' AND 'z' < 'č' AND lower('Č') = 'č'
    FROM pg_database WHERE datname = current_database()
"""


def parse_url(text: str) -> URL:
    """Return the URL of a database. Raise StorageError if it is not one of PostgreSQL; passwords are not repeated."""
    try:
        url = make_url(text)
    except ArgumentError:
        url = None
    if url is None or url.drivername not in (DRIVER, "postgresql") or not url.database:
        raise StorageError(
            "ARCOR2_HW_DATABASE_URL is not the address of a PostgreSQL database. Use {driver}://USER@HOST/DATABASE.",
            driver=DRIVER,
        )
    return url.set(drivername=DRIVER)


def place_of(url: URL) -> str:
    """Return the name of a database for messages: without user and password."""
    host = url.host or url.query.get("host") or "localhost"
    return f"{url.database} at {host}:{url.port or url.query.get('port') or 5432}"


def open_engines(url: URL, *, exclusive: bool) -> tuple[AsyncEngine, AsyncEngine]:
    """Return the engines for reading and for writing. They do not connect yet.

    Args:
        url: Address of the database.
        exclusive: Whether writing requires the lock that excludes other servers.

    Raises:
        StorageError: The driver is not installed.
    """
    name = f"arcor2-hw on {socket.gethostname()[:32]}, process {os.getpid()}"
    settings = {"application_name": name} | _SETTINGS
    options: Any = {
        "connect_args": {key: value for key, value in settings.items() if key not in url.query},
        # A connection that was lost while nobody used it is replaced before a request uses it.
        "pool_pre_ping": True,
    }
    try:
        reading = create_async_engine(url, pool_size=READERS, max_overflow=READERS, **options)
        writing = create_async_engine(url, pool_size=1, max_overflow=0, **options)
    except ModuleNotFoundError as error:
        raise StorageError(
            "The database {place} needs the package {package}. Install arcor2-hw[postgresql].",
            place=place_of(url),
            package=error.name,
        ) from error
    if exclusive:
        event.listen(writing.sync_engine, "connect", lambda connection, _: _take_lock(connection, place_of(url)))
    return reading, writing


def _take_lock(connection: Any, place: str) -> None:
    """Take the lock on a new connection, which holds it until it ends. Raise DatabaseInUse if another server has it."""
    cursor = connection.cursor()
    try:
        cursor.execute(f"SET lock_timeout = '{LOCK_WAIT:g}s'")
        cursor.execute("SELECT pg_advisory_lock(%s)", (LOCK,))
        cursor.execute("RESET lock_timeout")
        connection.commit()
        return
    except Exception as error:
        if getattr(error, "sqlstate", None) != "55P03":  # lock_not_available
            connection.close()
            raise
    connection.rollback()
    cursor.execute(_HOLDER, (LOCK >> 32, LOCK & 0xFFFFFFFF))
    name, address, since = cursor.fetchone() or ("another server", None, "now")
    connection.close()
    raise DatabaseInUse(
        "The database {place} is in use by {holder} since {since}. Stop that server, or use another database.",
        place=place,
        holder=f"{name} ({address})" if address else name,
        since=since,
    )


def check_collation(connection: sqlalchemy.Connection, place: str) -> None:
    """Raise StorageError unless texts are sorted by code point and case is known beyond ASCII, in UTF-8."""
    name, encoding, collation, usable = connection.exec_driver_sql(_COLLATION).one()
    if not usable:
        raise StorageError(
            "The database {place} has the encoding {encoding} and the collation {collation}; UTF8 and C.UTF-8 are "
            "required. Create it with: createdb --template=template0 --encoding=UTF8 --locale=C.UTF-8 {name}",
            place=place,
            encoding=encoding,
            collation=collation,
            name=name,
        )


def unreachable(error: SQLAlchemyError, place: str) -> DatabaseUnreachable | None:
    """Return the error for a database server that does not answer; None if `error` has another cause."""
    if not isinstance(error, DBAPIError) or error.orig is None:
        return None
    # Errors with an SQLSTATE are answers of the server. Class 08 and 57P are about the connection.
    state = getattr(error.orig, "sqlstate", "") or ""
    if not error.connection_invalidated and (state[:2] != "08" and state[:3] != "57P"):
        if state or type(error.orig).__module__.partition(".")[0] != "psycopg":
            return None
        if type(error.orig).__name__ not in ("OperationalError", "ConnectionTimeout"):
            return None
    return DatabaseUnreachable(
        "The database {place} cannot be reached: {reason}. Check the database server and the network. Unsaved edits "
        "are stored on this machine; save them when the database can be reached again.",
        detail=str(error),
        place=place,
        reason=_reason(error.orig),
    )


def _reason(error: BaseException) -> str:
    """Return the cause in an error of libpq, which repeats addresses and asks questions."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()] or [type(error).__name__]
    return re.sub(r"^.*failed: (?:FATAL:\s*)?", "", lines[0]).rstrip(".")
