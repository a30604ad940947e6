"""Stores the latest calibration records, and the latest one of every object and kind."""

from typing import Final

import msgspec
from sqlalchemy import delete, func, select

from arcor2_hw.calibration.records import CalibrationRecord
from arcor2_hw.data.base import Unset
from arcor2_hw.data.rpc import ListCalibrationsArgs
from arcor2_server.storage.models import CalibrationRow
from arcor2_server.storage.store import Storage

MAX_RECORDS: Final = 10_000
"""Maximum number of stored records. Beyond it the oldest are deleted, but never the latest of an object and kind."""

_encode = msgspec.json.Encoder().encode
_decode = msgspec.json.Decoder(CalibrationRecord).decode


class Calibrations:
    """The calibration records. All methods may raise StorageError."""

    def __init__(self, storage: Storage, limit: int = MAX_RECORDS) -> None:
        self._storage = storage
        self._limit = limit

    async def put(self, record: CalibrationRecord) -> None:
        """Store a record."""
        async with self._storage.writing() as session:
            await self._storage.upsert(
                session,
                CalibrationRow(
                    id=record.id,
                    date=record.date,
                    kind=record.kind.value,
                    object_id=record.object_id,
                    document=_encode(record),
                ),
            )
            await session.flush()
            count = await session.scalar(select(func.count()).select_from(CalibrationRow)) or 0
            if count > self._limit:
                newest = select(func.max(CalibrationRow.date)).group_by(CalibrationRow.object_id, CalibrationRow.kind)
                oldest = (
                    select(CalibrationRow.id)
                    .where(CalibrationRow.date.not_in(newest))
                    .order_by(CalibrationRow.date)
                    .limit(count - self._limit)
                )
                await session.execute(delete(CalibrationRow).where(CalibrationRow.id.in_(oldest)))

    async def get(self, key: str) -> CalibrationRecord:
        """Return a record. Raise NotFound if there is none."""
        async with self._storage.reading() as session:
            row = await Storage.one(session, CalibrationRow, key, "calibration")
            return _decode(row.document)

    async def latest(self) -> list[CalibrationRecord]:
        """Return the latest record of each object and kind: the calibrations in force."""
        newest = (
            select(CalibrationRow.object_id, CalibrationRow.kind, func.max(CalibrationRow.date).label("date"))
            .group_by(CalibrationRow.object_id, CalibrationRow.kind)
            .subquery()
        )
        same = (CalibrationRow.object_id == newest.c.object_id) & (CalibrationRow.kind == newest.c.kind)
        chosen = select(CalibrationRow.document).join(newest, same & (CalibrationRow.date == newest.c.date))
        async with self._storage.reading() as session:
            return [_decode(document) for document in await session.scalars(chosen)]

    async def find(self, args: ListCalibrationsArgs) -> list[CalibrationRecord]:
        """Return records, newest first."""
        chosen = select(CalibrationRow.document).order_by(CalibrationRow.date.desc()).limit(args.limit)
        if not isinstance(args.object_id, Unset):
            chosen = chosen.where(CalibrationRow.object_id == args.object_id)
        if not isinstance(args.kind, Unset):
            chosen = chosen.where(CalibrationRow.kind == args.kind.value)
        if not isinstance(args.before, Unset):
            chosen = chosen.where(CalibrationRow.date < args.before)
        async with self._storage.reading() as session:
            return [_decode(document) for document in await session.scalars(chosen)]
