"""The observed block: one thread reads its image over and over and, while we have control, keeps its watchdog quiet."""

import contextlib
import random
import threading
import time
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceTimeout,
    NotInControl,
    OutOfRange,
    Refused,
)
from arcor2_hw.objects.observing import Observing

from .edges import Debounced, Subscriptions
from .link import BlockLink
from .points import Point
from .registers import (
    ACKNOWLEDGE,
    COMMAND,
    LONGEST_PULSE,
    PULSE,
    RELEASE,
    TRIGGER,
    Image,
    WatchdogState,
    arming,
    watchdog_address,
    word,
)
from .settings import BlockSettings, within

PERIOD: Final = 0.02
"""s between readings: an edge is seen when the level stands that long."""


class Snapshot(NamedTuple):
    """What was read, and when it was asked for: on the monotonic clock and in UTC."""

    image: Image
    asked: float
    stamp: Timestamp


class Block:
    """Keeps the newest image of a block, and control of its outputs once that was taken.

    tick: called on the observing thread after each reading while we have control.
    """

    def __init__(
        self, name: str, settings: BlockSettings, points: Mapping[str, Point], tick: Callable[[], None] = lambda: None
    ) -> None:
        self._settings, self.points, self._tick = settings, points, tick
        self.link = BlockLink(name, settings)
        self.who = self.link.who
        self.observing = Observing(self.who, self._open, self._watch, self.link.close, self._lost)
        self.subscriptions = Subscriptions()
        self._watchdog = watchdog_address(settings.watchdog)
        self._number = random.randint(1, 0xFFFF)  # tells our watchdog from another host's
        self._inputs = {
            name: Debounced(name, point.io.debounce) for name, point in points.items() if point.kind in ("DI", "DO")
        }
        self._news = threading.Condition()
        self._commands = threading.Lock()
        self._newest: Snapshot | None = None
        self._armed = 0.0
        self._triggered = 0.0
        self.in_control = False
        self._why_not = "nobody has control"
        self._losses = 0
        self._stops = 0
        self._loss: DeviceError | None = None
        self._ending = False
        self._hurry = threading.Event()

    # -------------------------------------------------------------------------------- life
    def connect(self, timeout: float) -> None:
        """Begin to observe. Raises NotConnected, DeviceTimeout, DeviceFault, ConnectionLost."""
        self._ending = False
        self.observing.start(timeout)

    def disconnect(self) -> None:
        """Put our outputs into their safe state and stop observing; harmless when it was not."""
        with contextlib.suppress(DeviceError):  # it is gone; its watchdog deals with that
            if self.in_control and self.observing.online:
                self.link.write_registers(self._watchdog + COMMAND, RELEASE, timeout=0.3)
        self._ending = True
        self._drop("nobody has control")
        self.link.close()
        self._hurry.set()
        self.observing.stop()
        self._newest = None
        self.stop()

    def stop(self) -> None:
        """End whatever waits, with Cancelled. Outputs stay, but a pulse that is waited for ends."""
        with self._news:
            self._stops += 1
            self._news.notify_all()

    # -------------------------------------------------------------------------------- control
    def take_control(self) -> None:
        """Arm the block's watchdog with what each output does on loss; no output is written. Raises NotInControl."""
        with self._commands:
            if (owner := self._other_owner(self.fresh().image)) is not None:
                raise NotInControl(f"{self.who}: control is refused: {owner} has it")
            if self.in_control:
                return
            losses = self._losses
            registers = arming(self.points.values(), self._settings.watchdog_ms, self._number)
            self.link.write_registers(self._watchdog + COMMAND, ACKNOWLEDGE)
            self.link.write_registers(self._watchdog, *registers)
            kept = self.link.read_registers(self._watchdog, len(registers))
            if kept != registers:
                raise Refused(f"{self.who}: its watchdog keeps {kept} after {registers} was written")
            with self._news:
                self._armed = self._triggered = time.monotonic()
                self.in_control = True
            if losses != self._losses:
                self._drop("the connection was lost")
                raise ConnectionLost(f"{self.who}: the connection was lost", str(self._loss or ""))
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
        newest = self._newest
        return None if newest is None else self._other_owner(newest.image)

    def _other_owner(self, image: Image) -> str | None:
        state, number = image.watchdogs[self._settings.watchdog], image.numbers[self._settings.watchdog]
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
        try:
            self._pulse(point, duration)
        except (Cancelled, DeviceTimeout):
            with contextlib.suppress(DeviceError):  # the block ends it by itself
                self.link.write_registers(PULSE + point.channel, 0)
            raise

    def _pulse(self, point: Point, duration: float) -> None:
        stops = self._stops
        self.link.write_registers(PULSE + point.channel, round(1000.0 * duration))

        def over(image: Image) -> bool:
            self.require_control(f"the pulse of {point.io.name}")
            return not image.digital("DO", point.channel)

        self.wait(over, duration + self._patience, f"the pulse of {point.io.name}", stops)

    def set_again(self, name: str, value: bool) -> None:
        """Switch a digital output; a second time when no answer came. Only where doing it twice does no harm."""
        try:
            self.write_digital(name, value)
        except DeviceTimeout:
            self.write_digital(name, value)

    # -------------------------------------------------------------------------------- waiting
    @property
    def stops(self) -> int:
        """Give how often `stop` was called."""
        return self._stops

    @property
    def _patience(self) -> float:
        # A reading asked for twice with the line drained in between, behind another request of the same kind.
        return 6.0 * self._settings.request_timeout

    def newest(self) -> Image | None:
        """Give the newest image however old, None when there never was one."""
        newest = self._newest
        return None if newest is None else newest.image

    def ask(self) -> Snapshot:
        """Read an image now, on the caller's thread: quicker than `fresh`, and unknown to points that are debounced."""
        self.observing.check()
        asked, stamp = time.monotonic(), now()
        return Snapshot(self.link.read_image(), asked, stamp)

    def fresh(self) -> Snapshot:
        """Give an image that was asked for after this call. Raises DeviceTimeout, NotConnected, ConnectionLost."""
        return self.wait(lambda _: True, self._patience, "telling its state")

    def wait(self, holds: Callable[[Image], bool], timeout: float, what: str, stops: int | None = None) -> Snapshot:
        """Give the first image asked for from now on of which `holds` is true; `holds` may raise.

        stops: of when the caller began; a stop since then ends the waiting. Raises DeviceTimeout naming `what` after
        `timeout` s, ConnectionLost as soon as the connection is lost, Cancelled.
        """
        began, losses = time.monotonic(), self._losses
        self._hurry.set()
        with self._news:
            while True:
                if stops not in (None, self._stops):
                    raise Cancelled(f"{self.who}: {what} was stopped")
                if losses != self._losses:
                    raise ConnectionLost(f"{self.who}: the connection was lost", str(self._loss or "")) from self._loss
                self.observing.check()
                newest = self._newest
                if newest is not None and newest.asked >= began and holds(newest.image):
                    return newest
                left = began + timeout - time.monotonic()
                if left <= 0.0:
                    raise DeviceTimeout(f"{self.who}: {what} took longer than {timeout:g} s")
                self._news.wait(left)

    # -------------------------------------------------------------------------------- on the observing thread
    def _open(self, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        for each in self._inputs.values():
            each.forget()
        self.link.open(timeout)
        # Asked for twice at most, a serial line drained in between.
        self._take(min(self._settings.request_timeout, max(0.02, (deadline - time.monotonic()) / 3.0)))

    def _watch(self, stopping: threading.Event) -> None:
        while not stopping.is_set():
            self._hurry.wait(PERIOD)
            self._hurry.clear()
            if stopping.is_set():
                return
            try:
                self._take(self._settings.request_timeout)
                if self.in_control:
                    self._keep_quiet()
                    self._tick()
            except NotInControl:
                continue  # given back or lost meanwhile
            except DeviceError:
                if not self._ending:
                    raise
                stopping.wait(0.5)  # closed by us: no loss to tell of

    def _keep_quiet(self) -> None:
        if time.monotonic() - self._triggered < self._settings.watchdog_ms / 5000.0:
            return
        try:
            self.link.write_registers(self._watchdog + TRIGGER, self._number)
        except DeviceTimeout:  # twice does no harm
            self.link.write_registers(self._watchdog + TRIGGER, self._number)
        self._triggered = time.monotonic()

    def _take(self, timeout: float) -> None:
        asked, stamp = time.monotonic(), now()
        image = self.link.read_image(timeout)
        edges = []
        with self._news:
            self._newest = Snapshot(image, asked, stamp)
            self._check_control(image, asked)
            for name, each in self._inputs.items():
                point = self.points[name]
                edges.append(each.take(image.digital(point.kind, point.channel), asked))
            self._news.notify_all()
        for edge in filter(None, edges):
            self.subscriptions.tell(edge)

    def _check_control(self, image: Image, asked: float) -> None:
        if not self.in_control or asked < self._armed:
            return
        state = image.watchdogs[self._settings.watchdog]
        if state is WatchdogState.EXPIRED:
            self._drop("the block's watchdog has expired; its outputs are in their safe state until control is taken")
        elif state is WatchdogState.OFF:
            self._drop("the block's watchdog is off: it was switched off and on, or another host was at it")
        elif (owner := self._other_owner(image)) is not None:
            self._drop(f"{owner} has control")

    def _lost(self, error: DeviceError) -> None:
        self._drop("control ended when the connection was lost")
        with self._news:
            self._loss = error
            self._losses += 1
            self._news.notify_all()
