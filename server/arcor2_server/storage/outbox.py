"""Outbox for the fleet: units that have left the cell, until the broker has stored them."""

import enum
import time
import zlib
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, Protocol

from sqlalchemy import delete, func, insert, select
from sqlalchemy.ext.asyncio import AsyncSession

from arcor2_server.storage.models import OutboxRow, UnitRow
from arcor2_server.storage.store import Storage


class OutboxKind(enum.StrEnum):
    """Kind of a record that has to be sent."""

    UNIT = "unit"
    ALARM = "alarm"


class Waiting(NamedTuple):
    """A record that has to be sent: the number of this sending, its kind, and the record as JSON."""

    number: int
    kind: OutboxKind
    document: bytes


class Outbox(Protocol):
    """The records of one store that have to be sent. Methods may raise StorageError."""

    on_added: list[Callable[[], None]]
    """Called after records were added, possibly before their transaction ends."""

    async def count(self) -> int:
        """Return the number of waiting records."""

    async def first(self, limit: int) -> list[Waiting]:
        """Return the records that wait longest."""

    async def remove(self, numbers: Iterable[int]) -> None:
        """Remove records, because the broker has stored them."""


def next_numbers(last: int, count: int) -> range:
    """Return numbers for new records. They follow the clock, so that none is used again after all records were removed.

    Args:
        last: the last number; the clock may have been set back.
        count: the number of records.
    """
    first = max(last + 1, time.time_ns() // 1000)
    return range(first, first + count)


class UnitOutbox:
    """The units that have to be sent, in the database. A further change replaces the row of a unit by a newer one."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage
        self._last = 0
        self.on_added: list[Callable[[], None]] = []
        """Called after units were added, possibly before their transaction ends."""

    async def add(self, session: AsyncSession, units: Sequence[int]) -> None:
        """Add changed units within the transaction that stores them."""
        if not units:
            return
        await session.execute(delete(OutboxRow).where(OutboxRow.unit.in_(units)))
        if not self._last:
            self._last = await session.scalar(select(func.max(OutboxRow.number))) or 0
        numbers = next_numbers(self._last, len(units))
        self._last = numbers[-1]
        rows = [{"number": number, "unit": unit} for number, unit in zip(numbers, units, strict=True)]
        await session.execute(insert(OutboxRow), rows)
        for notify in self.on_added:
            notify()

    async def count(self) -> int:
        """Return the number of waiting units."""
        async with self._storage.reading() as session:
            return await session.scalar(select(func.count()).select_from(OutboxRow)) or 0

    async def first(self, limit: int) -> list[Waiting]:
        """Return the units that wait longest. Those that do not exist any more are removed."""
        oldest = (
            select(OutboxRow.number, UnitRow.document)
            .join(UnitRow, UnitRow.number == OutboxRow.unit, isouter=True)
            .order_by(OutboxRow.number)
            .limit(limit)
        )
        async with self._storage.reading() as session:
            rows = list(await session.execute(oldest))
        if gone := [number for number, document in rows if document is None]:
            await self.remove(gone)
        return [
            Waiting(number, OutboxKind.UNIT, zlib.decompress(document))
            for number, document in rows
            if document is not None
        ]

    async def remove(self, numbers: Iterable[int]) -> None:
        """Remove units, because the broker has stored them."""
        async with self._storage.writing(documents=False) as session:
            await session.execute(delete(OutboxRow).where(OutboxRow.number.in_(list(numbers))))
