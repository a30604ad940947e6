"""Digital inputs and outputs of a UR arm: actions for programs, and points for other objects of the scene."""

from typing import Final

from arcor2_hw.actions import action
from arcor2_hw.data.base import now
from arcor2_hw.data.device import Reading
from arcor2_hw.data.points import LivePoint
from arcor2_hw.exceptions import DeviceFault, DeviceTimeout, OutOfRange, Refused
from arcor2_hw.keep_alive import once_within
from arcor2_hw.messages import Message
from arcor2_hw.objects.small import IOPoint, OnLoss, PointDirection, PointKind, live_point

from .control import Control
from .observer import Observer
from .settings import OUTPUTS
from .timing import POLL_INTERVAL

OUTPUT_TIMEOUT: Final = 0.5
"""Time for a switched output to be reported, s: about ten cycles of the controller, and the network."""
_GROUPS: Final = (("digital", 0, 8), ("config", 8, 8), ("tool", 16, 2))
NUMBERS: Final = {
    f"{group}_{direction}[{i}]": first + i
    for direction in ("in", "out")
    for group, first, count in _GROUPS
    for i in range(count)
}
"""Number of each point among the inputs or the outputs."""
POINTS: Final = {
    name: IOPoint(name, PointDirection.OUTPUT, PointKind.DIGITAL, on_loss=OnLoss.HOLD)
    if "_out" in name
    else IOPoint(name, PointDirection.INPUT, PointKind.DIGITAL)
    for name in NUMBERS
}


class DigitalIO:
    """Mixin with the digital inputs and outputs of a UR arm."""

    name: str
    _observer: Observer
    _control: Control

    @action
    def set_digital_output(self, output: int, value: bool, *, an: str | None = None) -> None:
        """Switch a digital output. It keeps its state when the connection is lost.

        :param output: 0 to 7 standard, 8 to 15 configurable, 16 and 17 at the tool
        :param value: on or off
        """
        assert 0 <= output <= 17
        self._switch(output, value)

    @action(again="safe")
    def get_digital_input(self, number: int, *, an: str | None = None) -> bool:
        """Read a digital input.

        :param number: 0 to 7 standard, 8 to 15 configurable, 16 and 17 at the tool
        """
        assert 0 <= number <= 17
        return bool(self._observer.sample().inputs >> number & 1)

    @action(deadline=None, again="safe")
    def wait_for_input(self, number: int, value: bool, timeout: float = 10.0, *, an: str | None = None) -> None:
        """Wait until a digital input has a value.

        :param number: 0 to 7 standard, 8 to 15 configurable, 16 and 17 at the tool
        :param value: on or off
        :param timeout: time after which the action fails, s
        """
        assert 0 <= number <= 17
        assert 0.0 <= timeout <= 3600.0
        guard = self._control.stops.guard()

        def seen() -> bool:
            guard.check(f"Waiting for input {number} of {self.name}")
            return self.get_digital_input(number) is value

        if not once_within(seen, timeout, POLL_INTERVAL):
            raise DeviceTimeout(
                "Input {number} of {name} was not {value} in {timeout:g} s.",
                number=number,
                name=self.name,
                value=Message.of("on" if value else "off"),
                timeout=timeout,
            )

    def points(self) -> list[IOPoint]:
        """Return the digital inputs and outputs by their names at the pendant; outputs hold on connection loss."""
        return list(POINTS.values())

    def read(self, name: str) -> Reading[bool | float]:
        """Read a point, from any thread. Raise OutOfRange for an unknown name, NotConnected, ConnectionLost, Stale."""
        point, sample = self._point(name), self._observer.sample()
        bits = sample.inputs if point.direction is PointDirection.INPUT else sample.outputs
        return Reading[bool | float](bool(bits >> NUMBERS[name] & 1), now(), sample.monotonic)

    def live_points(self) -> list[LivePoint]:
        """Return the inputs and outputs with their newest values."""
        return [live_point(point, self.read) for point in POINTS.values()]

    def write(self, name: str, value: bool | float) -> None:
        """Switch an output, from any thread, also during a motion. Raise OutOfRange, Refused or NotInControl."""
        if self._point(name).direction is PointDirection.INPUT:
            raise Refused("{name} of {owner} is an input.", name=name, owner=self.name)
        self._switch(NUMBERS[name], bool(value))

    def _point(self, name: str) -> IOPoint:
        if name not in POINTS:
            raise OutOfRange(
                "{name} has no point {point!r}. Its points are {points}.",
                name=self.name,
                point=name,
                points=", ".join(POINTS),
            )
        return POINTS[name]

    def _switch(self, output: int, value: bool) -> None:
        """Switch an output and wait until the controller reports it."""
        if not 0 <= output < OUTPUTS:
            raise OutOfRange(
                "{name}: output must be 0 to {outputs}, not {output}",
                name=self.name,
                outputs=OUTPUTS - 1,
                output=output,
            )
        self._control.current().set_output(output, value)
        self._on_switched(output, value)
        if not once_within(
            lambda: self._observer.sample().outputs >> output & 1 == value, OUTPUT_TIMEOUT, POLL_INTERVAL
        ):
            raise DeviceFault(
                "Output {output} of {name} did not switch {value}.",
                output=output,
                name=self.name,
                value=Message.of("on" if value else "off"),
            )

    def _on_switched(self, output: int, value: bool) -> None:
        """Handle a switched output."""
