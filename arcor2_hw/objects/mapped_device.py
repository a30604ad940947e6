"""MappedDevice: a device on Modbus whose points are class data. A mixin of object types, before Generic.

`arcor2-hw device new NAME --from-map FILE` writes such a type (docs/how-to/modbus-device-from-a-map.md).
"""

import contextlib
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, ClassVar, Final, TypeAlias

from arcor2_hw.actions import observation
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.device import Identity, Observation, Reading
from arcor2_hw.data.modbus_point import Point, Table, Value
from arcor2_hw.data.points import LivePoint, PointQuality, PointUse
from arcor2_hw.exceptions import DeviceError, DeviceFault, DeviceTimeout, NotFound, OutOfRange, Refused
from arcor2_hw.messages import Phrase
from arcor2_hw.objects.edges import Debounced
from arcor2_hw.objects.modbus_device import ModbusDevice
from arcor2_hw.objects.modbus_link import ModbusLink
from arcor2_hw.objects.modbus_settings import ModbusSettings
from arcor2_hw.objects.observing import GoOn
from arcor2_hw.objects.small import quality_of
from arcor2_hw.objects.state_observer import Snapshot

Values: TypeAlias = Mapping[str, Value]
"""Values of points by name."""
Wait: TypeAlias = tuple[Values, float]
"""The values that are awaited, and the time limit, s."""
Block: TypeAlias = tuple[Table, int, int, list[str]]
"""A request that reads adjacent points: table, first address, number of items, names of the points."""
MAX_READ_COUNT: Final[Mapping[Table, int]] = {
    "coil": 2000,
    "discrete_input": 2000,
    "holding_register": 125,
    "input_register": 125,
}
"""Maximum number of items of one request (Modbus application protocol 1.1b3, section 6)."""

_USES: Final[Mapping[Table, PointUse]] = {"coil": PointUse.OUTPUT, "discrete_input": PointUse.INPUT}


class MappedDevice(ModbusDevice[dict[str, Any]]):
    """A device whose points are declared in POINTS. Its state is a dictionary of their values.

    A driver calls `use_map` in `__init__`, and `execute` and `put` in its actions.
    """

    POINTS: ClassVar[Mapping[str, Point]] = {}
    BUSY: ClassVar[Values] = {}
    """Values of points while the device executes a command."""
    STOP: ClassVar[Values] = {}
    """Values that are written to stop the device."""
    TAKE_CONTROL: ClassVar[Values] = {}
    RELEASE_CONTROL: ClassVar[Values] = {}
    """Values that are written to take and to release control."""
    OWNER: ClassVar[str] = ""
    """Point with the texts `us`, `nobody`, and others for other owners of control; empty: not reported."""
    FAULT: ClassVar[str] = ""
    """Point with the number of the fault, 0 for none; the codes in ALARMS are these numbers."""
    HEARTBEAT: ClassVar[str] = ""
    """Point to which a changing number is written every HEARTBEAT_PERIOD s while we have control."""
    HEARTBEAT_PERIOD: ClassVar[float] = 0.2

    def use_map(self, settings: ModbusSettings) -> None:
        """Create the connection without opening it."""
        self.link = ModbusLink.of(self.name, settings)
        self._blocks = blocks(self.POINTS)
        self._debounced: dict[str, Debounced] = {}
        self._beats, self._beat_at = 0, 0.0
        # A reading in progress and another one. Each request may be repeated after draining a serial line.
        self.answers_within = 3.0 * settings.request_timeout * (len(self._blocks) + 1)
        self.use_link(self.link)

    # -------------------------------------------------------------------------------- state
    def open_link(self, timeout: float) -> Snapshot[dict[str, Any]]:
        """Open the connection and forget debounced values."""
        self._debounced = {name: Debounced(name, point.debounce) for name, point in self.POINTS.items()}
        return super().open_link(timeout)

    def read_state(self) -> dict[str, Any]:
        """Read all points that can be read. Raises ValueError for a number without a text."""
        values: dict[str, Any] = {}
        for table, first, count, names in self._blocks:
            at = time.monotonic()
            words = getattr(self.link, f"read_{table}s")(first, count)
            for name in names:
                point = self.POINTS[name]
                offset = point.address - first
                try:
                    value = point.value(words[offset : offset + point.size])
                except ValueError as error:
                    raise ValueError(f"{name} {error}") from None
                if point.debounce:
                    self._debounced[name].take(bool(value), at)
                    value = bool(self._debounced[name].value)
                values[name] = value
        return values

    def read(self, name: str) -> Reading[Any]:
        """Return the value of a point, requested after this call: debounced, in its unit. Raises NotFound."""
        values, asked, stamp = self._polled.fresh()
        if name not in values:
            raise NotFound("{device} has no point {name!r} that can be read", device=self.who, name=name)
        return Reading(values[name], stamp, asked)

    @observation
    def point(self, name: str) -> Reading[float]:
        """Return the newest value of a point that is a number. Raises NotFound, Stale, ConnectionLost."""
        return self._newest(name, int | float)

    @observation
    def point_on(self, name: str) -> Reading[bool]:
        """Return the newest value of a point that is a boolean. Raises NotFound, Stale, ConnectionLost."""
        return self._newest(name, bool)

    def _newest(self, name: str, kind: Any) -> Reading[Any]:
        values, asked, stamp = self._polled.current()
        value = values.get(name)
        if not isinstance(value, kind) or isinstance(value, bool) != (kind is bool):
            raise NotFound("{device} has no point {name!r} of this type", device=self.who, name=name)
        return Reading(value, stamp, asked)

    def observations(self) -> list[Observation]:
        """Return all points that are numbers or booleans. Raises Stale, NotConnected, ConnectionLost."""
        values = self.current()
        return [
            Observation(name, value, self.POINTS[name].unit)
            for name, value in values.items()
            if isinstance(value, bool | int | float)
        ]

    def live_points(self) -> list[LivePoint]:
        """Return all points that can be read, with their newest values."""
        values: Mapping[str, Any] = {}
        age: float | Unset = UNSET
        quality = PointQuality.GOOD
        try:
            values, asked, _ = self._polled.current()
            age = round(time.monotonic() - asked, 3)
        except DeviceError as error:
            quality = quality_of(error)
        return [
            LivePoint(name, _USES.get(point.table, PointUse.REGISTER), values.get(name), point.unit, quality, age)
            for name, point in self.POINTS.items()
            if point.readable
        ]

    def wait_for_value(self, name: str, value: Value, timeout: float) -> None:
        """Wait until a point has a value. Raises DeviceTimeout after `timeout` s, Cancelled."""
        what = f"{name} becoming {value}"
        self.wait(lambda values: values[name] == value, timeout, what, self.begin(what))

    def identify(self) -> Identity:
        """Read the identification; for a device without function 43/14 return the name of the type."""
        try:
            return super().identify()
        except DeviceFault:
            return Identity(model=type(self).__name__)

    def on_state(self, snapshot: Snapshot[dict[str, Any]]) -> None:
        """Set the alarm of the fault."""
        for code in self.ALARMS if self.FAULT else ():
            self.set_alarm(code, code == str(self.fault_of(snapshot.value)))

    def after_reading(self) -> None:
        """Write the heartbeat, and repeat it without an answer. If the device refuses it, we have lost control."""
        now = time.monotonic()
        if not self.HEARTBEAT or not self.in_control or now - self._beat_at < self.HEARTBEAT_PERIOD:
            return
        point = self.POINTS[self.HEARTBEAT]
        self._beats, self._beat_at = (self._beats + 1) % (2 if point.kind is bool else 256), now
        try:
            self.repeat_once(lambda: self._write(point, [self._beats]))
        except DeviceFault as error:
            self.drop_control(Phrase.of("{reason}", reason=error))

    # -------------------------------------------------------------------------------- hooks of PolledControl
    def is_busy(self, state: dict[str, Any]) -> bool:
        """Return whether the device executes a command."""
        return bool(self.BUSY) and _has(state, self.BUSY)

    def send_stop(self) -> None:
        """Write STOP."""
        self._write_all(self.STOP)

    def arm(self) -> None:
        """Write TAKE_CONTROL."""
        self._write_all(self.TAKE_CONTROL)

    def disarm(self) -> None:
        """Write RELEASE_CONTROL."""
        self._write_all(self.RELEASE_CONTROL)

    def owner_of(self, state: dict[str, Any]) -> str | None:
        """Return the owner of control that the device reports."""
        if not self.OWNER:
            return super().owner_of(state)
        owner = str(state[self.OWNER])
        return None if owner == "nobody" else owner

    def fault_of(self, state: dict[str, Any]) -> int:
        """Return the number of the fault."""
        return int(state[self.FAULT]) if self.FAULT else 0

    # -------------------------------------------------------------------------------- commands
    def put(self, what: str, values: Values, go_on: GoOn | None = None) -> None:
        """Write values to points, in order, each in one request.

        Raises:
            OutOfRange: A value is not allowed; nothing was written.
            NotInControl: We do not have control.
        """
        self._send(what, self._encoded(values), go_on)

    def put_verified(self, name: str, value: Value) -> None:
        """Write a value and read it back. Raises Refused if the device did not accept it, and as `put`."""
        self.put(f"setting {name}", {name: value})
        point = self.POINTS[name]
        if point.words(found := self.fresh()[name]) != point.words(value):
            raise Refused(
                "{device}: {name} is {found} after {value} was written",
                device=self.who,
                name=name,
                found=found,
                value=value,
            )

    def execute(
        self,
        what: str,
        write: Values,
        *,
        acknowledge: Wait | None = None,
        done: Wait | None = None,
        ok: Values | None = None,
        after: Values | None = None,
    ) -> dict[str, Any]:
        """Execute a command with its handshake, and return the state of the device at its end.

        Args:
            what: Name of the command, for errors.
            write: Values that start the command.
            acknowledge: Values by which the device shows that it has accepted the command.
            done: Values by which it shows that it has finished.
            ok: Values at the end of a successful execution.
            after: Values that are written at the end in any case, such as the start signal off.

        Raises:
            Refused: The device is busy.
            OutOfRange: A value is not allowed; nothing was written.
            DeviceTimeout: An awaited value did not come in time. The device is stopped.
            DeviceFault: The device reported a fault, and is stopped; or the values at the end are not `ok`.
        """
        with self.act(what) as go_on:
            before = self.fresh()
            if self.is_busy(before):
                raise Refused("{device} is busy: {what} is refused", device=self.who, what=what)
            fault, steps = self.fault_of(before), self._encoded(write)
            try:
                self._send(what, steps, go_on)
                for step, wait in ((f"accepting {what}", acknowledge), (what, done)):
                    if wait is not None:
                        self.wait(self._arrives(what, wait[0], fault), wait[1], step, go_on)
                end = self.fresh()  # the values that were read before `done` in the same reading may be older
            except (DeviceTimeout, DeviceFault):
                self._try(self.send_stop)
                raise
            finally:
                self._try(lambda: self._write_all(after or {}))
            if ok and not _has(end, ok):
                found = ", ".join(f"{name} is {end[name]}" for name in ok)
                raise DeviceFault(
                    "{device}: {what} failed: {found}",
                    fault_code=self.fault_of(end),
                    device=self.who,
                    what=what,
                    found=found,
                )
            return end

    def _arrives(self, what: str, wanted: Values, known_fault: int) -> Callable[[dict[str, Any]], bool]:
        def holds(state: dict[str, Any]) -> bool:
            if (fault := self.fault_of(state)) not in (0, known_fault):
                raise DeviceFault("{device}: {what} failed", fault_code=fault, device=self.who, what=what)
            return _has(state, wanted)

        return holds

    def _try(self, write: Callable[[], None]) -> None:
        """Write after a command, if we still have control. An error of the command takes precedence."""
        with contextlib.suppress(DeviceError):
            self.send("ending a command", write)

    def _send(self, what: str, writes: list[tuple[Point, list[int]]], go_on: GoOn | None) -> None:
        for point, words in writes:
            self.send(what, partial(self._write, point, words), go_on)

    def _encoded(self, values: Values) -> list[tuple[Point, list[int]]]:
        encoded = []
        for name, value in values.items():
            try:
                encoded.append((self.POINTS[name], self.POINTS[name].words(value)))
            except ValueError as error:
                raise OutOfRange(
                    "{device}: {name} {reason}, not {value!r}", device=self.who, name=name, reason=error, value=value
                ) from None
        return encoded

    def _write_all(self, values: Values) -> None:
        for point, words in self._encoded(values):
            self._write(point, words)

    def _write(self, point: Point, words: list[int]) -> None:
        if point.table == "coil":
            self.link.write_coil(point.address, bool(words[0]))
        elif len(words) == 1:
            self.link.write_register(point.address, words[0])
        else:
            self.link.write_registers(point.address, *words)


def blocks(points: Mapping[str, Point]) -> list[Block]:
    """Return the requests that read all readable points. Only adjacent points share one, so that no gap is read."""
    found: list[Block] = []
    readable = [(point.table, point.address, name) for name, point in points.items() if point.readable]
    for table, address, name in sorted(readable):
        end = address + points[name].size
        before, first, count, names = found[-1] if found else ("", 0, 0, [])
        if before == table and address <= first + count and end - first <= MAX_READ_COUNT[table]:
            found[-1] = (table, first, max(count, end - first), [*names, name])
        else:
            found.append((table, address, end - address, [name]))
    return found


def _has(state: Mapping[str, Any], values: Values) -> bool:
    return all(state[name] == value for name, value in values.items())


# Names before version 0.2.
LONGEST_READ = MAX_READ_COUNT
