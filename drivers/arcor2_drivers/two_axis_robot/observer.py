"""Observer: the one thread that speaks with the servos. It reads their state all the time and does jobs in between."""

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any, Final, NamedTuple

from arcor2_hw.exceptions import Cancelled, ConnectionLost, DeviceError, DeviceTimeout, Refused, Stale
from arcor2_hw.keep_alive import BUSY_FOR, LONGEST_STEP, KeepAlive, RunningTime, once_within
from arcor2_hw.objects.observing import Observing

from .bus import Bus
from .registers import EEPROM, STATE, ServoSetup, ServoState, decode, decode_setup
from .settings import TwoAxisRobotSettings

BUSY_PERIOD: Final = 0.01
QUIET_PERIOD: Final = 0.03
"""s between readings while nothing is awaited; far below the shortest bus watchdog."""
FRESH: Final = 0.25
"""s after which a state is too old."""
JOB_TIMEOUT: Final = 1.5
QUIET: Final = 0.1
"""s without a reading after which the child process speaks, so that no answer is on its way."""
KICK_PERIOD: Final = 0.05
"""s between what it says; far below the shortest bus watchdog."""
TURNS: Final = 0.02
"""s for which velocity 0 must be told to count as standing: a joint that turns back tells it too."""
JITTERS: Final = 0.1
"""s for which the smallest velocity there is must be told to count as standing: at rest the last digit may flicker."""

log = logging.getLogger(__name__)


class Snapshot(NamedTuple):
    """The state of both servos, when it was asked for (monotonic, s), and whether both stand."""

    servos: tuple[ServoState, ServoState]
    asked: float
    standing: bool

    @property
    def age(self) -> float:
        """Give its age in s."""
        return time.monotonic() - self.asked


class Observer:
    """Observes both servos. Reading them keeps their bus watchdog quiet; while this process is busy a child does."""

    def __init__(self, name: str, settings: TwoAxisRobotSettings, lost: Callable[[DeviceError], None]) -> None:
        self.bus = Bus(name, settings.port, settings.baud_rate)
        self.who = self.bus.who
        self.setups: tuple[ServoSetup, ...] = ()
        self.losses = 0
        self.busy = False
        self.observing = Observing(self.who, self._open, self._watch, self._close, self._lost)
        self._ids = settings.ids
        self._tell_lost = lost
        self._newest: Snapshot | None = None
        self._news = threading.Condition()
        self._jobs: deque[tuple[Future[Any], Callable[[Bus], Any]]] = deque()
        self._wake = threading.Event()
        self._moved = self._faster = -math.inf
        self._keep_alive: KeepAlive | None = None

    def newest(self) -> Snapshot | None:
        """Give the newest state however old."""
        return self._newest

    def current(self, max_age: float = FRESH) -> Snapshot:
        """Return the newest state; wait a moment for one that is not too old. Raises ConnectionLost, Stale."""
        self.observing.check()
        once_within(lambda: self._newest is not None and self._newest.age <= max_age, BUSY_FOR, BUSY_PERIOD)
        self.observing.check()
        newest = self._newest
        if newest is None or newest.age > max_age:
            age = "unknown" if newest is None else f"{newest.age:.2f} s old"
            raise Stale(f"{self.who}: the newest state is {age}, {max_age:g} s at most are asked for")
        return newest

    def fresh(self, timeout: float = 1.0) -> Snapshot:
        """Give a state asked for after this call. Raises ConnectionLost, DeviceTimeout."""
        began, losses, clock = time.monotonic(), self.losses, RunningTime()
        self._wake.set()
        with self._news:
            while True:
                self.observing.check()
                if self.losses != losses:
                    raise ConnectionLost(f"the connection to {self.who} was lost")
                newest = self._newest
                if newest is not None and newest.asked >= began:
                    return newest
                if clock() >= timeout:
                    raise DeviceTimeout(f"{self.who} did not tell its state within {timeout:g} s")
                self._news.wait(LONGEST_STEP)

    def do(self, job: Callable[[Bus], Any], urgent: bool = False, timeout: float = JOB_TIMEOUT) -> Any:
        """Have a job done by the thread and give what it gives; an urgent one is next. What is late is dropped."""
        self.observing.check()
        future: Future[Any] = Future()
        (self._jobs.appendleft if urgent else self._jobs.append)((future, job))
        self._wake.set()
        try:
            return future.result(timeout)
        except TimeoutError:
            future.cancel()
            raise DeviceTimeout(f"{self.who} did not come to a command within {timeout:g} s") from None

    def end_keep_alive(self) -> None:
        """Leave the servos to their watchdog, except for our reading. Does nothing the second time."""
        keep_alive, self._keep_alive = self._keep_alive, None
        if keep_alive is not None:
            keep_alive.close()

    # -------------------------------------------------------------------------------- on the observing thread
    def begin_keep_alive(self) -> None:
        """Keep the servos' watchdog quiet while this process is busy, from now on."""
        if self._keep_alive is None:
            self._keep_alive = self.bus.keep_alive(self._ids, KICK_PERIOD, QUIET)

    def _open(self, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        self.bus.open()
        setups = []
        for number in self._ids:
            self.bus.again(partial(self.bus.ping, number))
            setups.append(decode_setup(self.bus.again(partial(self.bus.read, number, EEPROM))))
            if time.monotonic() > deadline:
                raise DeviceTimeout(f"{self.who} could not be opened within {timeout:g} s")
        self.setups = tuple(setups)
        self._take()

    def _watch(self, stopping: threading.Event) -> None:
        while not stopping.is_set():
            if not self._jobs:
                self._wake.wait(BUSY_PERIOD if self.busy else QUIET_PERIOD)
            self._wake.clear()
            if stopping.is_set():
                return
            if self._jobs:
                self._do(*self._jobs.popleft())
            self._take()

    def _do(self, future: Future[Any], job: Callable[[Bus], Any]) -> None:
        if not future.set_running_or_notify_cancel():
            return
        try:
            result = job(self.bus)
        except (Refused, Cancelled) as e:
            future.set_exception(e)  # the line is well
        except DeviceError as e:
            future.set_exception(e)
            raise  # its answer may still come, and would answer something else
        except Exception as e:
            log.exception("%s: a command failed", self.who)
            future.set_exception(e)
        else:
            future.set_result(result)

    def _take(self) -> None:
        def ask() -> tuple[float, list[bytes]]:
            return time.monotonic(), self.bus.sync_read(self._ids, STATE)

        asked, (first, second) = self.bus.again(ask)
        servos = decode(first), decode(second)
        fastest = max(abs(servo.velocity) for servo in servos)
        if fastest > 0:
            self._moved = asked
        if fastest > 1:
            self._faster = asked
        standing = asked - self._moved > TURNS or asked - self._faster > JITTERS
        with self._news:
            self._newest = Snapshot(servos, asked, standing)
            self._news.notify_all()
        if (keep_alive := self._keep_alive) is not None:
            keep_alive.pulse()

    def _close(self) -> None:
        self.end_keep_alive()
        self.bus.close()
        while self._jobs:
            future, _ = self._jobs.popleft()
            if future.set_running_or_notify_cancel():
                future.set_exception(ConnectionLost(f"the connection to {self.who} was lost; nothing was sent"))

    def _lost(self, error: DeviceError) -> None:
        self.losses += 1
        self._tell_lost(error)
        with self._news:
            self._news.notify_all()
