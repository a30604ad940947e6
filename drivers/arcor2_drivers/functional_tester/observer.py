"""The observed tester: one thread reads its state over and over, which also keeps its host watchdog quiet."""

import threading
import time
from collections.abc import Callable
from typing import Final, NamedTuple

from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceTimeout, NotConnected, Stale
from arcor2_hw.objects.observing import Observing

from .link import ModbusLink
from .registers import RUNNING, Inputs
from .settings import FunctionalTesterSettings

QUIET_PERIOD: Final = 0.1
"""s between readings while nobody waits."""
BUSY_PERIOD: Final = 0.02
"""s between readings while somebody waits for a change."""
FRESH: Final = 0.5
"""s: how old a state may be that is told."""
LIFE_STANDS: Final = 1.0
"""s: the life counter counts ten times a second; when it stands that long, somebody else than the tester answers."""
NOTICED: Final = 0.2
"""s beyond the watchdog after which the tester has surely noticed that we were gone."""


class Snapshot(NamedTuple):
    """What was read, and when it was asked for (monotonic)."""

    inputs: Inputs
    asked: float


class Observer:
    """Keeps the newest state. It never writes."""

    def __init__(self, name: str, settings: FunctionalTesterSettings, lost: Callable[[], None]) -> None:
        self._settings = settings
        self.link = ModbusLink(name, settings.host, settings.port, settings.unit_id, settings.request_timeout)
        self.who = self.link.who
        self.observing = Observing(self.who, self._open, self._watch, self.link.close, self._lost)
        self.guarded = False
        """Whether the tester's host watchdog guards a test: then it must be able to notice a loss."""
        self.losses = 0
        """How often the connection was lost: what was begun before a loss is over, though it may be back already."""
        self.fault_since: Timestamp = now()
        self._tell_lost = lost
        self._news = threading.Condition()
        self._newest: Snapshot | None = None
        self._waiting = 0
        self._hurry = threading.Event()
        self._leave_alone_until = 0.0
        self._life = (-1, 0.0)
        self._loss: DeviceError | None = None
        self._ending = False

    # -------------------------------------------------------------------------------- asked by everybody
    def connect(self, timeout: float) -> None:
        """Begin to observe. Raises NotConnected, DeviceTimeout, DeviceFault, ConnectionLost."""
        self._leave_alone_until = 0.0
        self._ending = False
        self.observing.start(timeout)

    def disconnect(self) -> None:
        """Stop observing; harmless when it was not."""
        self._ending = True
        self.link.close()
        self._hurry.set()
        self.observing.stop()
        self._newest = None
        self.wake()

    def newest(self) -> Inputs | None:
        """Give the newest state however old, None when there never was one."""
        newest = self._newest
        return None if newest is None else newest.inputs

    def current(self) -> Inputs:
        """Give the newest state. Raises NotConnected, ConnectionLost, or Stale when it is too old to count."""
        self.observing.check()
        newest = self._newest
        age = float("inf") if newest is None else time.monotonic() - newest.asked
        if newest is None or age > FRESH:
            raise Stale(f"{self.who}: the newest state is {age:.2f} s old, {FRESH:g} s at most are asked for")
        value, since = self._life
        if (stands := time.monotonic() - since) > LIFE_STANDS:
            raise Stale(f"{self.who} answers, but its life counter has stood at {value} for {stands:.1f} s")
        return newest.inputs

    def wait(self, holds: Callable[[Inputs], bool], timeout: float, what: str) -> Inputs:
        """Give the first state asked for from now on of which `holds` is true; `holds` may raise.

        Raises DeviceTimeout naming `what` after `timeout` s, ConnectionLost as soon as the connection is lost.
        """
        began, losses = time.monotonic(), self.losses
        with self._news:
            self._waiting += 1
            try:
                self._hurry.set()
                while True:
                    self.check_unbroken(losses)
                    newest = self._newest
                    if newest is not None and newest.asked >= began and holds(newest.inputs):
                        return newest.inputs
                    left = began + timeout - time.monotonic()
                    if left <= 0.0:
                        raise DeviceTimeout(f"{self.who}: {what} took longer than {timeout:g} s")
                    self._news.wait(left)
            finally:
                self._waiting -= 1

    def fresh(self) -> Inputs:
        """Give a state that was asked for after this call."""
        # Two readings, each asked for twice, and a connection opened anew in between.
        return self.wait(lambda _: True, 6.0 * self._settings.request_timeout, "telling its state")

    def wake(self) -> None:
        """Let everybody who waits look again."""
        with self._news:
            self._news.notify_all()

    def check_unbroken(self, losses: int) -> None:
        """Return when the tester is observed and was all the time since `losses` was read from here."""
        if self.losses != losses:
            raise ConnectionLost(f"{self.who}: the connection was lost", str(self._loss or "")) from self._loss
        self.observing.check()

    # -------------------------------------------------------------------------------- on the observing thread
    def _open(self, timeout: float) -> None:
        left_alone = self._leave_alone_until - time.monotonic()
        if left_alone > 0.0:
            raise NotConnected(f"{self.who} is left alone for {left_alone:.1f} s, so that it notices that we were gone")
        deadline = time.monotonic() + timeout
        self.link.open(timeout)
        self._life = (-1, 0.0)
        # Each of the two readings may be asked for twice.
        self._take(min(self._settings.request_timeout, max(0.05, (deadline - time.monotonic()) / 4.0)))

    def _watch(self, stopping: threading.Event) -> None:
        while not stopping.is_set():
            self._hurry.wait(BUSY_PERIOD if self._waiting else QUIET_PERIOD)
            self._hurry.clear()
            if stopping.is_set():
                return
            try:
                self._take(self._settings.request_timeout)
            except DeviceError:
                if not self._ending:
                    raise
                stopping.wait(FRESH)  # closed by us: no loss to tell of

    def _take(self, timeout: float) -> None:
        asked = time.monotonic()
        inputs = self.link.read_inputs(timeout)
        if inputs.life != self._life[0]:
            self._life = (inputs.life, time.monotonic())
        before = self._newest
        if inputs.fault_code and (before is None or before.inputs.fault_code != inputs.fault_code):
            self.fault_since = now()
        with self._news:
            self._newest = Snapshot(inputs, asked)
            self._news.notify_all()

    def _lost(self, error: DeviceError) -> None:
        self._loss = error
        self.losses += 1
        newest = self.newest()
        if self.guarded and newest is not None and newest.state in RUNNING:
            # Asking again would keep a test alive that nobody waits for any more: the station ends it by itself.
            self._leave_alone_until = self.link.sent + self._settings.watchdog_ms / 1000.0 + NOTICED
        self._tell_lost()
        self.wake()
