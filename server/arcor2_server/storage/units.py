"""Stores the records of units, and the activity of the cell over time."""

import asyncio
import zlib
from collections.abc import Iterable
from typing import Any, Final

import msgspec
from sqlalchemy import Select, delete, func, select

from arcor2_hw.data.base import Timestamp, Unset
from arcor2_hw.data.rpc import ListUnitsArgs
from arcor2_hw.data.units import CellActivity, Unit, UnitRecord, UnitState
from arcor2_hw.exceptions import NotFound, StorageError
from arcor2_server.storage.models import CellTimeRow, UnitRow, UnitRunRow
from arcor2_server.storage.outbox import UnitOutbox
from arcor2_server.storage.store import Storage

MAX_UNITS: Final = 100_000
"""Maximum number of stored records. Beyond it the oldest are deleted."""

_encode: Final = msgspec.json.Encoder().encode


def _packed(record: UnitRecord) -> bytes:
    return zlib.compress(_encode(record))


def _unpacked(document: bytes, kind: Any = UnitRecord) -> Any:
    try:
        return msgspec.json.decode(zlib.decompress(document), type=kind)
    except (msgspec.MsgspecError, zlib.error) as error:
        raise StorageError("The record of a unit cannot be read: {reason}.", reason=error) from error


class UnitStore:
    """The stored records of units. All methods may raise StorageError.

    Args:
        storage: the database.
        outbox: gets the units that have left the cell; None: they are not sent.
    """

    def __init__(self, storage: Storage, outbox: UnitOutbox | None = None) -> None:
        self._storage = storage
        self._outbox = outbox

    async def newest_number(self) -> int:
        """Return the number of the newest record, 0 if there is none."""
        async with self._storage.reading() as session:
            return await session.scalar(select(func.max(UnitRow.number))) or 0

    async def in_cell(self) -> list[UnitRecord]:
        """Return the records of the units that have not left the cell, oldest first."""
        chosen = select(UnitRow.document).where(UnitRow.left.is_(None)).order_by(UnitRow.number)
        async with self._storage.reading() as session:
            return [_unpacked(document) for document in await session.scalars(chosen)]

    async def put(self, records: Iterable[UnitRecord], deleted: Iterable[int] = ()) -> None:
        """Store records, and delete those with the given numbers. The oldest ones beyond MAX_UNITS are deleted."""
        async with self._storage.writing(documents=False) as session:
            newest = 0
            finished = []
            for record in records:
                if record.state is not UnitState.IN_CELL:
                    finished.append(record.number)
                newest = max(newest, record.number)
                recipe = record.recipe
                rate = None if isinstance(recipe, Unset) or isinstance(recipe.planned_rate, Unset) else (
                    recipe.planned_rate
                )  # fmt: skip
                await self._storage.upsert(
                    session,
                    UnitRow(
                        number=record.number,
                        serial=record.serial,
                        order_id=record.order,
                        product="" if isinstance(recipe, Unset) else recipe.product,
                        state=record.state.value,
                        entered=record.entered,
                        left=None if isinstance(record.left, Unset) else record.left,
                        planned_rate=rate,
                        document=_packed(record),
                    ),
                )
                for run in record.runs:
                    await self._storage.upsert(session, UnitRunRow(unit=record.number, run=run))
            for number in deleted:
                await session.execute(delete(UnitRow).where(UnitRow.number == number))
                await session.execute(delete(UnitRunRow).where(UnitRunRow.unit == number))
            if newest > MAX_UNITS:
                await session.execute(delete(UnitRow).where(UnitRow.number <= newest - MAX_UNITS))
                await session.execute(delete(UnitRunRow).where(UnitRunRow.unit <= newest - MAX_UNITS))
            if self._outbox is not None:
                await self._outbox.add(session, finished)

    async def get(self, number: int) -> UnitRecord:
        """Return a record. Raise NotFound if there is none."""
        async with self._storage.reading() as session:
            row = await session.get(UnitRow, number)
            if row is None:
                raise NotFound("There is no record of a unit with the number {number}.", number=number)
            document = row.document
        record: UnitRecord = await asyncio.to_thread(_unpacked, document)
        return record

    async def find(self, args: ListUnitsArgs) -> list[Unit]:
        """Return units without their steps, newest first."""
        chosen = _chosen(args)
        async with self._storage.reading() as session:
            documents = list(await session.scalars(chosen))
        found: list[Unit] = await asyncio.to_thread(lambda: [_unpacked(document, Unit) for document in documents])
        return found

    async def left_between(self, since: Timestamp, until: Timestamp) -> list[tuple[UnitState, float | None, int]]:
        """Return the number of units that left the cell in a period, by state and planned rate."""
        chosen = (
            select(UnitRow.state, UnitRow.planned_rate, func.count())
            .where(UnitRow.left >= since, UnitRow.left < until)
            .group_by(UnitRow.state, UnitRow.planned_rate)
        )
        async with self._storage.reading() as session:
            return [(UnitState(state), rate, count) for state, rate, count in await session.execute(chosen)]

    async def count_in_cell(self) -> int:
        """Return the number of units that have not left the cell."""
        chosen = select(func.count()).select_from(UnitRow).where(UnitRow.left.is_(None))
        async with self._storage.reading() as session:
            return await session.scalar(chosen) or 0

    # ------------------------------------------------------------------------------------------------ times
    async def put_time(self, start: float, end: float, activity: CellActivity) -> None:
        """Store the activity of the cell in a period, s since the epoch. A period with the same start is replaced."""
        async with self._storage.writing(documents=False) as session:
            await self._storage.upsert(session, CellTimeRow(start=start, end=end, activity=activity.value))

    async def delete_times(self, before: float) -> None:
        """Delete times that ended before a time, s since the epoch."""
        async with self._storage.writing(documents=False) as session:
            await session.execute(delete(CellTimeRow).where(CellTimeRow.end < before))

    async def times(self, since: float, until: float) -> list[tuple[float, float, CellActivity]]:
        """Return the times that overlap a period, oldest first; s since the epoch."""
        chosen = (
            select(CellTimeRow.start, CellTimeRow.end, CellTimeRow.activity)
            .where(CellTimeRow.end > since, CellTimeRow.start < until)
            .order_by(CellTimeRow.start)
        )
        async with self._storage.reading() as session:
            return [(start, end, CellActivity(activity)) for start, end, activity in await session.execute(chosen)]


def _chosen(args: ListUnitsArgs) -> Select[Any]:
    chosen = select(UnitRow.document).order_by(UnitRow.number.desc()).limit(args.limit)
    if not isinstance(args.serial, Unset):
        chosen = chosen.where(UnitRow.serial.istartswith(args.serial, autoescape=True))
    if not isinstance(args.order, Unset):
        chosen = chosen.where(UnitRow.order_id == args.order)
    if not isinstance(args.product, Unset):
        chosen = chosen.where(UnitRow.product == args.product)
    if not isinstance(args.state, Unset):
        chosen = chosen.where(UnitRow.state == args.state.value)
    if not isinstance(args.since, Unset):
        chosen = chosen.where(UnitRow.entered >= args.since)
    if not isinstance(args.until, Unset):
        chosen = chosen.where(UnitRow.entered < args.until)
    if not isinstance(args.before, Unset):
        chosen = chosen.where(UnitRow.number < args.before)
    if not isinstance(args.run, Unset):
        chosen = chosen.where(UnitRow.number.in_(select(UnitRunRow.unit).where(UnitRunRow.run == args.run)))
    return chosen
