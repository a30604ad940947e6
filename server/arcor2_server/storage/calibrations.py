"""Calibration records. The latest are stored, and always the latest of every object."""

from typing import Final

import msgspec
from sqlalchemy import delete, func, select

from arcor2_hw.calibration.records import CalibrationKind, CalibrationRecord
from arcor2_server.storage.models import CalibrationRow
from arcor2_server.storage.store import Storage

KEPT: Final = 10_000
"""Records, beyond which the oldest go."""
MOST: Final = 1000
"""Records of one answer."""

_encode = msgspec.json.Encoder().encode
_decode = msgspec.json.Decoder(CalibrationRecord).decode


class Calibrations:
    """The calibration records. All methods may raise StorageError."""

    def __init__(self, storage: Storage, kept: int = KEPT) -> None:
        self._storage = storage
        self._kept = kept

    async def put(self, record: CalibrationRecord) -> None:
        """Keep a record."""
        async with self._storage.writing() as session:
            await session.merge(
                CalibrationRow(
                    id=record.id,
                    date=record.date,
                    kind=record.kind.value,
                    object_id=record.object_id,
                    document=_encode(record),
                )
            )
            await session.flush()
            count = await session.scalar(select(func.count()).select_from(CalibrationRow)) or 0
            if count > self._kept:
                newest = select(func.max(CalibrationRow.date)).group_by(CalibrationRow.object_id, CalibrationRow.kind)
                oldest = (
                    select(CalibrationRow.id)
                    .where(CalibrationRow.date.not_in(newest))
                    .order_by(CalibrationRow.date)
                    .limit(count - self._kept)
                )
                await session.execute(delete(CalibrationRow).where(CalibrationRow.id.in_(oldest)))

    async def get(self, key: str) -> CalibrationRecord:
        """Return a record. Raise NotFound if there is none."""
        async with self._storage.reading() as session:
            row = await Storage.one(session, CalibrationRow, key, "calibration")
            return _decode(row.document)

    async def find(
        self,
        *,
        object_id: str | None = None,
        kind: CalibrationKind | None = None,
        before: str | None = None,
        limit: int = 100,
    ) -> list[CalibrationRecord]:
        """Return records, newest first: of an object, of a kind, older than a date."""
        chosen = select(CalibrationRow.document).order_by(CalibrationRow.date.desc()).limit(min(max(limit, 0), MOST))
        if object_id is not None:
            chosen = chosen.where(CalibrationRow.object_id == object_id)
        if kind is not None:
            chosen = chosen.where(CalibrationRow.kind == kind.value)
        if before is not None:
            chosen = chosen.where(CalibrationRow.date < before)
        async with self._storage.reading() as session:
            return [_decode(document) for document in await session.scalars(chosen)]
