"""Observation of both servos: the only thread that uses the bus. It reads the state and executes jobs in between."""

import logging
import math
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any, Final, NamedTuple

from arcor2_hw.exceptions import Cancelled, ConnectionLost, DeviceError, DeviceTimeout, Refused
from arcor2_hw.keep_alive import KeepAlive
from arcor2_hw.objects.state_observer import Snapshot, StateObserver

from .bus import Bus
from .registers import EEPROM, STATE, ServoSetup, ServoState, decode, decode_setup
from .settings import TwoAxisRobotSettings

JOB_TIMEOUT: Final = 1.5
"""Time for a job, s."""
MAX_READING_GAP: Final = 0.1
"""Time without a reading after which the child process signals the watchdog, s: no answer is then pending."""
KICK_PERIOD: Final = 0.05
"""Time between signals of the child process, s; much shorter than the shortest bus watchdog."""
REVERSAL_TIME: Final = 0.02
"""Time at velocity 0 after which a joint is at standstill, s: a joint that reverses reports 0, too."""
JITTER_TIME: Final = 0.1
"""Time at the lowest velocity after which a joint is at standstill, s: the last digit may flicker."""

log = logging.getLogger(__name__)


class State(NamedTuple):
    """State of both servos, and whether both are at standstill."""

    servos: tuple[ServoState, ServoState]
    standing: bool


class Observer(StateObserver[State]):
    """Observes both servos. Readings signal their watchdog. While this process is busy, a child process does."""

    period = 0.03
    busy_period = 0.01
    fresh_for = 0.25

    def __init__(self, name: str, settings: TwoAxisRobotSettings) -> None:
        self.bus = Bus(name, settings.port, settings.baud_rate)
        super().__init__(self.bus.who)
        self.setups: tuple[ServoSetup, ...] = ()
        self._ids = settings.ids
        self._jobs: deque[tuple[Future[Any], Callable[[Bus], Any]]] = deque()
        self._moved = self._faster = -math.inf
        self._keep_alive: KeepAlive | None = None

    def do(self, job: Callable[[Bus], Any], urgent: bool = False, timeout: float = JOB_TIMEOUT) -> Any:
        """Execute a job on the observing thread and return its result.

        Urgent jobs come first. Drop it after `timeout` s.
        """
        self.observing.check()
        future: Future[Any] = Future()
        (self._jobs.appendleft if urgent else self._jobs.append)((future, job))
        self.hurry()
        try:
            return future.result(timeout)
        except TimeoutError:
            future.cancel()
            raise DeviceTimeout(
                "{device} did not execute a command within {timeout:g} s.", device=self.who, timeout=timeout
            ) from None

    def end_keep_alive(self) -> None:
        """End the child process, so that only reading keeps the watchdog from tripping."""
        keep_alive, self._keep_alive = self._keep_alive, None
        if keep_alive is not None:
            keep_alive.close()

    # -------------------------------------------------------------------------------- on the observing thread
    def start_keep_alive(self) -> None:
        """Start the child process that keeps the watchdog from tripping while this process is busy."""
        if self._keep_alive is None:
            self._keep_alive = self.bus.keep_alive(self._ids, KICK_PERIOD, MAX_READING_GAP)

    def open(self, timeout: float) -> Snapshot[State]:
        """Open the port, and read setup and state of the servos."""
        deadline = time.monotonic() + timeout
        self.bus.open()
        setups = []
        for number in self._ids:
            self.bus.again(partial(self.bus.ping, number))
            setups.append(decode_setup(self.bus.again(partial(self.bus.read, number, EEPROM))))
            if time.monotonic() > deadline:
                raise DeviceTimeout(
                    "{device} could not be opened within {timeout:g} s.", device=self.who, timeout=timeout
                )
        self.setups = tuple(setups)
        return Snapshot.by(lambda: self._read()[0])

    def read(self) -> None:
        """Execute a job, then read the state."""
        if self._jobs:
            self._execute(*self._jobs.popleft())
            if self._jobs:
                self.hurry()
        self.put(*self._read())

    def after_reading(self) -> None:
        """Report to the child process that the servos are observed."""
        if (keep_alive := self._keep_alive) is not None:
            keep_alive.pulse()

    def close(self) -> None:
        """Close the port, and cancel the pending jobs."""
        self.end_keep_alive()
        self.bus.close()
        while self._jobs:
            future, _ = self._jobs.popleft()
            if future.set_running_or_notify_cancel():
                future.set_exception(
                    ConnectionLost("The connection to {device} was lost. Nothing was sent.", device=self.who)
                )

    def _execute(self, future: Future[Any], job: Callable[[Bus], Any]) -> None:
        if not future.set_running_or_notify_cancel():
            return
        try:
            result = job(self.bus)
        except (Refused, Cancelled) as e:
            future.set_exception(e)  # the connection is not affected
        except DeviceError as e:
            future.set_exception(e)
            raise  # a late answer could be mistaken for another one
        except Exception as e:
            log.exception("%s: a command failed", self.who)
            future.set_exception(e)
        else:
            future.set_result(result)

    def _read(self) -> tuple[State, float]:
        """Return the state, and when it was requested (monotonic)."""

        def ask() -> tuple[float, list[bytes]]:
            return time.monotonic(), self.bus.sync_read(self._ids, STATE)

        asked, (first, second) = self.bus.again(ask)
        servos = decode(first), decode(second)
        fastest = max(abs(servo.velocity) for servo in servos)
        if fastest > 0:
            self._moved = asked
        if fastest > 1:
            self._faster = asked
        return State(servos, asked - self._moved > REVERSAL_TIME or asked - self._faster > JITTER_TIME), asked
