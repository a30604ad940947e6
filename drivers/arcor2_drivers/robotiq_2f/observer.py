"""The observed gripper: one thread reads its status over and over."""

import threading
import time
from collections.abc import Callable
from typing import Final

from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceTimeout, Stale
from arcor2_hw.objects.observing import Observing

from .status import Link, Status

QUIET_PERIOD: Final = 0.1
"""s between readings while nobody waits."""
BUSY_PERIOD: Final = 0.01
"""s between readings while somebody waits for a change."""
FRESH: Final = 1.0
"""s: how old a status may be that is told."""


class Observer:
    """Keeps the newest status. It never writes."""

    def __init__(self, link: Link, seen: Callable[[Status], None], lost: Callable[[], None]) -> None:
        self.link, self.who = link, link.who
        self.observing = Observing(link.who, self._open, self._watch, link.close, self._lost)
        self.losses = 0
        """How often the connection was lost: what was begun before a loss is over."""
        self.fault_since: Timestamp = now()
        self._tell_seen, self._tell_lost = seen, lost
        self._news = threading.Condition()
        self._newest: tuple[Status, float] | None = None
        self._waiting = 0
        self._hurry = threading.Event()
        self._loss: DeviceError | None = None
        self._ending = False

    def connect(self, timeout: float) -> None:
        """Begin to observe. Raises NotConnected, DeviceTimeout, DeviceFault, ConnectionLost."""
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

    def newest(self) -> Status | None:
        """Give the newest status however old, None when there is none."""
        return None if self._newest is None else self._newest[0]

    def current(self) -> Status:
        """Give the newest status. Raises NotConnected, ConnectionLost, or Stale when it is too old to count."""
        self.observing.check()
        newest = self._newest
        age = float("inf") if newest is None else time.monotonic() - newest[1]
        if newest is None or age > FRESH:
            raise Stale(f"{self.who}: the newest status is {age:.2f} s old, {FRESH:g} s at most are asked for")
        return newest[0]

    def wait(self, holds: Callable[[Status], bool], timeout: float, what: str) -> Status:
        """Give the first status asked for from now on of which `holds` is true; `holds` may raise.

        Raises DeviceTimeout naming `what` after `timeout` s, ConnectionLost as soon as the connection is lost.
        """
        began, losses = time.monotonic(), self.losses
        seen = -1.0
        with self._news:
            self._waiting += 1
            self._hurry.set()
            try:
                while True:
                    if self.losses != losses:
                        raise ConnectionLost(f"{self.who}: the connection was lost", str(self._loss or ""))
                    self.observing.check()
                    newest = self._newest
                    if newest is not None and newest[1] >= began and newest[1] != seen:
                        seen = newest[1]
                        if holds(newest[0]):
                            return newest[0]
                    left = began + timeout - time.monotonic()
                    if left <= 0.0:
                        raise DeviceTimeout(f"{self.who}: {what} took longer than {timeout:g} s")
                    self._news.wait(left)
            finally:
                self._waiting -= 1

    def wake(self) -> None:
        """Let everybody who waits look again."""
        with self._news:
            self._news.notify_all()

    # -------------------------------------------------------------------------------- on the observing thread
    def _open(self, timeout: float) -> None:
        self.link.open(timeout)
        self._take()

    def _watch(self, stopping: threading.Event) -> None:
        while not stopping.is_set():
            self._hurry.wait(BUSY_PERIOD if self._waiting else QUIET_PERIOD)
            self._hurry.clear()
            if stopping.is_set():
                return
            try:
                self._take()
            except DeviceError:
                if not self._ending:
                    raise
                stopping.wait(FRESH)  # closed by us: no loss to tell of

    def _take(self) -> None:
        asked = time.monotonic()
        status = self.link.read()
        before = self.newest()
        if status.fault and (before is None or before.fault != status.fault):
            self.fault_since = now()
        self._tell_seen(status)
        with self._news:
            self._newest = status, asked
            self._news.notify_all()

    def _lost(self, error: DeviceError) -> None:
        self._loss = error
        self.losses += 1
        self._tell_lost()
        self.wake()
