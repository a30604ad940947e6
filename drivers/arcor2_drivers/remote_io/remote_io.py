"""A remote I/O block: named points, edges, pulses, and a safe state by its own watchdog."""

from typing import ClassVar

from arcor2_hw.actions import action, observation
from arcor2_hw.data.device import Quality, Reading
from arcor2_hw.exceptions import DeviceFault
from arcor2_hw.objects import IOBlock
from arcor2_hw.objects.point_actions import MARGIN, PointActions
from arcor2_hw.objects.small import PointKind
from arcor2_hw.objects.state_observer import Snapshot

from .block import Block
from .points import parse_points
from .registers import BROKEN_WIRE, MAX_PULSE_TIME, Image
from .settings import RemoteIOSettings


class RemoteIO(PointActions, Block, IOBlock):
    """A remote I/O block on Modbus: named digital and analogue points."""

    _ABSTRACT = False
    display_name = "Remote I/O"
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"wait_for": "stop", "pulse": "stop"}

    def __init__(self, obj_id: str, name: str, settings: RemoteIOSettings) -> None:
        super().__init__(obj_id, name, settings)
        self.use_block(settings, parse_points(settings.points))
        self.io_points = {name: point.io for name, point in self.block_points.items()}
        self.edge_listeners = self.digital_points

    @property
    def shown_values(self) -> dict[str, float]:
        """Return for each digital input whether it is on."""
        return self.digital_points.shown(name for name, point in self.block_points.items() if point.kind == "DI")

    @observation
    def digital_point(self, name: str) -> bool:
        """Return whether a digital point is on, debounced. Raises OutOfRange, Refused, Stale, ConnectionLost."""
        self.require_point(name, PointKind.DIGITAL)
        self.current()
        return self.digital(name)

    @observation
    def analog_point(self, name: str) -> Reading[float]:
        """Return the value of an analogue point. Raises OutOfRange, Refused, Stale, ConnectionLost."""
        self.require_point(name, PointKind.ANALOG)
        return self._analog(name, self._polled.current())

    def _analog(self, name: str, snapshot: Snapshot[Image]) -> Reading[float]:
        image, asked, stamp = snapshot
        point = self.block_points[name]
        raw = image.analog(point.kind, point.channel)
        quality = Quality.BAD if point.kind == "AI" and raw == BROKEN_WIRE else Quality.GOOD
        return Reading(raw * point.io.scale, stamp, asked, quality)

    def point_label(self, name: str) -> str:
        """Return the terminal of a point."""
        return self.block_points[name].address

    def read(self, name: str) -> Reading[bool | float]:
        """Read a point now: debounced, in its unit. Quality is bad for an input with a broken wire.

        Raises OutOfRange for an unknown name, NotConnected, ConnectionLost, DeviceTimeout.
        """
        self.require_point(name)
        self.fresh()
        return self.newest_value(name)

    def newest_value(self, name: str) -> Reading[bool | float]:
        """Return the newest value of a point. Raises Stale, NotConnected, ConnectionLost."""
        if self.io_points[name].kind is PointKind.ANALOG:
            return self._analog(name, self._polled.current())
        return self.newest_digital(name)

    def bad_reading(self, name: str) -> DeviceFault:
        """Return the error for an input with a broken wire."""
        point = f"{name} ({self.point_label(name)})"
        return DeviceFault("{device}: {point} has a broken wire", "", "broken_wire", device=self.who, point=point)

    def raw_value(self, name: str, value: float) -> int:
        """Return the raw value of an analogue output. Raises ValueError with the range."""
        return self.block_points[name].raw(value)

    def write_raw(self, name: str, raw: bool | float) -> None:
        """Write an output. Raises NotInControl, ConnectionLost, DeviceTimeout."""
        point = self.block_points[name]
        if point.kind == "DO":
            self.switch(name, bool(raw))
        else:
            self.send(f"writing {name}", lambda: self.link.write_registers(point.channel, int(raw) & 0xFFFF))

    def await_point(self, name: str, value: bool, timeout: float) -> None:
        """Return when a digital point has the value."""
        what = f"{name} becoming {'on' if value else 'off'}"
        go_on = self.begin(what)
        self.fresh()
        if self.digital(name) != value:
            self.wait(lambda _: self.digital(name) == value, timeout, what, go_on)

    @action(deadline=MAX_PULSE_TIME + MARGIN)
    def pulse(self, name: str, duration: float, *, an: str | None = None) -> None:
        """Switch a digital output on for a time, and return when it is off again.

        :param name: name of the output
        :param duration: how long, s
        """
        assert 0.01 <= duration <= 60.0

        self.require_point(name, PointKind.DIGITAL)
        self.require_output(name)
        self.require_not_forced(name)
        self.pulse_output(name, duration)
