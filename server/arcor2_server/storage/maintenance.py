"""Stores the cards of devices, and backups of their parameters."""

from collections.abc import Iterable
from typing import Final

import msgspec
from sqlalchemy import delete, select

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.maintenance import BackupInfo, DeviceCard, ParameterBackup
from arcor2_hw.exceptions import NotFound
from arcor2_server.storage.models import DeviceRow, ParameterBackupRow
from arcor2_server.storage.store import Storage

_encode: Final = msgspec.json.Encoder().encode
_decode_card: Final = msgspec.json.Decoder(DeviceCard).decode
_decode_info: Final = msgspec.json.Decoder(BackupInfo).decode
_decode_backup: Final = msgspec.json.Decoder(ParameterBackup).decode


class MaintenanceStore:
    """The stored cards and backups. All methods may raise StorageError."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage

    async def cards(self) -> list[DeviceCard]:
        """Return all cards, without backups."""
        async with self._storage.reading() as session:
            rows = list(await session.scalars(select(DeviceRow)))
        return [self._storage.decoded(_decode_card, row) for row in rows]

    async def put(self, cards: Iterable[DeviceCard]) -> None:
        """Store cards, without their backups."""
        async with self._storage.writing(documents=False) as session:
            for card in cards:
                stored = msgspec.structs.replace(card, backups=[], found=UNSET, differing=[])
                await self._storage.upsert(session, DeviceRow(object_id=card.object_id, document=_encode(stored)))

    async def backups(self) -> list[BackupInfo]:
        """Return all backups, without the parameters."""
        async with self._storage.reading() as session:
            return [_decode_info(info) for info in await session.scalars(select(ParameterBackupRow.info))]

    async def backup(self, key: str) -> ParameterBackup:
        """Return a backup. Raise NotFound if there is none."""
        async with self._storage.reading() as session:
            row = await session.get(ParameterBackupRow, key)
            if row is None:
                raise NotFound("The backup {key!r} does not exist.", key=key)
            return _decode_backup(row.document)

    async def put_backup(self, info: BackupInfo, backup: ParameterBackup, superseded: Iterable[str]) -> None:
        """Store a backup, and delete others by their ids."""
        async with self._storage.writing(documents=False) as session:
            await self._storage.upsert(
                session,
                ParameterBackupRow(id=info.id, object_id=info.object_id, info=_encode(info), document=_encode(backup)),
            )
            await session.execute(delete(ParameterBackupRow).where(ParameterBackupRow.id.in_(list(superseded))))

    async def delete_backup(self, key: str) -> None:
        """Delete a backup."""
        async with self._storage.writing(documents=False) as session:
            await session.execute(delete(ParameterBackupRow).where(ParameterBackupRow.id == key))
