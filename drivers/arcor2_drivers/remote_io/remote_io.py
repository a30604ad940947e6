"""A remote I/O block: named points, edges, pulses, and a safe state by its own watchdog."""

from typing import ClassVar

from arcor2_hw.actions import action
from arcor2_hw.data.device import Quality, Reading
from arcor2_hw.exceptions import DeviceFault, NotFound, OutOfRange, Refused
from arcor2_hw.objects import IOBlock
from arcor2_hw.objects.point_actions import MARGIN, PointActions
from arcor2_hw.objects.small import PointDirection, PointKind
from arcor2_hw.objects.state_observer import Snapshot

from .block import Block
from .points import parse_points
from .registers import BROKEN_WIRE, LONGEST_PULSE
from .settings import RemoteIOSettings


class RemoteIO(PointActions, Block, IOBlock):
    """A remote I/O block on Modbus: named digital and analogue points."""

    _ABSTRACT = False
    display_name = "Remote I/O"
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"wait_for": "stop", "pulse": "stop"}

    def __init__(self, obj_id: str, name: str, settings: RemoteIOSettings | None = None) -> None:
        super().__init__(obj_id, name, settings)
        if settings is None:
            raise NotFound("{name} has no settings. Set host or serial_port to the address of the block.", name=name)
        self.use_block(settings, parse_points(settings.points))
        self.io_points = {name: point.io for name, point in self.block_points.items()}

    def point_label(self, name: str) -> str:
        """Return the terminal of a point."""
        return self.block_points[name].address

    def read(self, name: str) -> Reading[bool | float]:
        """Read a point now: debounced, in its unit. Quality is bad for an input with a broken wire.

        Raises OutOfRange for an unknown name, NotConnected, ConnectionLost, DeviceTimeout.
        """
        self.require_point(name)
        point = self.block_points[name]
        if point.io.debounce:
            _, asked, stamp = self._polled.fresh()
            return Reading(self.digital(name), stamp, asked)
        self.observing.check()
        image, asked, stamp = Snapshot.by(self.read_state)
        if point.io.kind is PointKind.DIGITAL:
            return Reading(image.digital(point.kind, point.channel), stamp, asked)
        raw = image.analog(point.kind, point.channel)
        quality = Quality.BAD if point.kind == "AI" and raw == BROKEN_WIRE else Quality.GOOD
        return Reading(point.physical(raw), stamp, asked, quality)

    def bad_reading(self, name: str) -> DeviceFault:
        """Return the error for an input with a broken wire."""
        text = f"{self.who}: {name} ({self.point_label(name)}) has a broken wire"
        return DeviceFault(text, fault_code="broken_wire")

    def write(self, name: str, value: bool | float) -> None:
        """Write an output. Raises Refused for an input, NotInControl, OutOfRange, ConnectionLost, DeviceTimeout."""
        self.require_output(name)
        point = self.block_points[name]
        if point.kind == "DO":
            self.switch(name, bool(value))
        else:
            try:
                raw = point.raw(float(value))
            except ValueError as error:
                raise OutOfRange(
                    "{device}: {name} {reason}, not {value!r}", device=self.who, name=name, reason=error, value=value
                ) from None
            self.send(f"writing {name}", lambda: self.link.write_registers(point.channel, raw & 0xFFFF))

    def require_output(self, name: str) -> None:
        """Raise Refused for an input."""
        if self.require_point(name).direction is not PointDirection.OUTPUT:
            raise Refused(
                "{device}: {name} is {point_label}, an input",
                device=self.who,
                name=name,
                point_label=self.point_label(name),
            )

    def await_point(self, name: str, value: bool, timeout: float) -> None:
        """Return when a digital point has the value."""
        what = f"{name} becoming {'on' if value else 'off'}"
        go_on = self.begin(what)
        self.fresh()
        if self.digital(name) != value:
            self.wait(lambda _: self.digital(name) == value, timeout, what, go_on)

    @action(deadline=LONGEST_PULSE + MARGIN)
    def pulse(self, name: str, duration: float, *, an: str | None = None) -> None:
        """Switch a digital output on for a time, and return when it is off again.

        :param name: name of the output
        :param duration: how long, s
        """
        assert 0.01 <= duration <= 60.0

        self.require_point(name, PointKind.DIGITAL)
        self.require_output(name)
        self.pulse_output(name, duration)
