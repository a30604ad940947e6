"""A remote I/O block as an object type: named points, edges, pulses, and a safe state by its own watchdog."""

from collections.abc import Callable
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, LossReaction, Quality, Reading, Severity
from arcor2_hw.exceptions import DeviceFault, NotFound
from arcor2_hw.objects import IOBlock
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.small import IOPoint

from .block import Block
from .edges import Edge
from .points import parse_points
from .registers import BROKEN_WIRE, LONGEST_PULSE, OVERLOAD, SUPPLY_MISSING
from .settings import LONGEST_WATCHDOG, RemoteIOSettings, within

LONGEST_WAIT: Final = 600.0
"""s a program may wait for a point in one call."""
MARGIN: Final = 20.0
"""s beyond it: requests asked twice, one behind the other."""
DIAGNOSES: Final = {
    SUPPLY_MISSING: ("supply_missing", "the supply of the outputs is missing", "check fuse and cable of the outputs"),
    OVERLOAD: ("overload", "an output is overloaded", "check the loads at the outputs for a short circuit"),
}


def diagnoses(bits: int) -> list[Alarm]:
    """Give what the block complains of."""
    return [
        Alarm(code, Severity.ERROR, text, remedy, now())
        for bit, (code, text, remedy) in DIAGNOSES.items()
        if bits & bit
    ]


class RemoteIO(IOBlock):
    """A remote I/O block on Modbus: named digital and analogue points."""

    _ABSTRACT = False
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(LONGEST_WATCHDOG / 1000.0)
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"wait_for": "stop", "pulse": "stop"}
    DYNAMIC_PARAMS: ClassVar[dict[str, tuple[str, set[str]]]] = {"name": ("point_names", set())}

    def __init__(self, obj_id: str, name: str, settings: RemoteIOSettings | None = None) -> None:
        super().__init__(obj_id, name, settings)
        if settings is None:
            raise NotFound(f"{name} has no settings: host or serial_port must say where the block is")
        self._block = Block(name, settings, parse_points(settings.points))

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Begin to observe within `timeout` s; nothing is written. Raises NotConnected, DeviceTimeout, DeviceFault."""
        self._block.connect(timeout)

    def disconnect(self) -> None:
        """Stop observing. When control is ours, the outputs take their declared state on loss first."""
        self._block.disconnect()

    @property
    def connection(self) -> Connection:
        """Tell how the connection is."""
        return self._block.observing.state

    @property
    def health(self) -> Health:
        """Give the condition as the block last told it; failure when it does not tell any more."""
        image = self._block.newest()
        if self.connection in (Connection.LOST, Connection.FAILED) or (image is not None and image.diagnosis):
            return Health.FAILURE
        return Health.NORMAL

    def identify(self) -> Identity:
        """Ask the block who it is (function 43/14)."""
        self._block.observing.check()
        return self._block.link.identify()

    def alarms(self) -> list[Alarm]:
        """Give what the block complains of; each ends with its cause."""
        return diagnoses(self._block.fresh().value.diagnosis)

    def take_control(self) -> None:
        """Arm the block's watchdog; outputs stay as they are. Raises NotInControl naming who has it."""
        self._block.take_control()

    def release_control(self) -> None:
        """Put the outputs into their declared state on loss at once, and switch the watchdog off."""
        self._block.release_control()

    def control_owner(self) -> str | None:
        """Tell who has control of the outputs: "us", another host, or None."""
        return self._block.control_owner()

    # -------------------------------------------------------------------------------- points
    def points(self) -> list[IOPoint]:
        """Give the points."""
        return [point.io for point in self._block.points.values()]

    def point_names(self) -> list[str]:
        """Give the names of the points."""
        return list(self._block.points)

    def read(self, name: str) -> Reading[bool | float]:
        """Read a point now: debounced, in its unit. Quality is bad for an input with a broken wire.

        Raises OutOfRange for an unknown name, NotConnected, ConnectionLost, DeviceTimeout.
        """
        point = self._block.point(name)
        if point.io.debounce:
            _, asked, stamp = self._block.fresh()
            return Reading(self._block.digital(name), stamp, asked)
        image, asked, stamp = self._block.ask()
        if point.kind in ("DI", "DO"):
            return Reading(image.digital(point.kind, point.channel), stamp, asked)
        raw = image.analog(point.kind, point.channel)
        quality = Quality.BAD if point.kind == "AI" and raw == BROKEN_WIRE else Quality.GOOD
        return Reading(point.physical(raw), stamp, asked, quality)

    def write(self, name: str, value: bool | float) -> None:
        """Write an output. Raises Refused for an input, NotInControl, OutOfRange, ConnectionLost, DeviceTimeout."""
        if self._block.point(name, "DO", "AO").kind == "DO":
            self._block.write_digital(name, bool(value))
        else:
            self._block.write_analog(name, float(value))

    def subscribe(self, name: str, listener: Callable[[Edge], None]) -> Callable[[], None]:
        """Call `listener` with each edge of a digital point, on the thread that observes: be quick there.

        What is given back ends the subscription. It outlives a loss; what changed meanwhile is told by no edge.
        """
        self._block.point(name, "DI", "DO")
        return self._block.subscriptions.add(name, listener)

    def stop(self) -> None:
        """End what waits here with Cancelled, and a pulse with its output off. No other output changes."""
        self._block.stop()

    # -------------------------------------------------------------------------------- actions
    @action
    def read_digital(self, name: str, *, an: str | None = None) -> bool:
        """Read a digital input or output.

        :param name: name of the point
        """
        self._block.point(name, "DI", "DO")
        return bool(self.read(name).value)

    @action
    def read_analog(self, name: str, *, an: str | None = None) -> float:
        """Read an analogue input or output, in its unit.

        :param name: name of the point
        """
        point = self._block.point(name, "AI", "AO")
        reading = self.read(name)
        if reading.quality is Quality.BAD:
            raise DeviceFault(
                f"{self._block.who}: {name} ({point.address}) has a broken wire", fault_code="broken_wire"
            )
        return float(reading.value)

    @action
    def write_digital(self, name: str, value: bool, *, an: str | None = None) -> None:
        """Switch a digital output.

        :param name: name of the output
        :param value: on or off
        """
        self._block.write_digital(name, value)

    @action
    def write_analog(self, name: str, value: float, *, an: str | None = None) -> None:
        """Set an analogue output, in its unit.

        :param name: name of the output
        :param value: the value, in the unit of the point
        """
        self._block.write_analog(name, value)

    @action(deadline=LONGEST_PULSE + MARGIN)
    def pulse(self, name: str, duration: float, *, an: str | None = None) -> None:
        """Switch a digital output on for a time, and return when it is off again.

        :param name: name of the output
        :param duration: how long, s
        """
        assert 0.01 <= duration <= 60.0

        self._block.pulse(name, duration)

    @action(deadline=LONGEST_WAIT + MARGIN)
    def wait_for(self, name: str, value: bool, timeout: float, *, an: str | None = None) -> None:
        """Wait until a digital point has the value.

        :param name: name of the point
        :param value: on or off
        :param timeout: how long at most, s
        """
        assert 0.0 <= timeout <= 600.0

        block = self._block
        what = f"{name} becoming {'on' if value else 'off'}"
        go_on = block.begin(what)
        block.point(name, "DI", "DO")
        within(f"{block.who}: timeout", timeout, 0.0, LONGEST_WAIT)
        block.fresh()
        if block.digital(name) == value:
            return
        block.wait(lambda _: block.digital(name) == value, timeout, what, go_on)
