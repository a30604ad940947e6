"""PointActions: the actions of a device with named points. A mixin of object types, before IOBlock."""

import abc
from collections.abc import Callable, Mapping
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.device import Quality, Reading
from arcor2_hw.data.points import LivePoint
from arcor2_hw.exceptions import DeviceFault, OutOfRange, Refused
from arcor2_hw.messages import Message
from arcor2_hw.objects.edges import Edge, EdgeListeners
from arcor2_hw.objects.settings import within
from arcor2_hw.objects.small import IOPoint, PointDirection, PointKind, live_point

MAX_WAIT: Final = 600.0
"""Longest time a program may wait for a point in one call, s."""
MARGIN: Final = 20.0
"""Additional time of the action for repeated requests after another request, s."""


class PointActions(abc.ABC):
    """Read, write and observe points by name.

    A driver sets `io_points` and `edge_listeners` in `__init__`, and implements `read`, `raw_value`, `write_raw` and
    `await_point`; and `newest_value`, if `read` asks the device.
    """

    DYNAMIC_PARAMS: ClassVar[dict[str, tuple[str, set[str]]]] = {"name": ("point_names", set())}
    who: str | Message
    io_points: Mapping[str, IOPoint]
    edge_listeners: EdgeListeners
    forced: frozenset[str] = frozenset()
    """Names of the outputs that a person forces."""

    def points(self) -> list[IOPoint]:
        """Return the points."""
        return list(self.io_points.values())

    def point_names(self) -> list[str]:
        """Return the names of the points."""
        return list(self.io_points)

    def require_point(self, name: str, kind: PointKind | None = None) -> IOPoint:
        """Return a point. Raises OutOfRange if it does not exist, Refused if it is of another kind."""
        point = self.io_points.get(name)
        if point is None:
            raise OutOfRange(
                "{device} has no point {name!r}. Available: {io_points}",
                device=self.who,
                name=name,
                io_points=", ".join(self.io_points),
            )
        if kind not in (None, point.kind):
            raise Refused(
                "{device}: {name} is {point_label}. Use a point of the other kind.",
                device=self.who,
                name=name,
                point_label=self.point_label(name),
            )
        return point

    def point_label(self, name: str) -> str:
        """Return the kind of a point, or its terminal, for errors."""
        return "digital" if self.io_points[name].kind is PointKind.DIGITAL else "analogue"

    @abc.abstractmethod
    def read(self, name: str) -> Reading[bool | float]:
        """Read a point."""

    def newest_value(self, name: str) -> Reading[bool | float]:
        """Return the newest value of a point without asking the device, if that is possible. Raises like `read`."""
        return self.read(name)

    def live_points(self) -> list[LivePoint]:
        """Return the points with their newest values."""
        return [live_point(point, self.newest_value, can_force=True) for point in self.points()]

    def force_point(self, name: str, value: bool | float) -> None:
        """Write an output and refuse all other writes to it. Raises Refused, OutOfRange, and as `write_raw`."""
        point = self.require_output(name)
        if not point.forcible:
            raise Refused(
                "{device}: {name} cannot be forced, because it keeps its value when the connection is lost",
                device=self.who,
                name=name,
            )
        before, self.forced = self.forced, self.forced | {name}
        try:
            self._write(name, value)
        except BaseException:
            self.forced = before
            raise

    def release_point(self, name: str, value: bool | float) -> None:
        """End a force, and write the value from before it. Raises as `write_raw`."""
        try:
            self._write(name, value)
        finally:
            self.forced -= {name}

    def require_not_forced(self, name: str) -> None:
        """Raise Refused while a person forces an output."""
        if name in self.forced:
            raise Refused("{device}: {name} is forced. End the force first.", device=self.who, name=name)

    def write(self, name: str, value: bool | float) -> None:
        """Write an output, in its unit.

        Raises:
            Refused: It is an input, or a person forces it.
            OutOfRange: The value is not in its range.
            NotInControl, ConnectionLost, DeviceTimeout: As `write_raw`.
        """
        self.require_not_forced(name)
        self._write(name, value)

    def _write(self, name: str, value: bool | float) -> None:
        point = self.require_output(name)
        raw: bool | float = bool(value)
        if point.kind is PointKind.ANALOG:
            try:
                raw = self.raw_value(name, float(value))
            except ValueError as error:
                reason = f"{error} {point.unit}".rstrip()
                raise OutOfRange(
                    "{device}: {name} {reason}, not {value!r}", device=self.who, name=name, reason=reason, value=value
                ) from None
        self.write_raw(name, raw)

    def require_output(self, name: str) -> IOPoint:
        """Return a point. Raises Refused for an input."""
        point = self.require_point(name)
        if point.direction is not PointDirection.OUTPUT:
            label = self.point_label(name)
            raise Refused("{device}: {name} is an input ({label})", device=self.who, name=name, label=label)
        return point

    def raw_value(self, name: str, value: float) -> float:
        """Return the raw value of an analogue output. Raises ValueError with the range, as "must be 0 to 5"."""
        raise NotImplementedError

    def write_raw(self, name: str, raw: bool | float) -> None:
        """Write the raw value of an output. Raises NotInControl, ConnectionLost, DeviceTimeout."""
        raise NotImplementedError

    @abc.abstractmethod
    def await_point(self, name: str, value: bool, timeout: float) -> None:
        """Wait until a digital point has the value. Raises DeviceTimeout after `timeout` s, Cancelled."""

    def subscribe(self, name: str, listener: Callable[[Edge], None]) -> Callable[[], None]:
        """Call `listener` with each edge of a digital point, and return the function that ends the subscription.

        The listener runs on the observing thread and must return quickly. The subscription continues after a connection
        loss; changes during the loss do not count as edges.
        """
        self.require_point(name, PointKind.DIGITAL)
        return self.edge_listeners.add(name, listener)

    # -------------------------------------------------------------------------------- actions
    @action(again="safe")
    def read_digital(self, name: str, *, an: str | None = None) -> bool:
        """Read a digital input or output.

        :param name: name of the point
        """
        self.require_point(name, PointKind.DIGITAL)
        return bool(self._good_value(name))

    @action(again="safe")
    def read_analog(self, name: str, *, an: str | None = None) -> float:
        """Read an analogue input or output, in its unit.

        :param name: name of the point
        """
        self.require_point(name, PointKind.ANALOG)
        return float(self._good_value(name))

    def _good_value(self, name: str) -> bool | float:
        reading = self.read(name)
        if reading.quality is Quality.BAD:
            raise self.bad_reading(name)
        return reading.value

    def bad_reading(self, name: str) -> DeviceFault:
        """Return the error for a point whose value is bad."""
        return DeviceFault(
            "{device}: the value of {name} ({point_label}) is not valid",
            fault_code="bad",
            device=self.who,
            name=name,
            point_label=self.point_label(name),
        )

    @action
    def write_digital(self, name: str, value: bool, *, an: str | None = None) -> None:
        """Switch a digital output.

        :param name: name of the output
        :param value: on or off
        """
        self.require_point(name, PointKind.DIGITAL)
        self.write(name, value)

    @action
    def write_analog(self, name: str, value: float, *, an: str | None = None) -> None:
        """Set an analogue output, in its unit.

        :param name: name of the output
        :param value: the value, in the unit of the point
        """
        self.require_point(name, PointKind.ANALOG)
        self.write(name, value)

    @action(deadline=MAX_WAIT + MARGIN, again="safe")
    def wait_for(self, name: str, value: bool, timeout: float, *, an: str | None = None) -> None:
        """Wait until a digital point has the value.

        :param name: name of the point
        :param value: on or off
        :param timeout: time limit, s
        """
        assert 0.0 <= timeout <= 600.0

        within(f"{self.who}: timeout", timeout, 0.0, MAX_WAIT, "s")
        self.require_point(name, PointKind.DIGITAL)
        self.await_point(name, value, timeout)


# Names before version 0.2.
LONGEST_WAIT = MAX_WAIT
