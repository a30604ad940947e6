"""The recorder of a cell host: writes the points, joints and actions that the host receives to the ring."""

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from arcor2_hw.data.device import Connection
from arcor2_hw.data.position import MAIN_BRANCH, Frame
from arcor2_hw.data.recordings import SignalKind
from arcor2_hw.data.robot import Joint
from arcor2_hw.messages import Message
from arcor2_hw.objects import Generic
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.lane import Job
from arcor2_hw.runtime.messages import DeviceChanged
from arcor2_hw.runtime.methods import overrides
from arcor2_hw.runtime.ring import Ring, save
from arcor2_hw.runtime.ring_records import (
    ActionEnded,
    ActionStarted,
    Names,
    Record,
    Value,
    Values,
    encode,
)

SEGMENT_TIME: Final = 10.0
"""Time after which a new segment starts, s. The older segments contain 70 s."""
READ_PERIOD: Final = 0.05
"""Minimum time between two conversions of the state of a device to points, s."""
JOINT_DIGITS: Final = 4
"""Decimal places of recorded joints, rad or m: noise of a robot at standstill is not recorded."""
MAX_EVENT: Final = 4096
"""Maximum length of events whose results are recorded, bytes."""
SHOWN_BINARY: Final = frozenset({"gripped", "red", "amber", "green", "blue", "white"})
"""Names of shown values (`Generic.shown_values`) that are on or off."""


class _Source:
    def __init__(self, number: int, kind: SignalKind, object_id: str) -> None:
        self.number, self.kind, self.object_id = number, kind, object_id
        self.names: Names | None = None
        self.values: list[Value] = []


class Recorder:
    """Writes the ring. Any thread calls it; it never waits for a device and raises no errors.

    Args:
        ring: the ring; None if nothing is recorded.
        cell: returns the devices.
    """

    def __init__(self, ring: Ring | None = None, cell: Callable[[], Cell] = Cell) -> None:
        self._ring = ring
        self._cell = cell
        self._lock = threading.Lock()
        self._sources: dict[tuple[str, str], _Source] = {}
        self._running: dict[int, ActionStarted] = {}
        self._due = 0.0
        self._states: dict[str, Any] = {}
        """The state of each device that was converted last."""
        self._reading: dict[str, tuple[Job, float]] = {}

    # -------------------------------------------------------------------------------- devices
    def state_taken(self, device: Device, state: Any) -> None:
        """Record the observations of a device soon, because its driver has read a new state.

        They are read on the lane of observations, so that a driver which waits in them delays only this lane.
        """
        instance = device.instance
        if self._ring is None or instance is None or not device.up:
            return
        moment = time.monotonic()
        job, begun = self._reading.get(device.id, (None, 0.0))
        if (job is not None and not job.ended) or moment - begun < READ_PERIOD:
            return  # a change is noticed when the next state arrives
        if _equal(self._states.get(device.id), state):
            return
        self._states[device.id] = state
        job = Job("observations", self._observe, (instance, moment))
        self._reading[device.id] = job, moment
        device.watch_lane.submit_or_fail(job)

    def _observe(self, instance: Generic, stamp: float) -> None:
        self.observed(instance, instance.observations(), stamp)

    def observed(self, instance: Generic, observations: Sequence[Any], stamp: float) -> None:
        """Record observations of a device."""
        if self._ring is None or not observations:
            return
        self._values(
            "observations",
            SignalKind.POINT,
            instance.id,
            instance.name,
            [each.name for each in observations],
            [each.unit for each in observations],
            [each.value for each in observations],
            stamp,
        )

    def joints(self, robot: Generic, joints: Sequence[Joint]) -> None:
        """Record the joints of a robot."""
        if self._ring is not None:
            names = [joint.name for joint in joints]
            values: list[Value] = [round(joint.value, JOINT_DIGITS) for joint in joints]
            self._values(
                "joints", SignalKind.JOINT, robot.id, robot.name, names, [""] * len(names), values, time.monotonic()
            )

    def device_changed(self, report: DeviceChanged) -> None:
        """Record connection and shown values of a device, except those that its observations contain."""
        stamp, device = time.monotonic(), self._device(report.object_id)
        if self._ring is None or (device is not None and device.remote):
            return  # the host of the object records it
        name = report.object_id if device is None else device.name
        if device is None or overrides(device.recipe.cls, "connection"):
            connected = report.connection in (Connection.ONLINE, Connection.BACK)
            self._values("state", SignalKind.STATE, report.object_id, name, ["connected"], [""], [connected], stamp)
        observed = self._sources.get((report.object_id, "observations"))
        known = set() if observed is None or observed.names is None else {n.casefold() for n in observed.names.names}
        shown: dict[str, Value] = {
            name: bool(value) if name in SHOWN_BINARY else value
            for name, value in report.values.items()
            if name.casefold() not in known
        }
        if shown:
            self._values(
                "shown",
                SignalKind.POINT,
                report.object_id,
                name,
                list(shown),
                [""] * len(shown),
                list(shown.values()),
                stamp,
            )

    def _device(self, object_id: str) -> Device | None:
        return next((device for device in self._cell() if device.id == object_id), None)

    # -------------------------------------------------------------------------------- actions
    def action_started(
        self,
        number: int,
        name: str,
        object_id: str,
        frames: Sequence[Frame] = (),
        branch: str = MAIN_BRANCH,
        call: int = 0,
    ) -> None:
        """Record that an action was announced, or that a call has started."""
        if self._ring is None:
            return
        action_id = frames[-1].action_id if frames else ""
        found = self._device(object_id) if object_id else None
        object_name = "" if found is None else found.name
        record = ActionStarted(time.monotonic(), number, name, action_id, object_id, object_name, branch, call)
        with self._lock:
            self._append(record)
            self._running[number] = record

    def action_ended(self, number: int, waited: float = 0.0, error: Message | None = None, event: bytes = b"") -> None:
        """Record the end of an action. event: the encoded ActionStateAfter."""
        if self._ring is None:
            return
        record = ActionEnded(time.monotonic(), number, waited, error, event if len(event) <= MAX_EVENT else b"")
        with self._lock:
            if self._running.pop(number, None) is not None:
                self._append(record)

    # -------------------------------------------------------------------------------- ring
    def _values(
        self,
        source: str,
        kind: SignalKind,
        object_id: str,
        object_name: str,
        names: list[str],
        units: list[str],
        values: list[Value],
        stamp: float,
    ) -> None:
        key = object_id, source
        with self._lock:
            found = self._sources.get(key)
            if found is None:
                found = self._sources[key] = _Source(len(self._sources), kind, object_id)
            if found.names is None or found.names.names != names or found.names.units != units:
                found.names = Names(found.number, kind, object_id, object_name, names, units)
                self._append(found.names)
            elif found.values == values:
                return
            found.values = values
            self._append(Values(stamp, found.number, values))

    def _append(self, record: Record) -> None:
        assert self._ring is not None
        moment = time.monotonic()
        encoded = encode(record)
        if moment < self._due and self._ring.append(encoded):
            return
        self._due = moment + SEGMENT_TIME
        self._ring.begin_segment()
        for source in self._sources.values():
            if source.names is not None:
                self._ring.append(encode(source.names))
                if len(source.values) == len(source.names.names):
                    self._ring.append(encode(Values(moment, source.number, source.values)))
        for running in self._running.values():
            self._ring.append(encode(running))
        self._ring.append(encoded)

    def save(self, directory: Path, run: int, *, main: bool = True) -> None:
        """Store the ring of a run that the end of the server interrupts, as `ring.save`. Raises OSError."""
        if self._ring is None:
            return
        with self._lock:
            segments = self._ring.segments()
        save(segments, directory, run, main=main)


def _equal(a: Any, b: Any) -> bool:
    try:
        return bool(a == b)
    except Exception:  # noqa: BLE001 - a driver may use any type, such as arrays
        return False
