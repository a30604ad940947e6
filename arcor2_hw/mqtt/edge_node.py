"""The cell as an edge node of Sparkplug B 3.0. Numbers in parentheses are sections of the specification."""

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import msgspec
from aiomqtt import Client, MqttError, Will

from arcor2_hw.data.base import Timestamp
from arcor2_hw.data.packml import MachineState, UnitMode
from arcor2_hw.data.points import PointQuality
from arcor2_hw.mqtt import payload
from arcor2_hw.mqtt.cell import CellState, Changes, Device
from arcor2_hw.mqtt.link import Link, connection, end_if_cancelled
from arcor2_hw.mqtt.messages import Setup, ValuesDropped
from arcor2_hw.mqtt.payload import Kind, Metric, Value

NAMESPACE: Final = "spBv1.0"
MAX_WAITING: Final = 50_000
"""Maximum number of values that wait for the broker or the host. Then the oldest of the longest queue is dropped."""
MAX_IN_MESSAGE: Final = 500
"""Maximum number of values in a message."""
REBIRTH_PERIOD: Final = 1.0
"""Shortest time between two births that hosts request, s."""
DEATH_TIMEOUT: Final = 1.0
"""Time limit for publishing the death certificate, s."""
MAX_COMMAND: Final = 64 * 1024
"""Maximum size of a received message, bytes. Longer ones are ignored."""
SESSION_FILE: Final = "mqtt-session"
"""File with the number of the last session, so that a host never confuses sessions before and after a restart."""
_QUALITY: Final = {
    PointQuality.GOOD: payload.GOOD,
    PointQuality.UNCERTAIN: payload.STALE,
    PointQuality.STALE: payload.STALE,
    PointQuality.BAD: payload.BAD,
    PointQuality.NOT_CONNECTED: payload.BAD,
}
_UNIT: Final[dict[str, tuple[str, Kind]]] = {
    "authority": ("Authority", Kind.STRING),
    "program": ("Program", Kind.STRING),
    "loaded": ("Program Running", Kind.BOOLEAN),
    "recipe": ("Recipe", Kind.STRING),
    "job": ("Job", Kind.INT32),
    "last_job": ("Last Job", Kind.INT32),
    "job_end": ("Job End", Kind.STRING),
    "good": ("Counts/Good", Kind.INT64),
    "bad": ("Counts/Bad", Kind.INT64),
    "rejected": ("Counts/Rejected", Kind.INT64),
}
"""Metrics of the cell by field of UnitData."""
_NODE: Final = ""
"""Key of the edge node among the devices."""


class _State(msgspec.Struct):
    """The state of a host application (host_topic)."""

    online: bool
    timestamp: int


_decode_state: Final = msgspec.json.Decoder(_State).decode
_encode_json: Final = msgspec.json.Encoder().encode


class ValueQueue:
    """Values that wait to be sent, by their owner; `most` in total."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._values: dict[str, deque[Metric]] = {}
        self._count = 0
        self.dropped = 0

    def put(self, owner: str, value: Metric) -> None:
        """Add a value. If too many wait, drop the oldest of the longest queue."""
        self._values.setdefault(owner, deque()).append(value)
        self._count += 1
        if self._count > self._most:
            max(self._values.values(), key=len).popleft()
            self._count -= 1
            self.dropped += 1

    def take(self, owner: str) -> list[Metric]:
        """Remove and return the oldest values of an owner, as many as fit in a message."""
        values = self._values.get(owner)
        if not values:
            return []
        taken = [values.popleft() for _ in range(min(len(values), MAX_IN_MESSAGE))]
        self._count -= len(taken)
        return taken

    def mark_historical(self, owner: str, born: Iterable[Metric]) -> None:
        """Mark the waiting values of an owner as historical, except those in its birth certificate."""
        if values := self._values.pop(owner, None):
            newest = {(metric.alias, metric.time_ms, metric.value, metric.quality) for metric in born}
            kept = deque(
                each._replace(historical=True)
                for each in values
                if (each.alias, each.time_ms, each.value, each.quality) not in newest
            )
            self._values[owner] = kept
            self._count -= len(values) - len(kept)

    def forget(self, owner: str) -> None:
        """Drop the values of a device that was removed."""
        self._count -= len(self._values.pop(owner, ()))


@dataclass(slots=True)
class _Owner:
    """The edge node or a device: its metrics by name, and a version that changes with names and types of metrics."""

    level: str
    alive: bool = False
    version: int = 0
    metrics: dict[str, Metric] = field(default_factory=dict)


class EdgeNode:
    """Publishes birth certificates, data and death certificates.

    Args:
        setup: settings of the process.
        cell: the state of the cell. `changed` has to be called after each change.
        report: sends a message to the server.
    """

    def __init__(self, setup: Setup, cell: CellState, report: Callable[[Any], None]) -> None:
        assert setup.sparkplug is not None
        self._setup, self._names, self._cell, self._report = setup, setup.sparkplug, cell, report
        self._file = Path(setup.folder) / SESSION_FILE
        self._session = self._last_session()
        self._queue = ValueQueue(MAX_WAITING)
        self._aliases: dict[tuple[str, str], int] = {}
        self._owners = {_NODE: _Owner("", alive=True)}
        self._born: dict[str, int] = {}
        """Versions of the owners whose birth certificates were published in this session."""
        self._dying: list[str] = []
        """Topic levels of removed devices whose death certificates have to be published."""
        self._seq = 0
        self._wake = asyncio.Event()
        self._rebirth = False
        self._born_at = 0.0
        self._host_online: bool | None = None
        self._host_time = 0
        self._link = Link("Sparkplug", report)

    # -------------------------------------------------------------------------------- changes
    def changed(self, changes: Changes) -> None:
        """Follow a change of the cell."""
        now = _now_ms()
        initial = not self._owners[_NODE].metrics
        if changes.unit or initial:
            self._put_unit()
        for alarm in changes.alarms[-1:] if initial else changes.alarms:
            at = _ms(alarm.acknowledged_at or alarm.cleared or alarm.raised)
            self._put(_NODE, "Alarms/Last Change", Kind.STRING, _encode_json(alarm).decode(), at)
        if changes.alarms:
            self._put_alarms(now)
        for unit in changes.left:
            self._put(_NODE, "Units/Last", Kind.STRING, _encode_json(unit).decode(), _ms(unit.left or unit.entered))
        for device in changes.removed:
            key = device.info.id
            if self._born.pop(key, None) is not None:
                self._dying.append(device.level)
            self._owners.pop(key, None)
            self._queue.forget(key)
        for key in changes.devices:
            self._put_device(key, self._cell.devices[key], now)
        for name in changes.points:
            point = self._cell.point(name)
            metric = f"Joints/{name.name}" if name.joint else f"Points/{name.name}"
            self._put(
                name.device,
                metric,
                _kind(point.value),
                _number(point.value),
                point.time_ms,
                _QUALITY[point.quality],
                point.unit,
            )
        self._wake.set()

    def _put_unit(self) -> None:
        unit, at = self._cell.unit, self._cell.unit_time_ms or _now_ms()
        for name, value in (("Properties/Product", "ARCOR2-HW"), ("Properties/Version", self._setup.version)):
            self._put(_NODE, name, Kind.STRING, value, at)
        self._put(_NODE, "State", Kind.STRING, MachineState(unit.state).name.capitalize(), at)
        self._put(_NODE, "State Number", Kind.INT32, unit.state, at)
        self._put(_NODE, "Mode", Kind.STRING, UnitMode(unit.mode).name.capitalize(), at)
        for attribute, (name, kind) in _UNIT.items():
            self._put(_NODE, name, kind, getattr(unit, attribute), at)
        if "Units/Last" not in self._owners[_NODE].metrics:
            self._put(_NODE, "Units/Last", Kind.STRING, None, at)
            self._put(_NODE, "Alarms/Last Change", Kind.STRING, None, at)
            self._put_alarms(at)

    def _put_alarms(self, at: int) -> None:
        alarms = self._cell.alarms.values()
        self._put(_NODE, "Alarms/Active", Kind.INT32, sum(each.active for each in alarms), at)
        self._put(_NODE, "Alarms/Unacknowledged", Kind.INT32, sum(not each.acknowledged for each in alarms), at)

    def _put_device(self, key: str, device: Device, at: int) -> None:
        owner = self._owners.get(key)
        if owner is None:
            owner = self._owners[key] = _Owner(device.level)
        info, state = device.info, device.state
        owner.alive = device.connected
        texts = {
            "Connection": state.connection.value,
            "Health": state.health.value,
            "Alarms": ", ".join(state.alarms),
            "Properties/Type": info.type,
            "Properties/Vendor": info.identity.vendor,
            "Properties/Model": info.identity.model,
            "Properties/Serial Number": info.identity.serial,
            "Properties/Firmware": info.identity.firmware,
        }
        for name, text in texts.items():
            self._put(key, name, Kind.STRING, text, at)

    def _put(
        self,
        key: str,
        name: str,
        kind: Kind | None,
        value: Value,
        at: int,
        quality: int | None = None,
        unit: str = "",
    ) -> None:
        """Store the value of a metric, and queue it if it has changed. kind: None if the value is not known."""
        owner = self._owners[key]
        before = owner.metrics.get(name)
        if kind is None:
            kind = Kind.STRING if before is None else before.kind
        if before is None or before.kind is not kind or before.unit != unit:
            owner.version += 1
        elif (before.value, before.quality) == (value, quality):
            return
        alias = self._aliases.setdefault((key, name), len(self._aliases) + 1)
        metric = owner.metrics[name] = Metric(name, alias, kind, value, at, quality, unit)
        if owner.alive:
            self._queue.put(key, metric._replace(name=None, unit=""))

    # -------------------------------------------------------------------------------- sessions
    async def run(self) -> None:
        """Publish until cancelled."""
        await self._link.keep(self._run_session)

    async def _run_session(self) -> None:
        """Run a session until the host goes offline or the connection is lost (edge_node_session_establishment)."""
        self._session = (self._session + 1) % 256
        await asyncio.to_thread(self._store_session)
        self._born, self._host_online, self._rebirth = {}, None, False
        death = Will(self._topic("NDEATH"), self._death(), qos=1, retain=False)
        identifier = f"{self._names.group}/{self._names.node}/sparkplug"
        async with connection(self._setup.broker, identifier, death) as connected:
            receiving = asyncio.create_task(self._receive(connected), name="messages of hosts")
            receiving.add_done_callback(lambda _: self._wake.set())
            try:
                await connected.subscribe(self._topic("NCMD"), qos=1)
                if self._names.primary_host:
                    await connected.subscribe(f"{NAMESPACE}/STATE/{self._names.primary_host}", qos=1)
                self._link.up()
                self._wake.set()
                await self._publish(connected, receiving)
            finally:
                receiving.cancel()
                with contextlib.suppress(MqttError):
                    await connected.publish(death.topic, self._death(), qos=1, timeout=DEATH_TIMEOUT)

    async def _publish(self, connected: Client, receiving: asyncio.Task[None]) -> None:
        """Publish until the host goes offline. Raise MqttError if the connection is lost."""
        while True:
            end_if_cancelled()
            await self._wake.wait()
            self._wake.clear()
            if receiving.done():
                receiving.result()
            if self._names.primary_host and not self._host_online:
                if self._born:
                    return
                continue
            if self._rebirth and (pause := self._born_at + REBIRTH_PERIOD - time.monotonic()) > 0:
                await asyncio.sleep(pause)
            if self._rebirth or not self._born:
                await self._be_born(connected)
            while self._dying:
                await self._send(connected, "DDEATH", self._dying.pop(), [])
            for key, owner in list(self._owners.items()):
                if self._owners.get(key) is owner:  # the device may have been removed in the meantime
                    await self._publish_owner(connected, key, owner)

    async def _receive(self, connected: Client) -> None:
        """Handle the commands and states of hosts. Raise MqttError if the connection is lost."""
        async for message in connected.messages:
            content = message.payload
            if not isinstance(content, bytes) or len(content) > MAX_COMMAND:
                continue
            if message.topic.value == self._topic("NCMD"):
                self._rebirth |= payload.requests_rebirth(content)
            else:
                try:
                    state = _decode_state(content)
                except msgspec.DecodeError:
                    continue
                if state.timestamp >= self._host_time:  # ignore a late will of an older connection of the host
                    self._host_time, self._host_online = state.timestamp, state.online
            self._wake.set()

    # -------------------------------------------------------------------------------- messages
    async def _be_born(self, connected: Client) -> None:
        """Publish the birth certificate of the node. Those of the devices follow."""
        self._rebirth, self._born, self._dying, self._seq = False, {}, [], 0
        self._born_at = time.monotonic()
        owner, now = self._owners[_NODE], _now_ms()
        metrics = list(owner.metrics.values())
        self._born[_NODE] = owner.version
        self._queue.mark_historical(_NODE, metrics)
        control = [
            Metric(payload.SESSION, None, Kind.INT64, self._session, now),
            Metric(payload.REBIRTH, None, Kind.BOOLEAN, False, now),
        ]
        await self._send(connected, "NBIRTH", "", [*control, *metrics])
        if self._queue.dropped:
            self._report(ValuesDropped(self._queue.dropped))
            self._queue.dropped = 0

    async def _publish_owner(self, connected: Client, key: str, owner: _Owner) -> None:
        """Publish the changes of the node or a device: its death or birth, then values."""
        if not owner.alive:
            if key in self._born:
                await self._publish_values(connected, key, owner)
                self._born.pop(key, None)
                await self._send(connected, "DDEATH", owner.level, [])
            return
        if self._born.get(key) != owner.version:
            metrics = list(owner.metrics.values())
            self._born[key] = owner.version
            self._queue.mark_historical(key, metrics)
            await self._send(connected, "DBIRTH", owner.level, metrics)
        await self._publish_values(connected, key, owner)

    async def _publish_values(self, connected: Client, key: str, owner: _Owner) -> None:
        while values := self._queue.take(key):
            # Values from before a change of the type cannot be published any more.
            kinds = {metric.alias: metric.kind for metric in owner.metrics.values()}
            if fitting := [value for value in values if kinds.get(value.alias) is value.kind]:
                await self._send(connected, "DDATA" if owner.level else "NDATA", owner.level, fitting)
            if owner.alive and self._born.get(key) != owner.version:
                return  # a new birth certificate has to come first

    async def _send(self, connected: Client, kind: str, level: str, metrics: list[Metric]) -> None:
        seq, self._seq = self._seq, (self._seq + 1) % 256
        await connected.publish(self._topic(kind, level), payload.encode(metrics, _now_ms(), seq), qos=0)

    def _topic(self, kind: str, device: str = "") -> str:
        topic = f"{NAMESPACE}/{self._names.group}/{kind}/{self._names.node}"
        return f"{topic}/{device}" if device else topic

    def _death(self) -> bytes:
        now = _now_ms()
        return payload.encode([Metric(payload.SESSION, None, Kind.INT64, self._session, now)], now, None)

    # -------------------------------------------------------------------------------- number of the session
    def _last_session(self) -> int:
        try:
            return int(self._file.read_text()) % 256
        except (OSError, ValueError):
            return 255

    def _store_session(self) -> None:
        with contextlib.suppress(OSError):  # without the file, a host may confuse two sessions after a restart
            self._file.write_text(str(self._session))


def _now_ms() -> int:
    return time.time_ns() // 1_000_000


def _ms(stamp: Timestamp) -> int:

    return round(datetime.fromisoformat(stamp).timestamp() * 1e3)


def _kind(value: Value) -> Kind | None:
    """Return the type of the value of a point: all numbers are of type Double. None if the value is not known."""
    if value is None:
        return None
    if isinstance(value, bool):
        return Kind.BOOLEAN
    return Kind.STRING if isinstance(value, str) else Kind.DOUBLE


def _number(value: Value) -> Value:
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
