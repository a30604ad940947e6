"""Observing: the life cycle of a driver's connection on its own thread: open, watch, reconnect after a loss."""

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Iterator
from typing import Final

from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import Cancelled, ConnectionLost, DeviceError, DeviceTimeout, NotConnected
from arcor2_hw.messages import Message

GoOn = Callable[[], None]
"""A check that returns while work may continue, and otherwise raises Cancelled or ConnectionLost."""

ATTEMPT_TIMEOUT: Final = 2.0
"""Time limit of an attempt to reconnect, s. A device on a local network answers within 1 s."""
FIRST_PAUSE: Final = 0.1
"""Pause before the first attempt, s. A device that reset a connection accepts the next one at once."""
MAX_PAUSE: Final = 2.0
"""Longest pause between attempts, s, so that a device is online soon after it was switched on."""
STABLE_AFTER: Final = 0.5
"""Time after which a connection counts as stable, s. The next pause then starts from FIRST_PAUSE again."""
WATCH_PAUSE: Final = 0.005
"""Pause between two calls of a `watch` that returns, s."""
STOP_TIMEOUT: Final = 0.9
"""Time that `stop` waits for the thread, s, because `disconnect` must return within 1 s."""

log = logging.getLogger(__name__)
_created_here = threading.local()


@contextlib.contextmanager
def listening(changed: "Callable[[Observing], None]", taken: Callable[[object], None] | None = None) -> Iterator[None]:
    """Call functions after changes of the connections and state observers that this thread creates in this context.

    They are called on the thread that changed the state, and must neither raise nor wait.

    Args:
        changed: called after every state change of a connection.
        taken: called with every new state of a device.
    """
    before = getattr(_created_here, "changed", None), getattr(_created_here, "taken", None)
    _created_here.changed, _created_here.taken = changed, taken
    try:
        yield
    finally:
        _created_here.changed, _created_here.taken = before


def listener_of_states() -> Callable[[object], None] | None:
    """Return the function `taken` of the present `listening`; None outside of it."""
    found: Callable[[object], None] | None = getattr(_created_here, "taken", None)
    return found


class Observing:
    """Keep a connection for observation open. It never takes control again after a loss.

    Args:
        what: Name and address of the device, for errors.
        open_: Opens the connection within a time limit, s. Raises DeviceError.
        watch: Blocks while the connection works, returns soon after its event is set, raises DeviceError after a loss.
        close: Closes the connection; does nothing when it is closed.
        lost: Called once per loss with the error, before the connection is closed.
    """

    def __init__(
        self,
        what: str | Message,
        open_: Callable[[float], object],
        watch: Callable[[threading.Event], None],
        close: Callable[[], None],
        lost: Callable[[DeviceError], None] = lambda _: None,
    ) -> None:
        self.what = what
        self.losses = 0
        """Number of losses. Work that started before a loss must not continue, even after a reconnect."""
        self._loss: DeviceError | None = None
        self._cancelled = 0
        self._open, self._watch, self._close, self._notify_lost = open_, watch, close, lost
        self._life = threading.Lock()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._ending: threading.Thread | None = None
        self._state = Connection.OFFLINE
        self._reason: DeviceError | None = None
        self._state_lock = threading.Lock()
        self._pause = FIRST_PAUSE
        self._listener: Callable[[Observing], None] | None = getattr(_created_here, "changed", None)

    @property
    def reason(self) -> Message | None:
        """Return why the connection is lost or failed; None in other states."""
        reason = self._reason
        return reason.message if reason and self._state in (Connection.LOST, Connection.FAILED) else None

    @property
    def state(self) -> Connection:
        """Return the state of the connection. It remains "back" after a reconnect until `settled` is called."""
        return self._state

    @property
    def online(self) -> bool:
        """Return whether the device is being observed."""
        return self._state in (Connection.ONLINE, Connection.BACK)

    @property
    def stopping(self) -> bool:
        """Return whether `stop` was called, so that a driver that waits while it reconnects gives up."""
        return self._stopping.is_set()

    def settled(self) -> None:
        """Change the state from "back" to "online", because a client has noticed the reconnect."""
        with self._state_lock:
            if self._state is not Connection.BACK:
                return
            self._state = Connection.ONLINE
        self._notify_changed()

    def check(self) -> None:
        """Check that the device is observed. Raises NotConnected, or ConnectionLost with its cause."""
        if self.online:
            return
        if self._state is Connection.LOST:
            raise ConnectionLost("the connection to {what} is lost", str(self._reason or ""), what=self.what)
        raise NotConnected("{what} is not connected", str(self._reason or ""), what=self.what)

    def begin(self, what: str) -> GoOn:
        """Return a check for new work: it raises Cancelled after `cancel` and ConnectionLost after a loss.

        Args:
            what: Name of the work, for errors.
        """
        cancelled, losses = self._cancelled, self.losses

        def check() -> None:
            if self._cancelled != cancelled:
                raise Cancelled("{device}: {call} was stopped", device=self.what, call=what)
            self.check_unbroken(losses)

        return check

    def cancel(self) -> None:
        """Cancel the work in progress."""
        self._cancelled += 1

    def check_unbroken(self, losses: int) -> None:
        """Check that the device has been observed since `losses` was read. Raises ConnectionLost, NotConnected."""
        if self.losses != losses:
            raise ConnectionLost(
                "{what}: the connection was lost", str(self._loss or ""), what=self.what
            ) from self._loss
        self.check()

    def start(self, timeout: float) -> None:
        """Open the connection within `timeout` s and watch it. It does nothing when started. Raises as `open_`."""
        with self._life:
            if self._thread is not None:
                self.check()
                return
            deadline = time.monotonic() + timeout
            self._await_previous(timeout)
            self._stopping = threading.Event()
            self._enter(Connection.CONNECTING)
            try:
                self._open(max(deadline - time.monotonic(), 0.001))
            except BaseException as e:
                self._close()
                self._reason = e if isinstance(e, DeviceError) else None
                self._enter(Connection.FAILED)
                raise
            self._reason = None
            self._pause = FIRST_PAUSE
            self._enter(Connection.ONLINE)
            self._thread = threading.Thread(
                target=self._run, args=(self._stopping,), name=f"observing {self.what}", daemon=True
            )
            self._thread.start()

    def stop(self) -> None:
        """Close the connection. It does nothing when closed. A thread that does not end in time ends later."""
        with self._life:
            thread, self._thread = self._thread, None
            self._stopping.set()
            if thread is not None and thread is not threading.current_thread():
                thread.join(STOP_TIMEOUT)
                self._ending = thread if thread.is_alive() else None
            self._enter(Connection.OFFLINE)

    def _enter(self, state: Connection, stopping: threading.Event | None = None) -> bool:
        """Change the state and return true, unless `stopping` is set."""
        with self._state_lock:
            if stopping is not None and stopping.is_set():
                return False
            changes, self._state = self._state is not state, state
        if changes:
            self._notify_changed()
        return True

    def _notify_changed(self) -> None:
        if self._listener is not None:
            self._listener(self)

    def _await_previous(self, timeout: float) -> None:
        """Wait until the thread of the previous connection has closed it, if `stop` did not wait for it."""
        if self._ending is not None:
            self._ending.join(timeout)
            if self._ending.is_alive():
                raise DeviceTimeout("the previous connection to {what} is still being closed", what=self.what)
            self._ending = None

    def _run(self, stopping: threading.Event) -> None:
        try:
            while not stopping.is_set():
                since = time.monotonic()
                loss = self._attempt(lambda: self._watch(stopping))
                if loss is None:
                    stopping.wait(WATCH_PAUSE)  # a watch that returns at once must not use a whole processor core
                    continue
                if time.monotonic() - since >= STABLE_AFTER:
                    self._pause = FIRST_PAUSE
                self._reconnect(stopping, loss)
        finally:
            self._close()

    def _attempt(self, work: Callable[[], object]) -> DeviceError | None:
        """Call a function of the driver and return its error. A programming error counts as a connection loss."""
        try:
            work()
        except DeviceError as e:
            return e
        except Exception as e:
            if self._state is not Connection.LOST:  # otherwise the error is in the log already
                log.exception("%s: internal error of the driver", self.what)
            return ConnectionLost("{what}: internal error of the driver", f"{type(e).__name__}: {e}", what=self.what)
        return None

    def _reconnect(self, stopping: threading.Event, loss: DeviceError) -> None:
        self._reason = loss
        if not self._enter(Connection.LOST, stopping):
            return
        log.warning("The connection to %s is lost: %s", self.what, loss)
        self._loss = loss
        self.losses += 1
        self._attempt(lambda: self._notify_lost(loss))
        since = time.monotonic()
        while True:
            self._close()
            if stopping.wait(self._pause):
                return
            self._pause = min(2.0 * self._pause, MAX_PAUSE)
            if (error := self._attempt(lambda: self._open(ATTEMPT_TIMEOUT))) is not None:
                self._reason = error
                continue
            if self._enter(Connection.BACK, stopping):
                log.warning("The connection to %s is restored after %.1f s", self.what, time.monotonic() - since)
            return


# Names before version 0.2.
LONGEST_PAUSE, STOP_WITHIN = MAX_PAUSE, STOP_TIMEOUT
