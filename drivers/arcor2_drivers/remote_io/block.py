"""The observed block: one thread reads its image over and over and, while we have control, keeps its watchdog quiet."""

import contextlib
import random
import threading
import time
from collections.abc import Callable, Mapping
from typing import Final

from arcor2_hw.exceptions import (
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotInControl,
    OutOfRange,
    Refused,
)
from arcor2_hw.objects.modbus_link import ModbusLink
from arcor2_hw.objects.polled import Polled, Snapshot

from .edges import Debounced, Edge, Subscriptions
from .points import Point
from .registers import (
    ACKNOWLEDGE,
    COMMAND,
    IMAGE_COUNT,
    LONGEST_PULSE,
    PULSE,
    RELEASE,
    TRIGGER,
    Image,
    WatchdogState,
    arming,
    decode,
    watchdog_address,
    word,
)
from .settings import BlockSettings, within

PERIOD: Final = 0.02
"""s between readings: an edge is seen when the level stands that long."""
REFUSALS: Final = {4: "an expired watchdog holds the output"}
"""Modbus exceptions as the block's page says, where they mean something else than usual."""


class Block(Polled[Image]):
    """Keeps the newest image of a block, and control of its outputs once that was taken.

    tick: called on the observing thread after each reading while we have control.
    """

    def __init__(
        self, name: str, settings: BlockSettings, points: Mapping[str, Point], tick: Callable[[], None] = lambda: None
    ) -> None:
        self._settings, self.points, self._tick = settings, points, tick
        self.link = ModbusLink(
            name,
            settings.host,
            settings.port,
            settings.unit_id,
            settings.request_timeout,
            serial_port=settings.serial_port,
            baudrate=settings.baudrate,
            exceptions=REFUSALS,
        )
        # A reading asked for twice with the line drained in between, behind another request of the same kind.
        self._patience = 6.0 * settings.request_timeout
        super().__init__(
            self.link.who,
            self._open_block,
            self._read_image,
            self.link.close,
            quiet=PERIOD,
            busy=PERIOD,
            answers_within=self._patience,
            taken=self._note,
            after=self._keep_control,
            lost=lambda _: self._drop("control ended when the connection was lost"),
            interrupt=self.link.close,
        )
        self.subscriptions = Subscriptions()
        self._watchdog = watchdog_address(settings.watchdog)
        self._number = random.randint(1, 0xFFFF)  # tells our watchdog from another host's
        self._inputs = {
            name: Debounced(name, point.io.debounce) for name, point in points.items() if point.kind in ("DI", "DO")
        }
        self._edges: list[Edge] = []
        self._commands, self._one_pulse = threading.Lock(), threading.Lock()
        self._pulsing: set[int] = set()
        self._armed = 0.0
        self._triggered = 0.0
        self.in_control = False
        self._why_not = "nobody has control"

    # -------------------------------------------------------------------------------- life
    def disconnect(self) -> None:
        """Put our outputs into their safe state and stop observing; harmless when it was not."""
        with contextlib.suppress(DeviceError):  # it is gone; its watchdog deals with that
            if self.in_control and self.observing.online:
                self.link.write_registers(self._watchdog + COMMAND, RELEASE, timeout=0.3)
        self._drop("nobody has control")
        super().disconnect()
        self.stop_waiting()

    # -------------------------------------------------------------------------------- control
    def take_control(self) -> None:
        """Arm the block's watchdog with what each output does on loss; no output is written. Raises NotInControl."""
        with self._commands:
            if (owner := self._other_owner(self.fresh().value)) is not None:
                raise NotInControl(f"{self.who}: control is refused: {owner} has it")
            if self.in_control:
                return
            losses = self.losses
            registers = arming(self.points.values(), self._settings.watchdog_ms, self._number)
            self.link.write_registers(self._watchdog + COMMAND, ACKNOWLEDGE)
            self.link.write_registers(self._watchdog, *registers)
            kept = self.link.read_holding_registers(self._watchdog, len(registers))
            if kept != registers:
                raise Refused(f"{self.who}: its watchdog keeps {kept} after {registers} was written")
            with self.taking:
                self._armed = self._triggered = time.monotonic()
                self.in_control = True
            try:
                self.check_unbroken(losses)
            except DeviceError:
                self._drop("the connection was lost")
                raise
            self.observing.settled()

    def release_control(self) -> None:
        """Put our outputs into their safe state at once and switch the watchdog off."""
        with self._commands:
            if self.in_control:
                self._drop("nobody has control")
                self.link.write_registers(self._watchdog + COMMAND, RELEASE)

    def control_owner(self) -> str | None:
        """Tell who has control: us, another host by its number, or nobody."""
        if self.in_control:
            return "us"
        newest = self.newest()
        return None if newest is None else self._other_owner(newest)

    def _other_owner(self, image: Image) -> str | None:
        state, number = image.watchdog(self._settings.watchdog)
        if state is WatchdogState.RUNNING and number != self._number:
            return f"another host (number {number} on watchdog {self._settings.watchdog})"
        return None

    def _drop(self, why: str) -> None:
        self.in_control = False
        self._why_not = why

    def require_control(self, what: str) -> None:
        """Return when outputs may be written. Raises NotConnected, ConnectionLost, NotInControl with the reason."""
        self.observing.check()
        if not self.in_control:
            raise NotInControl(f"{self.who}: {what} is refused: {self._why_not}")

    # -------------------------------------------------------------------------------- points
    def point(self, name: str, *kinds: str) -> Point:
        """Give the point of this name. Raises OutOfRange when there is none, Refused when it is of another kind."""
        point = self.points.get(name)
        if point is None:
            raise OutOfRange(f"{self.who} has no point {name!r}; there are {', '.join(self.points)}")
        if kinds and point.kind not in kinds:
            raise Refused(f"{self.who}: {name} is {point.address}; this needs one of {', '.join(kinds)}")
        return point

    def digital(self, name: str) -> bool:
        """Give the debounced value of a digital point."""
        value = self._inputs[name].value
        if value is None:
            self.observing.check()
            raise ConnectionLost(f"{self.who}: nothing is known of {name} yet")
        return value

    def write_digital(self, name: str, value: bool) -> None:
        """Switch a digital output."""
        point = self.point(name, "DO")
        self.require_control(f"writing {name}")
        self.link.write_coil(point.channel, value)

    def write_analog(self, name: str, value: float) -> None:
        """Set an analogue output, in its unit. Raises OutOfRange with the range."""
        point = self.point(name, "AO")
        try:
            raw = point.raw(value)
        except ValueError as error:
            raise OutOfRange(f"{self.who}: {name} {error}, not {value!r}") from None
        self.require_control(f"writing {name}")
        self.link.write_registers(point.channel, word(raw))

    def pulse(self, name: str, duration: float) -> None:
        """Switch a digital output on for `duration` s by the block's own clock; return when it is off again."""
        point = self.point(name, "DO")
        within(f"{self.who}: duration", duration, 0.01, LONGEST_PULSE)
        self.require_control(f"pulsing {name}")
        go_on = self.begin(f"the pulse of {name}")
        with self._one_pulse:
            if point.channel in self._pulsing:
                raise Refused(f"{self.who}: pulsing {name} is refused while it is being pulsed")
            self._pulsing.add(point.channel)

        def over(image: Image) -> bool:
            self.require_control(f"the pulse of {name}")
            return not image.digital("DO", point.channel)

        try:
            with self._one_pulse:
                go_on()
                self.link.write_registers(PULSE + point.channel, round(1000.0 * duration))
            self.wait(over, duration + self._patience, f"the pulse of {name}", go_on)
        except DeviceTimeout:
            with contextlib.suppress(DeviceError):  # the block ends it by itself
                self.link.write_registers(PULSE + point.channel, 0)
            raise
        finally:
            self._pulsing.discard(point.channel)

    def stop(self) -> None:
        """End whatever waits, with Cancelled, and return when the outputs that were being pulsed are off."""
        self.stop_waiting()
        with self._one_pulse:
            # What is not yet begun will not begin any more, see `pulse`.
            for channel in sorted(self._pulsing):
                self.link.write_registers(PULSE + channel, 0)

    def set_again(self, name: str, value: bool) -> None:
        """Switch a digital output; a second time when no answer came. Only where doing it twice does no harm."""
        try:
            self.write_digital(name, value)
        except DeviceTimeout:
            self.write_digital(name, value)

    # -------------------------------------------------------------------------------- images
    def ask(self) -> Snapshot[Image]:
        """Read an image now, on the caller's thread: quicker than `fresh`, and unknown to points that are debounced."""
        self.observing.check()
        return Snapshot.by(self._read_image)

    def _read_image(self, timeout: float | None = None) -> Image:
        words = self.link.read_input_registers(0, IMAGE_COUNT, timeout)
        try:
            return decode(words)
        except ValueError as error:
            raise DeviceFault(f"{self.who} tells what no block of this kind tells: {error}") from error

    # -------------------------------------------------------------------------------- on the observing thread
    def _open_block(self, timeout: float) -> Snapshot[Image]:
        deadline = time.monotonic() + timeout
        for each in self._inputs.values():
            each.forget()
        self.link.open(timeout)
        # Asked for twice at most, a serial line drained in between.
        first = min(self._settings.request_timeout, max(0.02, (deadline - time.monotonic()) / 3.0))
        return Snapshot.by(lambda: self._read_image(first))

    def _note(self, snapshot: Snapshot[Image]) -> None:
        image, asked, _ = snapshot
        self._check_control(image, asked)
        for name, each in self._inputs.items():
            point = self.points[name]
            edge = each.take(image.digital(point.kind, point.channel), asked)
            if edge is not None:
                self._edges.append(edge)

    def _keep_control(self) -> None:
        edges, self._edges = self._edges, []
        for edge in edges:
            self.subscriptions.tell(edge)
        if self.in_control:
            with contextlib.suppress(NotInControl):  # given back or lost meanwhile
                self._keep_quiet()
                self._tick()

    def _keep_quiet(self) -> None:
        if time.monotonic() - self._triggered < self._settings.watchdog_ms / 5000.0:
            return
        try:
            self.link.write_registers(self._watchdog + TRIGGER, self._number)
        except DeviceTimeout:  # twice does no harm
            self.link.write_registers(self._watchdog + TRIGGER, self._number)
        self._triggered = time.monotonic()

    def _check_control(self, image: Image, asked: float) -> None:
        if not self.in_control or asked < self._armed:
            return
        state, _ = image.watchdog(self._settings.watchdog)
        if state is WatchdogState.EXPIRED:
            self._drop("the block's watchdog has expired; its outputs are in their safe state until control is taken")
        elif state is WatchdogState.OFF:
            self._drop("the block's watchdog is off: it was switched off and on, or another host was at it")
        elif (owner := self._other_owner(image)) is not None:
            self._drop(f"{owner} has control")
