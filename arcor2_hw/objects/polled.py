"""Polled: a device whose state one thread reads over and over, so that anybody can have it, or wait for a change."""

import threading
import time
from collections.abc import Callable
from typing import Final, Generic, NamedTuple, TypeVar

from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.exceptions import Cancelled, ConnectionLost, DeviceError, DeviceTimeout, Stale
from arcor2_hw.keep_alive import BUSY_FOR, LONGEST_STEP, RunningTime, once_within
from arcor2_hw.objects.observing import Observing

T = TypeVar("T")

GoOn = Callable[[], None]
"""Returns while one may go on; raises Cancelled or ConnectionLost when not."""

CLOSED_BY_US: Final = 0.5
"""s the thread waits to be told to end, when reading fails because the connection is being closed."""


class Snapshot(NamedTuple, Generic[T]):
    """A state, and when it was asked for: on the monotonic clock and in UTC."""

    value: T
    asked: float
    stamp: Timestamp

    @classmethod
    def by(cls, read: Callable[[], T]) -> "Snapshot[T]":
        """Make one of what `read` gives, asked for now."""
        asked, stamp = time.monotonic(), now()
        return cls(read(), asked, stamp)


class Polled(Generic[T]):
    """Keeps the newest state of a device; the connection's life is Observing's.

    who: name and address, for errors. open_(timeout): opens and gives the first state, made by `Snapshot.by`. read():
    gives a state, or None when there is nothing to take because states come unasked, by `put`. close(): closes,
    harmless when closed. quiet, busy: s between readings while nobody waits, and while somebody does. fresh: s a state
    counts for `current`. answers_within: s one reading takes at most, asked twice and behind another. All of the
    following are called on the observing thread: taken(snapshot) before others see the state, and while nobody else
    gets one; after() after each reading; lost(error) once per loss. interrupt(): ends a reading that waits, when we
    disconnect. All callables raise DeviceError.
    """

    def __init__(
        self,
        who: str,
        open_: Callable[[float], Snapshot[T]],
        read: Callable[[], T | None],
        close: Callable[[], None],
        *,
        quiet: float = 0.1,
        busy: float = 0.02,
        fresh: float = 0.5,
        answers_within: float = 3.0,
        taken: Callable[[Snapshot[T]], None] = lambda _: None,
        after: Callable[[], None] = lambda: None,
        lost: Callable[[DeviceError], None] = lambda _: None,
        interrupt: Callable[[], None] = lambda: None,
    ) -> None:
        self.who = who
        self.observing = Observing(who, self._first, self._watch, close, self._lost)
        self.losses = 0
        """How often the connection was lost: what was begun before a loss is over, though it may be back already."""
        self._open, self._read, self._interrupt = open_, read, interrupt
        self._taken, self._after, self._tell_lost = taken, after, lost
        self._quiet, self._busy, self._fresh, self._answers_within = quiet, busy, fresh, answers_within
        self._news = threading.Condition()
        self._newest: Snapshot[T] | None = None
        self._waiting = self._stops = 0
        self._hurry = threading.Event()
        self._loss: DeviceError | None = None
        self._ending = False

    # -------------------------------------------------------------------------------- life
    def connect(self, timeout: float) -> None:
        """Begin to observe; harmless when it was. Raises NotConnected, DeviceTimeout, DeviceFault, ConnectionLost."""
        self._ending = False
        self.observing.start(timeout)

    def disconnect(self) -> None:
        """Stop observing; harmless when it was not. What waits ends with NotConnected."""
        self._ending = True
        self._interrupt()
        self._hurry.set()
        self.observing.stop()
        self._newest = None
        self.wake()

    @property
    def ending(self) -> bool:
        """Tell whether we are disconnecting, so that a failure of the connection is our own doing."""
        return self._ending

    @property
    def taking(self) -> threading.Condition:
        """What is held while a state is taken: nothing is `taken` as long as somebody else holds it."""
        return self._news

    # -------------------------------------------------------------------------------- states
    def newest(self) -> T | None:
        """Give the newest state however old, None when there never was one."""
        newest = self._newest
        return None if newest is None else newest.value

    def current(self) -> Snapshot[T]:
        """Return the newest state; wait a moment for one that is not too old to count.

        Raises NotConnected, ConnectionLost, Stale.
        """
        self.observing.check()
        once_within(lambda: self._age() <= self._fresh or not self.observing.online, BUSY_FOR, self._busy)
        self.observing.check()
        newest, age = self._newest, self._age()
        if newest is None or age > self._fresh:
            raise Stale(f"{self.who}: the newest state is {age:.2f} s old, {self._fresh:g} s at most are asked for")
        return newest

    def _age(self) -> float:
        newest = self._newest
        return float("inf") if newest is None else time.monotonic() - newest.asked

    def fresh(self) -> Snapshot[T]:
        """Give a state that was asked for after this call. Raises DeviceTimeout, NotConnected, ConnectionLost."""
        return self.wait(lambda _: True, self._answers_within, "telling its state")

    def wait(self, holds: Callable[[T], bool], timeout: float, what: str, go_on: GoOn | None = None) -> Snapshot[T]:
        """Give the first state asked for from now on of which `holds` is true; `holds` may raise.

        go_on: of `begin`. Raises DeviceTimeout naming `what` after `timeout` s, ConnectionLost as soon as the
        connection is lost.
        """
        began, losses, clock = time.monotonic(), self.losses, RunningTime()
        with self._news:
            self._waiting += 1
            try:
                self._hurry.set()
                while True:
                    if go_on is not None:
                        go_on()
                    self.check_unbroken(losses)
                    newest = self._newest
                    if newest is not None and newest.asked >= began and holds(newest.value):
                        return newest
                    if clock() >= timeout:
                        raise DeviceTimeout(f"{self.who}: {what} took longer than {timeout:.3g} s")
                    self._news.wait(min(timeout, LONGEST_STEP))
            finally:
                self._waiting -= 1

    def put(self, value: T, asked: float) -> None:
        """Take a state that came unasked, on the thread it came on; `asked` is since when it holds (monotonic)."""
        self._set(Snapshot(value, asked, now()))

    def wake(self) -> None:
        """Let everybody who waits look again."""
        with self._news:
            self._news.notify_all()

    def hurry(self) -> None:
        """Have a state read at once."""
        self._hurry.set()

    # -------------------------------------------------------------------------------- giving up
    def begin(self, what: str) -> GoOn:
        """Give the check for what begins now: it raises after a stop, and after a loss that is over already."""
        stops, losses = self._stops, self.losses

        def check() -> None:
            if self._stops != stops:
                raise Cancelled(f"{self.who}: {what} was stopped")
            self.check_unbroken(losses)

        return check

    def stop_waiting(self) -> None:
        """End with Cancelled what was begun before."""
        self._stops += 1
        self.wake()

    def check_unbroken(self, losses: int) -> None:
        """Return when the device is observed and was all the time since `losses` was read from here."""
        if self.losses != losses:
            raise ConnectionLost(f"{self.who}: the connection was lost", str(self._loss or "")) from self._loss
        self.observing.check()

    # -------------------------------------------------------------------------------- on the observing thread
    def _first(self, timeout: float) -> None:
        self._set(self._open(timeout))

    def _watch(self, stopping: threading.Event) -> None:
        while not stopping.is_set():
            self._hurry.wait(self._busy if self._waiting else self._quiet)
            self._hurry.clear()
            if stopping.is_set():
                return
            try:
                self._take()
                self._after()
            except DeviceError:
                if not self._ending:
                    raise
                stopping.wait(CLOSED_BY_US)  # no loss to tell of

    def _take(self) -> None:
        asked, stamp = time.monotonic(), now()
        value = self._read()
        if value is not None:
            self._set(Snapshot(value, asked, stamp))

    def _set(self, snapshot: Snapshot[T]) -> None:
        with self._news:
            self._taken(snapshot)
            self._newest = snapshot
            self._news.notify_all()

    def _lost(self, error: DeviceError) -> None:
        self._loss = error
        self.losses += 1
        self._tell_lost(error)
        self.wake()
