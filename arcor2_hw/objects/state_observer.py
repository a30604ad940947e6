"""StateObserver: reads the state of a device periodically; other threads get the state or wait for a change."""

import threading
import time
from collections.abc import Callable
from typing import Generic, NamedTuple, TypeVar

from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.exceptions import DeviceError, DeviceTimeout, Stale
from arcor2_hw.keep_alive import BUSY_FOR, LONGEST_STEP, RunningTime, once_within
from arcor2_hw.messages import Message
from arcor2_hw.objects.observing import GoOn, Observing, listener_of_states

T = TypeVar("T")

CLOSED_BY_US = 0.5
"""Time that the thread waits for its end after a read that failed because we closed the connection, s."""


class Snapshot(NamedTuple, Generic[T]):
    """A state and the time at which it was requested: on the monotonic clock (s) and in UTC."""

    value: T
    asked: float
    stamp: Timestamp

    @classmethod
    def by(cls, read: Callable[[], T]) -> "Snapshot[T]":
        """Call `read` and return its result as a snapshot requested now."""
        asked, stamp = time.monotonic(), now()
        return cls(read(), asked, stamp)


class StateObserver(Generic[T]):
    """Keep the newest state of a device.

    A driver overrides `open`, `read` and `close`, and if needed `on_state`, `after_reading`, `on_lost` and `interrupt`.
    They run on the observing thread, except the first `open`, `interrupt`, and `on_state` of unsolicited states
    (`put`). They raise DeviceError.
    """

    period: float = 0.1
    """Time between readings while no thread waits for a state, s."""
    busy_period: float = 0.02
    """Time between readings while a thread waits for a state, s."""
    fresh_for: float = 0.5
    """Maximum age of a current state, s."""
    answers_within: float = 3.0
    """Time limit of `fresh`, s: long enough for a repeated reading after another request."""

    def __init__(self, who: str | Message) -> None:
        self.who = who
        self.observing = Observing(who, self._first, self._watch, self.close, self._lost)
        self._changed = threading.Condition()
        self._newest: Snapshot[T] | None = None
        self._waiting = 0
        self._hurry = threading.Event()
        self._ending = False
        self._taken = listener_of_states()

    # -------------------------------------------------------------------------------- hooks
    def open(self, timeout: float) -> Snapshot[T]:
        """Open the connection within `timeout` s and return the first state, made by `Snapshot.by`."""
        raise NotImplementedError

    def read(self) -> T | None:
        """Read the state. Return None if the device sends its states unsolicited."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the connection. It does nothing when the connection is closed."""

    def interrupt(self) -> None:
        """End a reading in progress, because the device is being disconnected."""

    def on_state(self, snapshot: Snapshot[T]) -> None:
        """Process a new state before other threads get it."""

    def after_reading(self) -> None:
        """Do what is necessary after each reading, such as feeding a watchdog."""

    def on_lost(self, error: DeviceError) -> None:
        """Handle a connection loss. It is called once per loss."""

    # -------------------------------------------------------------------------------- life
    def connect(self, timeout: float) -> None:
        """Start observing. It does nothing when started. Raises NotConnected, DeviceTimeout, DeviceFault."""
        self._ending = False
        self.observing.start(timeout)

    def disconnect(self) -> None:
        """Stop observing. It does nothing when stopped. Waiting threads get NotConnected."""
        self._ending = True
        self.interrupt()
        self._hurry.set()
        self.observing.stop()
        self._newest = None
        self.wake()

    @property
    def ending(self) -> bool:
        """Return whether the device is being disconnected, so that errors of the connection are expected."""
        return self._ending

    @property
    def losses(self) -> int:
        """Return the number of connection losses; see `check_unbroken`."""
        return self.observing.losses

    @property
    def taking(self) -> threading.Condition:
        """Return the lock of the state. `on_state` does not run while another thread holds it."""
        return self._changed

    # -------------------------------------------------------------------------------- states
    def newest(self) -> T | None:
        """Return the newest state of any age; None before the first."""
        newest = self._newest
        return None if newest is None else newest.value

    def current(self) -> Snapshot[T]:
        """Return the newest state. Wait up to BUSY_FOR for one that is not older than `fresh_for`.

        Raises:
            NotConnected, ConnectionLost: The device is not observed.
            Stale: The newest state is too old.
        """
        self.observing.check()
        once_within(lambda: self._age() <= self.fresh_for or not self.observing.online, BUSY_FOR, self.busy_period)
        self.observing.check()
        newest, age = self._newest, self._age()
        if newest is None or age > self.fresh_for:
            raise Stale(
                "{device}: the newest state is {age:.2f} s old; at most {fresh_for:g} s are allowed",
                device=self.who,
                age=age,
                fresh_for=self.fresh_for,
            )
        return newest

    def _age(self) -> float:
        newest = self._newest
        return float("inf") if newest is None else time.monotonic() - newest.asked

    def fresh(self) -> Snapshot[T]:
        """Return a state requested after this call. Raises DeviceTimeout, NotConnected, ConnectionLost."""
        return self.wait(lambda _: True, self.answers_within, "reporting its state")

    def wait(self, holds: Callable[[T], bool], timeout: float, what: str, go_on: GoOn | None = None) -> Snapshot[T]:
        """Return the first state requested from now on for which `holds` is true.

        Args:
            holds: Returns whether a state is the awaited one. It may raise DeviceError.
            timeout: Longest time to wait, s.
            what: Name of the operation, for errors.
            go_on: Check of the work that waits, from `begin`.

        Raises:
            DeviceTimeout: The awaited state was not reached in time.
            ConnectionLost: The connection was lost.
            Cancelled: The work was stopped.
        """
        began, losses, clock = time.monotonic(), self.losses, RunningTime()
        with self._changed:
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
                        raise DeviceTimeout(
                            "{device}: {what} took longer than {timeout:.3g} s",
                            device=self.who,
                            what=what,
                            timeout=timeout,
                        )
                    self._changed.wait(min(timeout, LONGEST_STEP))
            finally:
                self._waiting -= 1

    def put(self, value: T, asked: float) -> None:
        """Store an unsolicited state, valid since `asked` (monotonic, s)."""
        self._set(Snapshot(value, asked, now()))

    def wake(self) -> None:
        """Make all waiting threads check again."""
        with self._changed:
            self._changed.notify_all()

    def hurry(self) -> None:
        """Read the state at once."""
        self._hurry.set()

    # -------------------------------------------------------------------------------- stopping
    def begin(self, what: str) -> GoOn:
        """Return a check for new work: it raises after a stop, and after a loss even if reconnected."""
        return self.observing.begin(what)

    def stop_waiting(self) -> None:
        """Cancel the work in progress."""
        self.observing.cancel()
        self.wake()

    def check_unbroken(self, losses: int) -> None:
        """Check that the device has been observed since `losses` was read. Raises ConnectionLost, NotConnected."""
        self.observing.check_unbroken(losses)

    # -------------------------------------------------------------------------------- on the observing thread
    def _first(self, timeout: float) -> None:
        self._set(self.open(timeout))

    def _watch(self, stopping: threading.Event) -> None:
        while not stopping.is_set():
            self._hurry.wait(self.busy_period if self._waiting else self.period)
            self._hurry.clear()
            if stopping.is_set():
                return
            try:
                self._take()
                self.after_reading()
            except DeviceError:
                if not self._ending:
                    raise
                stopping.wait(CLOSED_BY_US)  # not a loss: we closed the connection

    def _take(self) -> None:
        asked, stamp = time.monotonic(), now()
        value = self.read()
        if value is not None:
            self._set(Snapshot(value, asked, stamp))

    def _set(self, snapshot: Snapshot[T]) -> None:
        with self._changed:
            self.on_state(snapshot)
            self._newest = snapshot
            self._changed.notify_all()
        if self._taken is not None:
            self._taken(snapshot.value)

    def _lost(self, error: DeviceError) -> None:
        self.on_lost(error)
        self.wake()
