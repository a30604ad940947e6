"""The present state of the cell, as the server has sent it."""

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from arcor2_hw.data.alarms import AlarmRecord
from arcor2_hw.data.base import Unset
from arcor2_hw.data.device import Connection
from arcor2_hw.data.events import RobotJointsData
from arcor2_hw.data.points import LivePoint, PointQuality, PointUse, PointValue
from arcor2_hw.data.units import Unit
from arcor2_hw.plant.messages import STALE_AFTER, DeviceInfo, DeviceState, UnitData, Update
from arcor2_hw.plant.streams import decode_stream, time_of

_CONNECTED: Final = (Connection.ONLINE, Connection.BACK)
_NOT_ALLOWED: Final = frozenset("+#/.*>$\0")
"""Characters that MQTT, or NATS as its broker, does not allow in a topic level. Spaces are not allowed either."""


@dataclass(slots=True)
class Point:
    """A point or a joint. time_ms: time of its value since 1970 in UTC, ms."""

    value: PointValue
    unit: str
    quality: PointQuality
    time_ms: int


@dataclass(slots=True)
class Device:
    """A device. level: its name in topics. points: by name. joints: of a robot, by name."""

    info: DeviceInfo
    level: str
    state: DeviceState = field(default_factory=DeviceState)
    points: dict[str, Point] = field(default_factory=dict)
    joints: dict[str, Point] = field(default_factory=dict)
    streamed: float = 0.0

    @property
    def connected(self) -> bool:
        """Whether the device is connected."""
        return self.state.connection in _CONNECTED


class PointName(NamedTuple):
    """Name of a point or joint of a device."""

    device: str
    joint: bool
    name: str


@dataclass(slots=True)
class Changes:
    """Changes by an update: ids of devices, points, and whether the state of the cell has changed."""

    devices: set[str] = field(default_factory=set)
    removed: list[Device] = field(default_factory=list)
    points: list[PointName] = field(default_factory=list)
    unit: bool = False
    alarms: list[AlarmRecord] = field(default_factory=list)
    left: list[Unit] = field(default_factory=list)


def topic_level(name: str) -> str:
    """Return a name with each character that is not allowed in a level of a topic replaced by `_`."""
    return "".join("_" if each in _NOT_ALLOWED or each.isspace() else each for each in name) or "_"


def _levels(infos: Iterable[DeviceInfo]) -> Mapping[str, str]:
    """Return a different topic level for each device, by id."""
    levels: dict[str, str] = {}
    for info in infos:
        level = topic_level(info.name)
        levels[info.id] = level if level not in levels.values() else f"{level}_{topic_level(info.id)}"
    return levels


class CellState:
    """The state of the cell. `apply` changes it."""

    def __init__(self) -> None:
        self.devices: dict[str, Device] = {}
        self.unit = UnitData()
        self.unit_time_ms = 0
        self.alarms: dict[int, AlarmRecord] = {}
        """The alarms that need attention, by number."""

    def apply(self, update: Update) -> Changes:
        """Apply an update and return what it has changed."""
        changes = Changes(alarms=update.alarms, left=update.left)
        if update.devices is not None:
            self._set_devices(update.devices, changes)
        for key, state in update.states.items():
            if (device := self.devices.get(key)) is not None and device.state != state:
                device.state = state
                changes.devices.add(key)
                if not device.connected:
                    _invalidate(device, PointQuality.NOT_CONNECTED, changes)
                elif not state.answering:
                    _invalidate(device, PointQuality.STALE, changes)
        for encoded in update.streams:
            self._stream(encoded, changes)
        if update.unit is not None and (update.unit != self.unit or not self.unit_time_ms):
            self.unit, self.unit_time_ms, changes.unit = update.unit, time.time_ns() // 1_000_000, True
        for alarm in update.alarms:
            if alarm.retain:
                self.alarms[alarm.number] = alarm
            else:
                self.alarms.pop(alarm.number, None)
        return changes

    def expire(self, *, silent: bool) -> Changes:
        """Mark values as stale that are not renewed; all of them if the server is silent."""
        changes = Changes()
        for device in self.devices.values():
            if device.connected and (silent or time.monotonic() - device.streamed > STALE_AFTER):
                _invalidate(device, PointQuality.STALE, changes)
        return changes

    def point(self, name: PointName) -> Point:
        """Return a point that a change names."""
        device = self.devices[name.device]
        return (device.joints if name.joint else device.points)[name.name]

    def _set_devices(self, infos: list[DeviceInfo], changes: Changes) -> None:
        levels, before = _levels(infos), self.devices
        self.devices = {}
        for info in infos:
            device = before.pop(info.id, None)
            if device is not None and device.level != levels[info.id]:
                changes.removed.append(device)
                device = None
            if device is None:
                device = Device(info, levels[info.id])
                changes.devices.add(info.id)
            elif device.info != info:
                device.info = info
                changes.devices.add(info.id)
            self.devices[info.id] = device
        changes.removed += before.values()

    def _stream(self, encoded: bytes, changes: Changes) -> None:
        data = decode_stream(encoded)
        key = data.robot_id if isinstance(data, RobotJointsData) else data.object_id
        if (device := self.devices.get(key)) is None:
            return
        stamp = data.time_ms
        if isinstance(stamp, Unset):
            return
        if isinstance(data, RobotJointsData):
            points = [LivePoint(joint.name, PointUse.SIGNAL, joint.value) for joint in data.joints]
            known = device.joints
        elif isinstance(data.reason, Unset):
            points, known = data.points, device.points
        else:
            return
        device.streamed = time.monotonic()
        at = time_of(stamp / 1e3).timestamp() * 1e3
        for each in points:
            quality = each.quality if device.connected else PointQuality.NOT_CONNECTED
            point = known.get(each.name)
            if point is None or point.value != each.value or point.quality is not quality:
                age = 0.0 if isinstance(each.age, Unset) else each.age
                known[each.name] = Point(each.value, each.unit, quality, round(at - age * 1e3))
                changes.points.append(PointName(key, known is device.joints, each.name))


def _invalidate(device: Device, quality: PointQuality, changes: Changes) -> None:
    """Change the quality of all values of a device, but neither value nor time."""
    for joint, points in ((False, device.points), (True, device.joints)):
        for name, point in points.items():
            if point.quality is not quality:
                point.quality = quality
                changes.points.append(PointName(device.info.id, joint, name))
