"""The cell as plain JSON below one prefix.

docs/how-to/mqtt.md describes the topics, docs/reference/mqtt-schema.json their content.
"""

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any, Final

import msgspec
from aiomqtt import Client, MqttError, Will
from msgspec import Struct

from arcor2_hw.data.alarms import AlarmRecord
from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.data.device import Connection, Health, Identity
from arcor2_hw.data.packml import MachineState, UnitMode
from arcor2_hw.data.points import PointQuality, PointValue
from arcor2_hw.data.units import Unit
from arcor2_hw.mqtt.cell import CellState, Changes, Device, Point
from arcor2_hw.mqtt.link import Link, connection, end_if_cancelled
from arcor2_hw.mqtt.messages import Setup, ValuesDropped

POINTS_PERIOD: Final = 1.0
"""Shortest time between two messages with the points of a device, s."""
MAX_EVENTS: Final = 10_000
"""Maximum number of changes of alarms and units that left the cell that wait for the broker; the oldest are dropped."""
DEATH_TIMEOUT: Final = 1.0
"""Time limit for publishing that the cell is offline, s."""
ONLINE: Final = b"online"
OFFLINE: Final = b"offline"


class CellTopic(Struct, frozen=True):
    """`PREFIX/state`: the cell. job: number of the plant's running job, 0 for none. program_running: of `program`."""

    time: Timestamp
    state: str
    mode: str
    authority: str
    program: str
    program_running: bool
    recipe: str
    job: int
    last_job: int
    job_end: str


class CountsTopic(Struct, frozen=True):
    """`PREFIX/counts`: units that left the cell since it exists."""

    time: Timestamp
    good: int
    bad: int
    rejected: int


class AlarmsTopic(Struct, frozen=True):
    """`PREFIX/alarms`: the alarms that need attention, oldest first."""

    time: Timestamp
    alarms: list[AlarmRecord]


class DeviceTopic(Struct, frozen=True):
    """`PREFIX/devices/DEVICE/state`: a device. alarms: codes of its active alarms."""

    time: Timestamp
    id: str
    name: str
    type: str
    identity: Identity
    connection: Connection
    health: Health
    alarms: tuple[str, ...]


class PointTopic(Struct, frozen=True):
    """The value of a point or joint. time: of the value. unit: of a number, may be empty."""

    time: Timestamp
    value: PointValue
    quality: PointQuality
    unit: str


class PointsTopic(Struct, frozen=True):
    """`PREFIX/devices/DEVICE/points`: the points of a device, and the joints of a robot, by name."""

    points: dict[str, PointTopic]
    joints: dict[str, PointTopic]


RETAINED: Final = (CellTopic, CountsTopic, AlarmsTopic, DeviceTopic, PointsTopic)
"""The content of the retained topics. `PREFIX/alarms/changed` has AlarmRecord, `PREFIX/results` has Unit."""
_encode: Final = msgspec.json.Encoder().encode


class PlainJson:
    """Publishes the cell as plain JSON.

    Args:
        setup: settings of the process.
        cell: the state of the cell. `changed` has to be called after each change.
        report: sends a message to the server.
    """

    def __init__(self, setup: Setup, cell: CellState, report: Callable[[Any], None]) -> None:
        self._setup, self._cell, self._report = setup, cell, report
        self._prefix = setup.prefix
        self._link = Link("JSON", report)
        self._events: deque[tuple[str, bytes]] = deque()
        self._dropped = 0
        self._changed: set[str] = set()
        """Names of the retained topics to publish, below the prefix, without those of points."""
        self._points: set[str] = set()
        """Ids of the devices whose points have changed."""
        self._points_at = 0.0
        self._known = False
        self._wake = asyncio.Event()

    def changed(self, changes: Changes) -> None:
        """Follow a change of the cell."""
        if changes.unit:
            self._changed |= {"state", "counts"}
        if changes.alarms:
            self._changed.add("alarms")
        if self._known:  # the first update contains all alarms that need attention
            for alarm in changes.alarms:
                self._put_event("alarms/changed", _encode(alarm))
        for unit in changes.left:
            self._put_event("results", _encode(unit))
        self._changed |= {f"devices/{device.level}" for device in changes.removed}
        self._changed |= {f"devices/{self._cell.devices[key].level}" for key in changes.devices}
        self._points |= {name.device for name in changes.points}
        self._known = True
        self._wake.set()

    def _put_event(self, topic: str, content: bytes) -> None:
        self._events.append((topic, content))
        if len(self._events) > MAX_EVENTS:
            self._events.popleft()
            self._dropped += 1

    # -------------------------------------------------------------------------------- sessions
    async def run(self) -> None:
        """Publish until cancelled."""
        await self._link.keep(self._run_session)

    async def _run_session(self) -> None:
        """Publish everything, then changes, until the connection is lost."""
        status = f"{self._prefix}/status"
        broker = self._setup.broker
        will = Will(status, OFFLINE, qos=1, retain=True)
        async with connection(broker, f"{self._prefix}/json", will) as connected:
            watching = asyncio.create_task(self._watch(connected), name="connection of JSON")
            watching.add_done_callback(lambda _: self._wake.set())
            try:
                everything = f"{self._prefix}/devices/+/+"
                await connected.subscribe(everything, qos=1)
                self._changed |= {"state", "counts", "alarms"}
                self._changed |= {f"devices/{device.level}" for device in self._cell.devices.values()}
                self._points |= set(self._cell.devices)
                await self._publish(connected)
                await connected.publish(status, ONLINE, qos=1, retain=True)
                await connected.unsubscribe(everything)
                self._link.up()
                if self._dropped:
                    self._report(ValuesDropped(self._dropped))
                    self._dropped = 0
                while True:
                    end_if_cancelled()
                    with contextlib.suppress(TimeoutError):
                        async with asyncio.timeout(POINTS_PERIOD if self._points else None):
                            await self._wake.wait()
                    self._wake.clear()
                    if watching.done():
                        watching.result()
                    await self._publish(connected)
            finally:
                watching.cancel()
                with contextlib.suppress(MqttError):
                    await connected.publish(status, OFFLINE, qos=1, retain=True, timeout=DEATH_TIMEOUT)

    async def _watch(self, connected: Client) -> None:
        """Find retained topics of devices that no longer exist. Raise MqttError if the connection is lost."""
        start = len(self._prefix.split("/")) + 1
        async for message in connected.messages:
            level = message.topic.value.split("/")[start]
            if message.retain and level not in {device.level for device in self._cell.devices.values()}:
                self._changed.add(f"devices/{level}")
                self._wake.set()

    # -------------------------------------------------------------------------------- messages
    async def _publish(self, connected: Client) -> None:
        while self._events:
            topic, content = self._events[0]
            await connected.publish(f"{self._prefix}/{topic}", content, qos=1)
            if self._events and self._events[0][1] is content:
                self._events.popleft()  # the broker has received it
        for topic in sorted(self._changed):
            self._changed.discard(topic)
            for name, value in self._contents(topic):
                encoded = None if value is None else _encode(value)
                try:
                    await connected.publish(f"{self._prefix}/{name}", encoded, qos=1, retain=True)
                except BaseException:
                    self._changed.add(topic)
                    raise
        if time.monotonic() - self._points_at >= POINTS_PERIOD:
            self._points_at = time.monotonic()
            devices, self._points = self._points, set()
            for key in devices:
                if (device := self._cell.devices.get(key)) is not None:
                    points = _encode(PointsTopic(_points(device.points), _points(device.joints)))
                    topic = f"{self._prefix}/devices/{device.level}/points"
                    await connected.publish(topic, points, qos=0, retain=True)

    def _contents(self, topic: str) -> list[tuple[str, Any]]:
        """Return the topics below the prefix with their content; None to remove a topic."""
        unit, at = self._cell.unit, _time(self._cell.unit_time_ms)
        if topic == "state":
            state, mode = MachineState(unit.state).name.lower(), UnitMode(unit.mode).name.lower()
            return [
                (
                    topic,
                    CellTopic(
                        at, state, mode, unit.authority, unit.program, unit.loaded, unit.recipe,
                        unit.job, unit.last_job, unit.job_end,
                    ),
                )
            ]  # fmt: skip
        if topic == "counts":
            return [(topic, CountsTopic(at, unit.good, unit.bad, unit.rejected))]
        if topic == "alarms":
            return [(topic, AlarmsTopic(now(), list(self._cell.alarms.values())))]
        level = topic.removeprefix("devices/")
        device = next((each for each in self._cell.devices.values() if each.level == level), None)
        if device is None:
            return [(f"{topic}/state", None), (f"{topic}/points", None)]
        return [(f"{topic}/state", _device(device))]


def _device(device: Device) -> DeviceTopic:
    info, state = device.info, device.state
    return DeviceTopic(
        now(), info.id, info.name, info.type, info.identity, state.connection, state.health, state.alarms
    )


def _points(points: dict[str, Point]) -> dict[str, PointTopic]:
    return {
        name: PointTopic(_time(point.time_ms), point.value, point.quality, point.unit) for name, point in points.items()
    }


def _time(milliseconds: int) -> Timestamp:
    return datetime.fromtimestamp(milliseconds / 1e3, UTC).isoformat(timespec="milliseconds")


def schema() -> dict[str, Any]:
    """Return the JSON schema of the contents."""
    contents = (*RETAINED, AlarmRecord, Unit)
    references, components = msgspec.json.schema_components(contents, ref_template="#/$defs/{name}")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "oneOf": list(references), "$defs": components}
