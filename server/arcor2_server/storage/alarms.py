"""Stores the records of alarms in the database."""

from collections.abc import Iterable
from typing import Final

import msgspec
import structlog
from sqlalchemy import delete, select

from arcor2_hw.data.alarms import AlarmRecord
from arcor2_server.storage.models import AlarmRow
from arcor2_server.storage.store import Storage

log = structlog.get_logger(__name__)

_encode: Final = msgspec.json.Encoder().encode
_decode: Final = msgspec.json.Decoder(AlarmRecord).decode


class AlarmStore:
    """The stored records of alarms. All methods may raise StorageError."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage

    async def all(self) -> list[AlarmRecord]:
        """Return all records, oldest first, without unreadable ones."""
        async with self._storage.reading() as session:
            rows = list(await session.scalars(select(AlarmRow.document).order_by(AlarmRow.number)))
        found = []
        for document in rows:
            try:
                found.append(_decode(document))
            except msgspec.MsgspecError as error:
                log.warning("record of an alarm left out", reason=str(error))
        return found

    async def put(self, records: Iterable[AlarmRecord], deleted: set[int]) -> None:
        """Store records, and delete those with the given numbers."""
        async with self._storage.writing(documents=False) as session:
            for record in records:
                await self._storage.upsert(session, AlarmRow(number=record.number, document=_encode(record)))
            if deleted:
                await session.execute(delete(AlarmRow).where(AlarmRow.number.in_(deleted)))
