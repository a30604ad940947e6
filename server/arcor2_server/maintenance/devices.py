"""Device cards: the identity of each device of the workplace, its confirmation, hours and cycles."""

import asyncio
import time
from collections.abc import Callable, Iterable
from typing import Any, Final

import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Data, Unset, now
from arcor2_hw.data.device import Connection, Identity
from arcor2_hw.data.maintenance import BackupInfo, DeviceCard
from arcor2_hw.exceptions import NotFound, StorageError
from arcor2_hw.runtime import messages as m
from arcor2_server.audit import changes as audit
from arcor2_server.background import BackgroundTasks
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event
from arcor2_server.hosts.devices import DeviceBoard
from arcor2_server.storage.maintenance import MaintenanceStore

log = structlog.get_logger(__name__)

PERIOD: Final = 60.0
"""Time between two stores of hours and cycles, s. If the server crashes, at most this time is lost."""
_CONNECTED: Final = (Connection.ONLINE, Connection.BACK)


class AuditedDevice(Data, frozen=True):
    """A confirmed identity, or restored parameters, in the audit trail."""

    kind: str
    id: str
    before: Any
    after: Any


class Devices:
    """The devices of the workplace, by the id of their scene object.

    Args:
        hub: publishes DeviceCardChanged.
        store: stores the cards.
        send: sends a message to the hosts of the scene and of the program.
        clock: the monotonic clock, s.
    """

    def __init__(
        self,
        hub: EventHub,
        store: MaintenanceStore,
        send: Callable[[m.ToHost], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._hub, self._store, self._send, self._clock = hub, store, send, clock
        self._cards: dict[str, DeviceCard] = {}
        self._connected: dict[tuple[str, str], float] = {}
        """Times at which the connected devices were last counted, by session and object."""
        self._unwritten: set[str] = set()
        self._writing = asyncio.Lock()
        self._background = BackgroundTasks()

    async def open(self) -> None:
        """Read the stored cards. Raise StorageError if they cannot be read."""
        self._cards = {card.object_id: card for card in await self._store.cards()}
        for info in sorted(await self._store.backups(), key=lambda each: each.at, reverse=True):
            if (card := self._cards.get(info.object_id)) is not None:
                card.backups.append(info)

    def start(self) -> None:
        """Start to store hours and cycles periodically."""
        self._background.spawn(self._repeat(), "hours of devices")

    async def close(self) -> None:
        """Store the remaining changes."""
        async with self._writing:  # a write is not interrupted
            await self._background.cancel()
        self._count_hours()
        await self._write()

    # -------------------------------------------------------------------------------- reports
    def watch(self, board: DeviceBoard, source: str) -> None:
        """Follow devices. `source` names the online scene or the program."""
        board.on_identified.append(self._identified)
        board.on_report.append(lambda report: self._reported((source, report.object_id), report))
        board.on_clear.append(lambda objects: self._gone(source, objects))

    def _identified(self, message: m.DeviceIdentified) -> None:
        before = self._cards.get(message.object_id)
        found, at = message.identity, now()
        known: dict[str, Any] = {
            "name": message.name,
            "object_type": message.object_type,
            "parameters": message.parameters,
            "restores": message.restores,
            "problem": UNSET,
            "key": UNSET,
            "values": UNSET,
        }
        if found is None:
            if before is not None and message.problem is not None:
                problem = message.problem
                self._changed(replace(before, **{**known, "problem": problem.text, **problem.translation()}))
            return
        if before is None:
            card = DeviceCard(message.object_id, message.name, message.object_type, found, at, at, at)
            log.info("device seen first", object=message.name, identity=found)
        elif differing := before.identity.differences(found):
            card = replace(before, found=found, differing=differing)
            log.warning("different device", object=message.name, identity=found, confirmed=before.identity)
        else:  # fields that were not reported before are completed
            card = replace(before, identity=_completed(before.identity, found), found=UNSET, differing=[])
        if message.counters is not None and not card.differing:
            known["counters"] = message.counters
        self._changed(replace(card, seen=at, **known))

    def _reported(self, key: tuple[str, str], report: m.DeviceChanged) -> None:
        if report.connection in _CONNECTED:
            self._connected.setdefault(key, self._clock())
        else:
            self._disconnected(key)

    def _gone(self, source: str, objects: Iterable[str]) -> None:
        for object_id in objects:
            self._disconnected((source, object_id))

    def _disconnected(self, key: tuple[str, str]) -> None:
        self._count(key)
        self._connected.pop(key, None)

    def acted(self, object_id: str) -> None:
        """Count an action of a device."""
        if (card := self._cards.get(object_id)) is not None:
            self._put(replace(card, cycles=card.cycles + 1))

    def _count(self, key: tuple[str, str]) -> None:
        since, card = self._connected.get(key), self._cards.get(key[1])
        if since is not None and card is not None:
            at = self._connected[key] = self._clock()
            self._put(replace(card, hours=card.hours + (at - since) / 3600.0))

    def _count_hours(self) -> None:
        for key in list(self._connected):
            self._count(key)

    # -------------------------------------------------------------------------------- queries
    def all(self) -> list[DeviceCard]:
        """Return all cards by name."""
        self._count_hours()
        return sorted(self._cards.values(), key=lambda card: (card.name.casefold(), card.object_id))

    def get(self, object_id: str) -> DeviceCard:
        """Return the card of a device. Raise NotFound if it was never connected, or has no identity."""
        if (card := self._cards.get(object_id)) is None:
            raise NotFound("The device {object_id!r} was never identified.", object_id=object_id)
        return card

    def identities(self) -> dict[str, Identity]:
        """Return the confirmed identities of all devices."""
        return {key: card.identity for key, card in self._cards.items()}

    # -------------------------------------------------------------------------------- changes
    async def confirm(self, object_id: str, identity: Identity, by: str) -> DeviceCard:
        """Accept the connected device. Hours and cycles of another serial number or model start from zero.

        Raises:
            NotFound: the device was never identified.
            RequestRefused: it is already confirmed, or a device other than `identity` is connected by now.
        """
        card = self.get(object_id)
        if isinstance(card.found, Unset):
            raise RequestRefused("{name} is the confirmed device already.", name=card.name)
        if card.found != identity:
            raise RequestRefused(
                "A different device is now connected as {name}. Check its identity again.", name=card.name
            )
        before, at = card.identity, now()
        if set(card.differing) - {"firmware"}:
            self._count_hours()  # hours and cycles of the previous device
            card = replace(card, hours=0.0, cycles=0, counters={}, counted_since=at)
        card = replace(card, identity=identity, found=UNSET, differing=[], confirmed_at=at, confirmed_by=by)
        await self._store.put([card])
        audit.record([AuditedDevice("device_identity", object_id, before, identity)])
        log.warning("device confirmed", object=card.name, identity=identity, before=before, user=by)
        self._send(m.ConfirmIdentity(object_id, identity))
        self._changed(card)
        return card

    def set_backups(self, object_id: str, backups: list[BackupInfo]) -> None:
        """Set the backups of a device, newest first."""
        self._changed(replace(self.get(object_id), backups=backups))

    def _put(self, card: DeviceCard) -> None:
        self._cards[card.object_id] = card
        self._unwritten.add(card.object_id)

    def _changed(self, card: DeviceCard) -> None:
        self._put(card)
        self._hub.broadcast(make_event("DeviceCardChanged", card))
        self._background.spawn(self._write(), "device cards")

    async def _repeat(self) -> None:
        while True:
            await asyncio.sleep(PERIOD)
            self._count_hours()
            await self._write()

    async def _write(self) -> None:
        async with self._writing:
            keys, self._unwritten = self._unwritten, set()
            if not keys:
                return
            try:
                await self._store.put([self._cards[key] for key in sorted(keys)])
            except StorageError as error:
                self._unwritten |= keys
                log.warning("device cards not stored", reason=str(error))


def _completed(known: Identity, found: Identity) -> Identity:
    """Return the known identity, updated with the reported fields."""
    fields = {name: getattr(found, name) or getattr(known, name) for name in Identity.__struct_fields__}
    return Identity(**fields)
