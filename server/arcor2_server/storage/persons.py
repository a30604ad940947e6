"""Stores persons, and the number of wrong PINs of each person at each device."""

from typing import Final

import msgspec
from sqlalchemy import delete, select

from arcor2_hw.data.base import Data
from arcor2_hw.data.role import Role
from arcor2_server.storage.models import PersonLockOutRow, PersonRow
from arcor2_server.storage.store import Storage


class PinHash(Data, frozen=True):
    """The hash of a PIN: scrypt (RFC 7914) with its parameters. `salt` and `digest` are hexadecimal."""

    salt: str
    digest: str
    n: int
    r: int
    p: int


class StoredPerson(Data, frozen=True):
    """A person as stored. `card` is the keyed hash of the number of their card, hexadecimal."""

    id: str
    name: str
    role: Role
    pin: PinHash | None = None
    card: str | None = None


class StoredLockOut(Data, frozen=True):
    """Wrong PINs at a device since the last log-on. `until`: when the next try is possible, s since the epoch."""

    wrong: int
    until: float


_encode: Final = msgspec.json.Encoder().encode
_decode: Final = msgspec.json.Decoder(StoredPerson).decode


class PersonStore:
    """The stored persons and lock-outs. All methods may raise StorageError."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage

    async def all(self) -> list[StoredPerson]:
        """Return all persons."""
        async with self._storage.reading() as session:
            rows = list(await session.scalars(select(PersonRow)))
        return [self._storage.decoded(_decode, row) for row in rows]

    async def put(self, person: StoredPerson) -> None:
        """Store a person."""
        async with self._storage.writing(documents=False) as session:
            await self._storage.upsert(session, PersonRow(id=person.id, document=_encode(person)))

    async def delete(self, key: str) -> None:
        """Delete a person with their lock-outs."""
        async with self._storage.writing(documents=False) as session:
            await session.execute(delete(PersonRow).where(PersonRow.id == key))
            await session.execute(delete(PersonLockOutRow).where(PersonLockOutRow.person == key))

    async def lock_outs(self, person: str) -> dict[str, StoredLockOut]:
        """Return the lock-outs of a person by device."""
        async with self._storage.reading() as session:
            rows = await session.scalars(select(PersonLockOutRow).where(PersonLockOutRow.person == person))
            return {row.device: StoredLockOut(row.wrong, row.until) for row in rows}

    async def put_lock_out(self, person: str, device: str, lock_out: StoredLockOut) -> None:
        """Store a lock-out."""
        row = PersonLockOutRow(person=person, device=device, wrong=lock_out.wrong, until=lock_out.until)
        async with self._storage.writing(documents=False) as session:
            await self._storage.upsert(session, row)

    async def delete_lock_outs(self, person: str, device: str | None = None) -> None:
        """Delete the lock-outs of a person at a device, None: at all devices."""
        statement = delete(PersonLockOutRow).where(PersonLockOutRow.person == person)
        if device is not None:
            statement = statement.where(PersonLockOutRow.device == device)
        async with self._storage.writing(documents=False) as session:
            await session.execute(statement)
