"""Observation of devices: reports changes of connection, health, alarms, control owner and visible state."""

import threading
import time
from collections.abc import Callable
from typing import Any, Final

from msgspec.structs import replace

from arcor2_hw.data.device import Alarm, Connection, Health
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.messages import Message
from arcor2_hw.objects import CollisionObject, Generic, Robot
from arcor2_hw.objects.conditions import conditions_of
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.identification import ALARM
from arcor2_hw.runtime.lane import Job
from arcor2_hw.runtime.messages import DeviceChanged, HeldPart
from arcor2_hw.runtime.methods import overrides

OBSERVE_PERIOD: Final = 0.25
"""Period of the check of connection and health, s. Reading them does no I/O."""
INQUIRY_PERIOD: Final = 1.0
"""Period of the check of alarms and control owner, s. A driver may query the device for them."""

_OBSERVED: Final = (Connection.ONLINE, Connection.BACK)
_CHANGING: Final = ("connection", "health", "alarms", "control_owner", "shown_values")
"""Members of Generic that a device with a changing state overrides."""
_WITH_REASON: Final = (Connection.LOST, Connection.FAILED)


class Watch:
    """Compare the state of devices with that of the last check and report changes.

    Args:
        cell: The devices.
        post: Sends a report.
        lost: Called after the report when a connection was lost, with the device and the reason.
    """

    def __init__(
        self,
        cell: Cell,
        post: Callable[[DeviceChanged], None],
        lost: Callable[[Device, Message | None], None] = lambda *_: None,
    ) -> None:
        self._cell = cell
        self._post = post
        self._lost = lost
        self._lock = threading.Lock()
        cell.changed = self.check_connection
        cell.conditions_changed = self.check_conditions
        self._pending: dict[str, Job] = {}
        self._reported: dict[str, DeviceChanged] = {}
        self._queried_at: dict[str, float] = {}

    def check_all(self) -> None:
        """Start the check of every device whose state can change."""
        for device in self._cell:
            static = not any(overrides(device.recipe.cls, name) for name in _CHANGING)
            if not static or device.id not in self._reported or device.id not in self._queried_at:
                self._start(device)

    def _start(self, device: Device) -> None:
        """Start the check of a device, unless one is in progress or its own host checks it."""
        before = self._pending.get(device.id)
        if device.remote or device.instance is None or device.closing or (before is not None and not before.ended):
            return
        job = Job("watch", self._observe, (device, device.instance))
        self._pending[device.id] = job
        device.watch_lane.submit_or_fail(job)

    def check_connection(self, device: Device) -> None:
        """Check only the connection, without I/O. Runs on the thread that observes the connection."""
        instance = device.instance
        if instance is not None and not device.closing:
            self._compare(device, instance, None)

    def check_conditions(self, device: Device) -> None:
        """Query the alarms of a device soon, because it has reported a condition. It neither waits nor does I/O."""
        self._queried_at.pop(device.id, None)
        self._start(device)

    def report(self, object_id: str, connection: Connection, reason: Message | None = None) -> None:
        """Report the connection of an object that has no instance."""
        health = Health.FAILURE if connection is Connection.FAILED else Health.NORMAL
        with self._lock:
            before = self._reported.get(object_id)
            found = DeviceChanged(object_id, connection, health, [], None, reason, stamp=time.monotonic())
            if before is None or found != replace(before, stamp=found.stamp):
                self._reported[object_id] = found
                self._post(found)

    def _observe(self, device: Device, instance: Generic) -> None:
        before = self._reported.get(device.id)
        alarms: list[Alarm] = [] if before is None else before.alarms
        owner = None if before is None else before.control_owner
        moment = time.monotonic()
        if moment - self._queried_at.get(device.id, -INQUIRY_PERIOD) >= INQUIRY_PERIOD:
            self._queried_at[device.id] = moment
            alarms = _with_first_times(_value_or(instance.alarms, alarms), alarms)
            alarms = _with_identification(alarms, device)
            owner = _plain(_value_or(instance.control_owner, owner))
        health = _value_or(lambda: instance.health, Health.FAILURE)
        self._compare(device, instance, (health, alarms, owner))

    def _compare(
        self, device: Device, instance: Generic, queried: tuple[Health, list[Alarm], str | None] | None
    ) -> None:
        with self._lock:  # reading under the lock ensures that the last report is the last state
            before = self._reported.get(device.id)
            if queried is None:
                queried = (Health.NORMAL, [], None)
                if before is not None:
                    queried = (before.health, before.alarms, before.control_owner)
            connection = _value_or(lambda: instance.connection, Connection.FAILED)
            why = _value_or(device.connection_reason, None) if connection in _WITH_REASON else None
            was = Connection.OFFLINE if before is None else before.connection
            if before is not None and connection is was:
                why = before.reason  # keep the reason of the loss; later attempts to connect may fail for other reasons
            in_the_way = _value_or(lambda: not isinstance(instance, CollisionObject) or instance.enabled, True)
            held = _value_or(lambda: _held_parts(instance), [])
            values = _value_or(lambda: dict(instance.shown_values), {}) if connection in _OBSERVED else {}
            stamp = time.monotonic() if before is None or connection is not was else before.stamp
            raised = _raised(instance, queried[1], {} if before is None else before.raised)
            found = DeviceChanged(device.id, connection, *queried, why, in_the_way, held, values, stamp, raised)
            if found == before:
                return
            self._reported[device.id] = found
            self._post(found)
        if connection is not was and (connection is Connection.LOST or (connection is Connection.FAILED and device.up)):
            self._lost(device, why)


def _with_identification(alarms: list[Alarm], device: Device) -> list[Alarm]:
    """Return alarms with that of a device that is not the confirmed one."""
    alarm = None if device.identification is None else device.identification.alarm
    return [*(each for each in alarms if each.code != ALARM), *([] if alarm is None else [alarm])]


def _plain(owner: str | None) -> str | None:
    return None if owner is None else str(owner)  # the text may be a Phrase, which cannot be encoded


def _with_first_times(alarms: list[Alarm], before: list[Alarm]) -> list[Alarm]:
    """Return alarms with the times of the last report, for drivers that state the present time at every reading."""
    since = {alarm.code: alarm.since for alarm in before}
    return [replace(alarm, since=since.get(alarm.code, alarm.since)) for alarm in alarms]


def _raised(instance: Generic, alarms: list[Alarm], before: dict[str, float]) -> dict[str, float]:
    """Return the time at which each alarm became active: as reported by the driver, or when it was first observed."""
    found = {}
    for code in (alarm.code for alarm in alarms):
        found[code] = conditions_of(instance).raised(code) or before.get(code) or time.monotonic()
    return found


def _held_parts(instance: Generic) -> list[HeldPart]:
    if not isinstance(instance, Robot):
        return []
    return [
        HeldPart(part.name, part.link, part.in_link, None if part.model is None else ObjectModel.of(part.model))
        for part in instance.parts.values()
    ]


def _value_or(query: Callable[[], Any], otherwise: Any) -> Any:
    """Return the result of a query, or `otherwise` if it raises."""
    try:
        return query()
    except Exception:  # noqa: BLE001 - a driver may raise anything; the next check tries again
        return otherwise
