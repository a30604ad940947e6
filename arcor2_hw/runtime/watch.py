"""What is told of devices without being asked: connection, health, alarms, control."""

import threading
import time
from collections.abc import Callable
from typing import Any, Final

from arcor2_hw.data.device import Alarm, Connection, Health
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.exceptions import DeviceTimeout
from arcor2_hw.objects import CollisionObject, Generic, Robot
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.device import Device, overrides
from arcor2_hw.runtime.lane import Job
from arcor2_hw.runtime.messages import DeviceChanged, HeldPart

OBSERVE_PERIOD: Final = 0.25
"""Seconds between two looks at a device's connection and health (memory, by contract)."""
INQUIRY_PERIOD: Final = 1.0
"""Seconds between two looks at alarms and control, for which a driver may have to ask."""

_WITH_REASON: Final = (Connection.LOST, Connection.FAILED)


class Watch:
    """Compares what devices say of their condition with what they said last, and tells changes.

    A connection that changes is told at once, each loss and each return once. `lost` is called after a loss was told.
    """

    def __init__(
        self,
        cell: Cell,
        tell: Callable[[DeviceChanged], None],
        lost: Callable[[Device, str], None] = lambda *_: None,
    ) -> None:
        self._cell = cell
        self._tell = tell
        self._lost = lost
        self._turn = threading.Lock()
        cell.changed = self.glance
        self._pending: dict[str, Job] = {}
        self._known: dict[str, DeviceChanged] = {}
        self._inquired: dict[str, float] = {}

    def look(self) -> None:
        """Begin to look at every device that has something to say."""
        for device in self._cell:
            cls = device.recipe.cls
            if device.instance is None or device.closing:
                continue
            static = not any(overrides(cls, name) for name in ("connection", "health", "alarms", "control_owner"))
            if static and device.id in self._known:
                continue
            before = self._pending.get(device.id)
            if before is not None and not before.ended:
                continue
            job = Job("watch", self._observe, (device, device.instance))
            self._pending[device.id] = job
            try:
                device.watch_lane.submit(job)
            except DeviceTimeout as error:
                job.finish(None, error)

    def glance(self, device: Device) -> None:
        """Look at the connection alone, which is memory. On the thread that keeps it."""
        instance = device.instance
        if instance is not None and not device.closing:
            self._compare(device, instance, None)

    def tell(self, object_id: str, connection: Connection, reason: str = "") -> None:
        """Tell of an object of which there is no instance that could be looked at."""
        health = Health.FAILURE if connection is Connection.FAILED else Health.NORMAL
        with self._turn:
            found = DeviceChanged(object_id, connection, health, [], None, reason)
            if found != self._known.get(object_id):
                self._known[object_id] = found
                self._tell(found)

    def _observe(self, device: Device, instance: Generic) -> None:
        before = self._known.get(device.id)
        alarms: list[Alarm] = [] if before is None else before.alarms
        owner = None if before is None else before.control_owner
        moment = time.monotonic()
        if moment - self._inquired.get(device.id, -INQUIRY_PERIOD) >= INQUIRY_PERIOD:
            self._inquired[device.id] = moment
            alarms = _told(instance.alarms, alarms)
            owner = _told(instance.control_owner, owner)
        health = _told(lambda: instance.health, Health.FAILURE)
        self._compare(device, instance, (health, alarms, owner))

    def _compare(self, device: Device, instance: Generic, asked: tuple[Health, list[Alarm], str | None] | None) -> None:
        with self._turn:  # the connection is read in here, so that what is told last is what was so last
            before = self._known.get(device.id)
            if asked is None:
                asked = (Health.NORMAL, [], None)
                if before is not None:
                    asked = (before.health, before.alarms, before.control_owner)
            connection = _told(lambda: instance.connection, Connection.FAILED)
            reason = _told(device.connection_reason, "") if connection in _WITH_REASON else ""
            was = Connection.OFFLINE if before is None else before.connection
            if before is not None and connection is was:
                reason = before.reason  # that of the loss: what further attempts meet is no news
            in_the_way = _told(lambda: not isinstance(instance, CollisionObject) or instance.enabled, True)
            held = _told(lambda: _held_parts(instance), [])
            found = DeviceChanged(device.id, connection, *asked, reason, in_the_way, held)
            if found == before:
                return
            self._known[device.id] = found
            self._tell(found)
        if connection is Connection.LOST and was is not Connection.LOST:
            self._lost(device, reason)


def _held_parts(instance: Generic) -> list[HeldPart]:
    if not isinstance(instance, Robot):
        return []
    return [
        HeldPart(part.name, part.link, part.in_link, None if part.model is None else ObjectModel.of(part.model))
        for part in instance.parts.values()
    ]


def _told(ask: Callable[[], Any], otherwise: Any) -> Any:
    """Ask; a device that cannot say keeps what was known."""
    try:
        return ask()
    except Exception:  # noqa: BLE001 - a driver may raise anything; the next look asks again
        return otherwise
