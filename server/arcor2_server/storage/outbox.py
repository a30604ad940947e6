"""Stores which changed units and alarms have to be sent to the fleet, in the transaction that changes them."""

import enum
import time
import zlib
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from sqlalchemy import delete, func, insert, select
from sqlalchemy.ext.asyncio import AsyncSession

from arcor2_server.storage.models import AlarmRow, OutboxRow, UnitRow
from arcor2_server.storage.store import Storage


class OutboxKind(enum.StrEnum):
    """What a row of the outbox refers to."""

    UNIT = "unit"
    ALARM = "alarm"


class Waiting(NamedTuple):
    """A record that has to be sent: number of its row, kind, and the record as JSON."""

    number: int
    kind: OutboxKind
    document: bytes


class Outbox:
    """The rows of the outbox. Methods may raise StorageError."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage
        self._last = 0
        self.on_added: list[Callable[[], None]] = []
        """Called after rows were added, possibly before their transaction ends."""

    async def add(self, session: AsyncSession, kind: OutboxKind, records: Sequence[int]) -> None:
        """Add changed records within the transaction that stores them. A waiting row of the same record is replaced."""
        if not records:
            return
        await session.execute(delete(OutboxRow).where(OutboxRow.kind == kind, OutboxRow.record.in_(records)))
        # By the clock, so that a number is not used again after all rows were removed; the clock may be set back.
        if not self._last:
            self._last = await session.scalar(select(func.max(OutboxRow.number))) or 0
        first = max(self._last + 1, time.time_ns() // 1000)
        self._last = first + len(records) - 1
        rows = [{"number": first + index, "kind": kind.value, "record": record} for index, record in enumerate(records)]
        await session.execute(insert(OutboxRow), rows)
        for notify in self.on_added:
            notify()

    async def count(self) -> int:
        """Return the number of waiting records."""
        async with self._storage.reading() as session:
            return await session.scalar(select(func.count()).select_from(OutboxRow)) or 0

    async def first(self, limit: int) -> list[Waiting]:
        """Return the records that wait longest. Rows whose record does not exist any more are removed."""
        oldest = select(OutboxRow.number, OutboxRow.kind, OutboxRow.record).order_by(OutboxRow.number).limit(limit)
        async with self._storage.reading() as session:
            rows = list(await session.execute(oldest))
            units = [record for _, kind, record in rows if kind == OutboxKind.UNIT]
            alarms = [record for _, kind, record in rows if kind == OutboxKind.ALARM]
            documents = {
                (OutboxKind.UNIT, number): zlib.decompress(document)
                for number, document in await session.execute(
                    select(UnitRow.number, UnitRow.document).where(UnitRow.number.in_(units))
                )
            } | {
                (OutboxKind.ALARM, number): document
                for number, document in await session.execute(
                    select(AlarmRow.number, AlarmRow.document).where(AlarmRow.number.in_(alarms))
                )
            }
        gone = [number for number, kind, record in rows if (OutboxKind(kind), record) not in documents]
        if gone:
            await self.remove(gone)
        return [
            Waiting(number, OutboxKind(kind), documents[OutboxKind(kind), record])
            for number, kind, record in rows
            if (OutboxKind(kind), record) in documents
        ]

    async def remove(self, numbers: Iterable[int]) -> None:
        """Remove rows, because the broker has stored their records."""
        async with self._storage.writing(documents=False) as session:
            await session.execute(delete(OutboxRow).where(OutboxRow.number.in_(list(numbers))))
