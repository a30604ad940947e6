"""The database of saved documents: connections, transactions and errors."""

import asyncio
import functools
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from contextvars import ContextVar
from typing import Any, Final, NamedTuple

import msgspec
from sqlalchemy import Table, event, inspect, select
from sqlalchemy.exc import DataError, SQLAlchemyError
from sqlalchemy.ext.asyncio import AsyncEngine, AsyncSession, async_sessionmaker, create_async_engine

from arcor2_hw.exceptions import Arcor2Error, InvalidData, NotFound, StorageError, TextTooLong
from arcor2_server.durations import Durations
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.models import Base
from arcor2_server.storage.schema import create_or_migrate
from arcor2_server.storage.sqlite import check_opens, prepare, purge

_transaction: ContextVar[AsyncSession | None] = ContextVar("transaction", default=None)
"""The session of the transaction that the present task is in."""
_PER_QUERY: Final = 100
"""Number of documents read by one query; each may have some hundred kilobytes."""


class Engines(NamedTuple):
    """The connections of a database, and its name in messages. SQLite has one connection for both."""

    reading: AsyncEngine
    writing: AsyncEngine
    place: str

    async def dispose(self) -> None:
        """Close all connections."""
        await self.writing.dispose()
        await self.reading.dispose()


async def open_engines(settings: ServerSettings, *, exclusive: bool = True) -> Engines:
    """Open or create the database.

    Args:
        settings: State where the database is.
        exclusive: Whether no other server may use it. An SQLite file is in the data directory, which the server locks.

    Raises:
        StorageError: It cannot be reached, is in use, damaged, not writable or of a newer version.
    """
    if settings.database_url:
        from arcor2_server.storage import postgresql  # slow to import

        url = postgresql.parse_url(settings.database_url)
        engines = Engines(*postgresql.open_engines(url, exclusive=exclusive), postgresql.place_of(url))
    else:
        file = settings.documents_database
        check_opens(file)
        # One connection, since SQLite allows one writer, and each connection needs a thread.
        engine = create_async_engine(f"sqlite+aiosqlite:///{file}", pool_size=1, max_overflow=0)
        event.listen(engine.sync_engine, "connect", prepare)
        engines = Engines(engine, engine, str(file))
    try:
        await create_or_migrate(engines.writing, engines.place)
    except BaseException:
        await engines.dispose()
        raise
    return engines


class Database:
    """The database with its transactions. All methods may raise StorageError, which names the database.

    `revision` grows with every write; `types_revision` with every write to object types and models.
    """

    def __init__(self, engines: Engines) -> None:
        self.revision = 0
        self.types_revision = 0
        self.durations = Durations()
        """Durations of the transactions that write."""
        self._engines = engines
        self.place = engines.place
        """Names the database in messages."""
        self._readers = async_sessionmaker(engines.reading, expire_on_commit=False)
        self._writers = async_sessionmaker(engines.writing, expire_on_commit=False)
        if engines.writing.dialect.name == "sqlite":
            from sqlalchemy.dialects.sqlite import insert
        else:
            from sqlalchemy.dialects.postgresql import insert  # type: ignore[assignment]
        self._insert = insert

    async def purge(self) -> None:
        """Overwrite replaced and deleted data in an SQLite file."""
        try:
            await purge(self._engines.writing)
        except SQLAlchemyError as error:
            raise self._failed("write", error) from error

    async def close(self) -> None:
        """Close the database."""
        await self._engines.dispose()

    # ------------------------------------------------------------------------------------------------ transactions
    @asynccontextmanager
    async def transaction(self) -> AsyncIterator[None]:
        """Combine all writes of the present task into one transaction."""
        before = self.types_revision
        async with self.writing() as session:
            token = _transaction.set(session)
            try:
                yield
            finally:
                _transaction.reset(token)
        if self.types_revision != before:
            self.types_revision += 1  # other tasks see the new types only now

    @asynccontextmanager
    async def reading(self) -> AsyncIterator[AsyncSession]:
        """Return a session for reading."""
        try:
            if (session := _transaction.get()) is not None:
                yield session
                return
            async with self._readers() as session:
                yield session
        except SQLAlchemyError as error:
            raise self._failed("read", error) from error

    @asynccontextmanager
    async def writing(self, *, documents: bool = True) -> AsyncIterator[AsyncSession]:
        """Return a session in a transaction that is committed on exit.

        `documents`: increase `revision`, since cached answers that are made from documents may be outdated.
        """
        try:
            if (session := _transaction.get()) is not None:
                yield session
                await session.flush()
                return
            with self.durations.measure("write"):
                async with self._writers() as session, session.begin():
                    yield session
        except SQLAlchemyError as error:
            raise self._failed("write", error) from error
        if documents:
            self.revision += 1

    async def upsert(self, session: AsyncSession, row: Base) -> None:
        """Insert a row, or replace one with the same primary key, by one statement.

        Columns that are not set in `row` keep their values, or are created with their defaults.

        Raises:
            TextTooLong: A text is longer than its column.
            InvalidData: A text contains the character NUL.
        """
        mapper = inspect(row).mapper
        table: Any = mapper.local_table
        values = {name: vars(row)[name] for name in vars(row) if name in table.columns}
        check_lengths(table, values)
        keys = [column.name for column in table.primary_key]
        statement = self._insert(table).values(values)
        changed = {name: statement.excluded[name] for name in values if name not in keys}
        if changed:
            statement = statement.on_conflict_do_update(index_elements=keys, set_=changed)
        else:
            statement = statement.on_conflict_do_nothing(index_elements=keys)
        await session.flush()
        await session.execute(statement)
        if (loaded := session.identity_map.get(mapper.identity_key_from_instance(row))) is not None:
            session.expire(loaded)

    def _failed(self, operation: str, error: SQLAlchemyError) -> Arcor2Error:
        cause = getattr(error, "orig", None) or error
        if isinstance(cause, Arcor2Error):  # a value was refused
            return cause
        if self._engines.writing.dialect.name == "postgresql":
            from arcor2_server.storage.postgresql import unreachable

            if (lost := unreachable(error, self.place)) is not None:
                return lost
        if isinstance(error, DataError):
            return InvalidData("A value does not fit into the database: {cause}.", detail=str(error), cause=cause)
        return StorageError(
            "cannot {what} the database {place}: {cause}",
            detail=str(error),
            what=operation,
            place=self.place,
            cause=cause,
        )

    @staticmethod
    async def one(session: AsyncSession, table: type[Any], key: str, kind: str) -> Any:
        """Return the row with a key. Raise NotFound naming `kind` if there is none."""
        if (row := await session.get(table, key)) is None:
            raise NotFound("The {what} {key!r} does not exist.", what=kind, key=key)
        return row

    async def with_ids(self, table: type[Any], keys: Sequence[str], decode: Any) -> list[Any]:
        """Return the documents with these ids, decoded off the event loop in batches."""
        found: list[Any] = []
        for begin in range(0, len(keys), _PER_QUERY):
            wanted = select(table.id, table.document).where(table.id.in_(keys[begin : begin + _PER_QUERY]))
            async with self.reading() as session:
                rows = list(await session.execute(wanted))
            found += await asyncio.to_thread(list, map(functools.partial(self.decoded, decode), rows))
        return found

    def decoded(self, decode: Any, row: Any, column: str = "document") -> Any:
        """Return the document of a row. Raise StorageError that names the row if the document is damaged."""
        try:
            return decode(getattr(row, column))
        except msgspec.DecodeError as error:
            raise StorageError(
                "the document {id!r} in the database {place} is damaged: {reason}",
                id=row.id,
                place=self.place,
                reason=error,
            ) from error


def check_lengths(table: Table, values: dict[str, Any]) -> None:
    """Raise TextTooLong if a text is longer than its column."""
    for name, value in values.items():
        limit = getattr(table.c[name].type, "length", None)
        if limit is not None and isinstance(value, str) and len(value) > limit:
            raise TextTooLong(
                "{field} has {count} characters; at most {limit} are allowed. Shorten it.",
                field=f"{name} of {table.name}",
                count=len(value),
                limit=limit,
            )
