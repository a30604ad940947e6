"""The observed drive: one thread reads its state over and over, and sends our heartbeat while that goes well."""

import threading
import time
from collections.abc import Callable
from typing import Final, NamedTuple

from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, Stale
from arcor2_hw.objects.observing import Observing

from . import cia402
from .cia402 import Power
from .link import EMCY, HEARTBEAT, CanLink
from .settings import ConveyorSettings

QUIET_PERIOD: Final = 0.05
"""s between readings while nobody waits."""
BUSY_PERIOD: Final = 0.01
"""s between readings while somebody waits for a change."""
FRESH: Final = 0.5
"""s: how old a state may be that is told."""


class Snapshot(NamedTuple):
    """What was read, when it was asked for (monotonic) and when it came (UTC)."""

    power: Power
    statusword: int
    mode: int
    position: int
    velocity: int
    error_code: int
    asked: float
    stamp: Timestamp


class Observer:
    """Keeps the newest state. It writes nothing; while `guarded` it sends our heartbeat."""

    def __init__(self, name: str, settings: ConveyorSettings, lost: Callable[[], None]) -> None:
        self._settings = settings
        self.link = CanLink(name, settings, self._hear)
        self.who = self.link.who
        self.observing = Observing(self.who, self._open, self._watch, self.link.close, self._lost)
        self.guarded = False
        """Whether the drive listens for our heartbeat."""
        self.losses = 0
        """How often the connection was lost: what was begun before a loss is over, though it may be back already."""
        self.emergency = 0
        """Code of the newest EMCY that was not taken back."""
        self.emergency_since: Timestamp = now()
        self._tell_lost = lost
        self._news = threading.Condition()
        self._newest: Snapshot | None = None
        self._waiting = 0
        self._hurry = threading.Event()
        self._beat = 0.0
        self._masters: dict[int, float] = {}
        self._loss: DeviceError | None = None
        self._ending = self._opened = False

    # -------------------------------------------------------------------------------- asked by everybody
    def connect(self, timeout: float) -> None:
        """Begin to observe. Raises NotConnected, DeviceTimeout, DeviceFault, ConnectionLost."""
        self._ending = False
        self.observing.start(timeout)

    def disconnect(self) -> None:
        """Stop observing; harmless when it was not."""
        self._ending = True
        self.guarded = False
        self._hurry.set()
        self.observing.stop()
        self._newest = None
        self.wake()

    def newest(self) -> Snapshot | None:
        """Give the newest state however old, None when there never was one."""
        return self._newest

    def current(self) -> Snapshot:
        """Give the newest state. Raises NotConnected, ConnectionLost, or Stale when it is too old to count."""
        self.observing.check()
        newest = self._newest
        age = float("inf") if newest is None else time.monotonic() - newest.asked
        if newest is None or age > FRESH:
            raise Stale(f"{self.who}: the newest state is {age:.2f} s old, {FRESH:g} s at most are asked for")
        return newest

    def wait(self, holds: Callable[[Snapshot], bool], timeout: float, what: str) -> Snapshot:
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
                    if newest is not None and newest.asked >= began and holds(newest):
                        return newest
                    left = began + timeout - time.monotonic()
                    if left <= 0.0:
                        raise DeviceTimeout(f"{self.who}: {what} took longer than {timeout:.3g} s")
                    self._news.wait(left)
            finally:
                self._waiting -= 1

    def fresh(self) -> Snapshot:
        """Give a state that was asked for after this call."""
        return self.wait(lambda _: True, 6.0 * self._settings.sdo_timeout, "telling its state")

    def wake(self) -> None:
        """Let everybody who waits look again."""
        with self._news:
            self._news.notify_all()

    def check_unbroken(self, losses: int) -> None:
        """Return when the drive is observed and was all the time since `losses` was read from here."""
        if self.losses != losses:
            raise ConnectionLost(f"{self.who}: the connection was lost", str(self._loss or "")) from self._loss
        self.observing.check()

    def heard(self, master: int, within: float) -> bool:
        """Tell whether a heartbeat of node `master` came in the last `within` s; ours does not come back to us."""
        return time.monotonic() - self._masters.get(master, -1e9) <= within

    # -------------------------------------------------------------------------------- on the receiving thread
    def _hear(self, identifier: int, data: bytes) -> None:
        node = self._settings.node_id
        if identifier == HEARTBEAT + node and data == b"\x00":
            if self._opened:
                self.link.lose(ConnectionLost(f"{self.who} was reset or switched off and on: it has booted"))
        elif HEARTBEAT < identifier <= HEARTBEAT + 127 and identifier != HEARTBEAT + node:
            self._masters[identifier - HEARTBEAT] = time.monotonic()
        elif identifier == EMCY + node and len(data) == 8:
            self.emergency = int.from_bytes(data[:2], "little")
            self.emergency_since = now()
            self._hurry.set()

    # -------------------------------------------------------------------------------- on the observing thread
    def _open(self, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        self._opened = False
        self.link.open(timeout)
        left = deadline - time.monotonic()
        profile = self.link.read_first(cia402.DEVICE_TYPE, left, lambda: self._ending) & 0xFFFF
        if profile != cia402.PROFILE:
            raise DeviceFault(f"{self.who} is no drive: it has the device profile {profile}, not {cia402.PROFILE}")
        self.link.read(cia402.VENDOR)  # drains what is late, see CanLink
        self.emergency = 0
        self._opened = True  # from now on a boot is a loss
        self._take()

    def _watch(self, stopping: threading.Event) -> None:
        while not stopping.is_set():
            self._hurry.wait(BUSY_PERIOD if self._waiting else QUIET_PERIOD)
            self._hurry.clear()
            if stopping.is_set():
                return
            try:
                self._take()
                self.keep_alive()
            except DeviceError:
                if not self._ending:
                    raise
                stopping.wait(FRESH)  # closed by us: no loss to tell of

    def keep_alive(self) -> None:
        """Send our heartbeat when it is due. Called only after the drive has answered."""
        clock = time.monotonic()
        if self.guarded and clock - self._beat >= self._settings.heartbeat_ms / 6000.0:
            self.link.heartbeat()
            self._beat = clock

    def _take(self) -> None:
        asked, read = time.monotonic(), self.link.read
        statusword = read(cia402.STATUSWORD)
        try:
            power = cia402.power(statusword)
        except ValueError as error:
            raise DeviceFault(f"{self.who} tells what no drive tells: {error}") from error
        snapshot = Snapshot(
            power,
            statusword,
            read(cia402.MODE_DISPLAY),
            read(cia402.POSITION),
            read(cia402.VELOCITY),
            read(cia402.ERROR_CODE),
            asked,
            now(),
        )
        before = self._newest
        if snapshot.error_code and (before is None or before.error_code != snapshot.error_code):
            self.emergency_since = now()
        with self._news:
            self._newest = snapshot
            self._news.notify_all()

    def _lost(self, error: DeviceError) -> None:
        self._loss = error
        self.losses += 1
        self.guarded = False  # no heartbeat: the drive stops by itself
        self._tell_lost()
        self.wake()
