"""The persons who log on at shared devices: their PINs, cards, roles and lock-outs."""

import asyncio
import hmac
import time
from datetime import UTC, datetime
from typing import Final

import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Timestamp, Unset, new_id
from arcor2_hw.data.persons import LockOut, Person
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import ChangePersonArgs
from arcor2_hw.exceptions import Conflict, InvalidData, NotFound
from arcor2_server.collaboration.pins import CardHashes, check_pin, hash_pin, matches
from arcor2_server.errors import RequestRefused
from arcor2_server.storage.persons import PersonStore, StoredLockOut, StoredPerson

log = structlog.get_logger(__name__)

MAX_WRONG_PINS: Final = 5
"""Number of wrong PINs of a person at a device after which the person is locked out there."""
FIRST_LOCK_OUT: Final = 60.0
"""Time of the first lock-out, s. Each further wrong PIN doubles it."""
MAX_LOCK_OUT: Final = 3600.0
"""Longest time of a lock-out, s."""
FORGOTTEN_AFTER: Final = 86_400.0
"""Time after a lock-out, or after a wrong PIN, at which wrong PINs no longer count, s."""
_CARDS: Final = ""
"""Placeholder for the person in the lock-out after unknown cards."""


class LogOnRefused(RequestRefused):
    """The PIN or card is wrong, or the person is locked out."""

    code = "log_on_refused"


class Persons:
    """The persons of a data directory. Other processes may change them at any time. Methods may raise StorageError."""

    def __init__(self, store: PersonStore, cards: CardHashes) -> None:
        self._store = store
        self._cards = cards
        self._checking = asyncio.Lock()  # prevents parallel guesses, and limits the load to one computation at a time

    # ------------------------------------------------------------------------------------------------ reading
    async def all(self) -> list[StoredPerson]:
        """Return all persons, by name."""
        return sorted(await self._store.all(), key=lambda each: each.name.casefold())

    async def get(self, key: str) -> StoredPerson:
        """Return a person. Raise NotFound if there is none."""
        for person in await self._store.all():
            if person.id == key:
                return person
        raise NotFound("The person {key!r} does not exist.", key=key)

    async def has_name(self, name: str) -> bool:
        """Return whether a person has this name, in upper or lower case."""
        return any(person.name.casefold() == name.casefold() for person in await self._store.all())

    async def has_administrator(self) -> bool:
        """Return whether a person with the role programmer exists."""
        return any(person.role is Role.PROGRAMMER for person in await self._store.all())

    async def lock_outs(self, person: StoredPerson, names: dict[str, str]) -> list[LockOut]:
        """Return the wrong PINs of a person by device; `names`: names of devices."""
        found = await self._store.lock_outs(person.id)
        at = time.time()
        return [
            LockOut(names.get(device, device), each.wrong, _stamp(each.until) if each.until > at else UNSET)
            for device, each in sorted(found.items())
        ]

    # ------------------------------------------------------------------------------------------------ changes
    async def add(self, name: str, role: Role, pin: str = "", card: str = "") -> StoredPerson:
        """Add a person.

        Raises:
            InvalidData: the name, PIN or card is not acceptable, or both PIN and card are missing.
            Conflict: the name or the card is in use.
        """
        if not (pin or card):
            raise InvalidData("{name} needs a PIN or a card.", name=name)
        person = StoredPerson(new_id("per"), await self._free_name(name, ""), role)
        person = await self._with_secrets(person, pin or UNSET, card or UNSET)
        await self._store.put(person)
        return person

    async def change(self, args: ChangePersonArgs) -> StoredPerson:
        """Change a person and return them.

        Raises:
            NotFound: the person does not exist.
            InvalidData: the name, PIN or card is not acceptable, or both would be missing.
            Conflict: the name or the card is in use.
            RequestRefused: no administrator would remain.
        """
        before = await self.get(args.id)
        after = before
        if not isinstance(args.name, Unset):
            after = replace(after, name=await self._free_name(args.name, args.id))
        if not isinstance(args.role, Unset):
            after = replace(after, role=Role[args.role.upper()])
            if after.role is not Role.PROGRAMMER:
                await self._require_other_administrator(before)
        after = await self._with_secrets(after, args.pin, args.card)
        if after.pin is None and after.card is None:
            raise InvalidData("{name} needs a PIN or a card.", name=after.name)
        if after != before:
            await self._store.put(after)
        if args.unlock or after.pin != before.pin:
            await self._store.delete_lock_outs(args.id)
        return after

    async def change_own_pin(self, key: str, pin: str, new_pin: str, device: str) -> StoredPerson:
        """Replace the PIN of a person who knows the present one. `device`: the device where it was entered.

        Raises:
            NotFound: the person does not exist.
            LogOnRefused: the present PIN is wrong, the person has none, or they are locked out.
            InvalidData: the new PIN is not acceptable.
        """
        check_pin(new_pin)
        person = await self.check_pin(key, pin, device)
        if pin == new_pin:
            raise InvalidData("The new PIN is the present one. Choose another one.")
        return await self.change(ChangePersonArgs(person.id, pin=new_pin))

    async def remove(self, key: str) -> StoredPerson:
        """Remove a person. Raise NotFound if there is none, RequestRefused if no administrator would remain."""
        person = await self.get(key)
        if len(await self._store.all()) > 1:
            await self._require_other_administrator(person)
        await self._store.delete(key)
        return person

    async def _require_other_administrator(self, person: StoredPerson) -> None:
        others = [each for each in await self._store.all() if each.id != person.id]
        if person.role is Role.PROGRAMMER and not any(each.role is Role.PROGRAMMER for each in others):
            raise RequestRefused(
                "{name} is the only person with the role programmer. Add another one first.", name=person.name
            )

    async def _free_name(self, name: str, own: str) -> str:
        name = name.strip()
        if not name or not name.isprintable():
            raise InvalidData("A person needs a name.")
        for each in await self._store.all():
            if each.id != own and each.name.casefold() == name.casefold():
                raise Conflict("There is a person {name!r} already.", name=each.name)
        return name

    async def _with_secrets(self, person: StoredPerson, pin: str | Unset, card: str | Unset) -> StoredPerson:
        if not isinstance(pin, Unset):
            if pin:
                check_pin(pin)
            person = replace(person, pin=await asyncio.to_thread(hash_pin, pin) if pin else None)
        if not isinstance(card, Unset):
            digest = self._cards.of(card) if card else None
            for each in await self._store.all() if digest else ():
                if each.id != person.id and each.card == digest:
                    raise Conflict("This card belongs to {name}.", name=each.name)
            person = replace(person, card=digest)
        return person

    # ------------------------------------------------------------------------------------------------ checking
    async def check_pin(self, key: str, pin: str, device: str) -> StoredPerson:
        """Return the person with this id and PIN. `device`: the device where it was entered.

        Raises:
            NotFound: the person does not exist.
            LogOnRefused: the PIN is wrong, the person has none, or they are locked out.
        """
        async with self._checking:
            person = await self.get(key)
            if person.pin is None:
                raise LogOnRefused("{name} has no PIN. Use the card.", name=person.name)
            before = await self._require_not_locked_out(person.id, device, person.name)
            if not await asyncio.to_thread(matches, pin, person.pin):
                await self._wrong(person.id, device, before)
                await self._require_not_locked_out(person.id, device, person.name)
                raise LogOnRefused("The PIN of {name} is wrong.", name=person.name)
            if before is not None:
                await self._store.delete_lock_outs(person.id, device)
        return person

    async def check_card(self, card: str, device: str) -> StoredPerson:
        """Return the person with this card. `device`: the device that read it.

        Raise LogOnRefused for an unknown card.
        """
        async with self._checking:
            before = await self._require_not_locked_out(_CARDS, device)
            digest = self._cards.of(card)
            found = None
            for person in await self._store.all():  # all of them, so that the duration reveals nothing
                if person.card is not None and hmac.compare_digest(person.card, digest):
                    found = person
            if found is None:
                await self._wrong(_CARDS, device, before)
                raise LogOnRefused("No person has this card. An administrator can add it.")
            if before is not None:
                await self._store.delete_lock_outs(_CARDS, device)
        return found

    async def _require_not_locked_out(self, key: str, device: str, name: str = "") -> StoredLockOut | None:
        """Return the wrong PINs of a person at a device. Raise LogOnRefused during a lock-out."""
        found = (await self._store.lock_outs(key)).get(device)
        at = time.time()
        if found is None or at > found.until + FORGOTTEN_AFTER:
            return None
        if found.wrong < MAX_WRONG_PINS or at >= found.until:
            return found
        seconds = max(1, round(found.until - at))
        if key == _CARDS:
            raise LogOnRefused("Too many unknown cards at this device. Try again in {seconds} s.", seconds=seconds)
        raise LogOnRefused(
            "{name} entered too many wrong PINs at this device. Try again in {seconds} s, or ask an administrator to "
            "unlock {name}.",
            name=name,
            seconds=seconds,
        )

    async def _wrong(self, key: str, device: str, before: StoredLockOut | None) -> None:
        wrong = (0 if before is None else before.wrong) + 1
        lock_out = 0.0
        if wrong >= MAX_WRONG_PINS:
            lock_out = min(FIRST_LOCK_OUT * 2.0 ** (wrong - MAX_WRONG_PINS), MAX_LOCK_OUT)
            log.warning("person locked out", person=key, device=device, wrong=wrong, seconds=lock_out)
        await self._store.put_lock_out(key, device, StoredLockOut(wrong, time.time() + lock_out))


def shown(person: StoredPerson, lock_outs: list[LockOut] | None = None) -> Person:
    """Return what clients may know of a person."""
    return Person(
        person.id, person.name, person.role.identifier, person.pin is not None, person.card is not None, lock_outs or []
    )


def _stamp(at: float) -> Timestamp:
    return datetime.fromtimestamp(at, UTC).isoformat(timespec="seconds")
