"""The database of saved documents: connections, transactions and errors."""

import asyncio
import functools
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from contextvars import ContextVar
from typing import Any, Final

import msgspec
from sqlalchemy import event, select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.ext.asyncio import AsyncEngine, AsyncSession, async_sessionmaker, create_async_engine

from arcor2_hw.exceptions import NotFound, StorageError
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.schema import create_or_migrate
from arcor2_server.storage.sqlite import check_opens, prepare, purge

_transaction: ContextVar[AsyncSession | None] = ContextVar("transaction", default=None)
"""The session of the transaction that the present task is in."""
_PER_QUERY: Final = 100
"""Number of documents read by one query; each may have some hundred kilobytes."""


async def open_engine(settings: ServerSettings) -> tuple[AsyncEngine, str]:
    """Open or create the database; return it with its name in messages.

    Raises:
        StorageError: It is damaged, not writable or of a newer version.
    """
    place = settings.database_url.rpartition("@")[2] or str(settings.documents_database)
    if settings.database_url:
        engine = create_async_engine(settings.database_url)
    else:
        check_opens(settings.documents_database)
        # One connection, since SQLite allows one writer, and each connection needs a thread.
        engine = create_async_engine(f"sqlite+aiosqlite:///{settings.documents_database}", pool_size=1, max_overflow=0)
        event.listen(engine.sync_engine, "connect", prepare)
    try:
        await create_or_migrate(engine, place)
    except BaseException:
        await engine.dispose()
        raise
    return engine, place


class Database:
    """The database with its transactions. All methods may raise StorageError, which names the database.

    `revision` grows with every write; `types_revision` with every write to object types and models.
    """

    def __init__(self, engine: AsyncEngine, place: str) -> None:
        self.revision = 0
        self.types_revision = 0
        self._engine = engine
        self._place = place
        self._sessions = async_sessionmaker(engine, expire_on_commit=False)

    async def purge(self) -> None:
        """Overwrite replaced and deleted data in an SQLite file."""
        try:
            await purge(self._engine)
        except SQLAlchemyError as error:
            raise self._failed("write", error) from error

    async def close(self) -> None:
        """Close the database."""
        await self._engine.dispose()

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
            async with self._sessions() as session:
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
            async with self._sessions() as session, session.begin():
                yield session
        except SQLAlchemyError as error:
            raise self._failed("write", error) from error
        if documents:
            self.revision += 1

    def _failed(self, what: str, error: SQLAlchemyError) -> StorageError:
        cause = getattr(error, "orig", None) or error
        return StorageError(
            "cannot {what} the database {place}: {cause}", detail=str(error), what=what, place=self._place, cause=cause
        )

    @staticmethod
    async def one(session: AsyncSession, table: type[Any], key: str, what: str) -> Any:
        """Return the row with a key. Raise NotFound naming `what` if there is none."""
        if (row := await session.get(table, key)) is None:
            raise NotFound("The {what} {key!r} does not exist.", what=what, key=key)
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
                place=self._place,
                reason=error,
            ) from error
