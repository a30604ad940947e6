"""Observing: the life cycle of a driver's connection on a thread of its own: open, watch, lose, come back."""

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Iterator
from typing import Final

from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import Cancelled, ConnectionLost, DeviceError, DeviceTimeout, NotConnected

GoOn = Callable[[], None]
"""A check that returns while work may go on; it raises Cancelled or ConnectionLost when it may not."""

ATTEMPT_TIMEOUT: Final = 2.0
"""Time an attempt to reconnect may take, s: a device on a local network answers in one."""
FIRST_PAUSE: Final = 0.1
"""Pause before the first attempt, s: a device that resets a connection accepts the next at once."""
LONGEST_PAUSE: Final = 2.0
"""Longest pause between attempts, s: short enough that operators see a device soon after they switch it on."""
STEADY: Final = 0.5
"""Time a connection has to last before the pauses start from the shortest again, s."""
BREATH: Final = 0.005
"""Pause between two calls of a watch that returns by itself, s."""
STOP_WITHIN: Final = 0.9
"""Time `stop` waits for the thread, s; disconnect may take one."""

log = logging.getLogger(__name__)
_made_here = threading.local()


@contextlib.contextmanager
def listening(changed: "Callable[[Observing], None]") -> Iterator[None]:
    """Call `changed` whenever the state of a connection changes that was created on this thread in this context.

    It is called on the thread that changed the state, right after the change; it must neither raise nor wait.
    """
    before = getattr(_made_here, "changed", None)
    _made_here.changed = changed
    try:
        yield
    finally:
        _made_here.changed = before


class Observing:
    """Keeps a connection that only observes. It never takes control back after a loss.

    Args:
        what: Name and address of the device, for errors.
        open_: Opens the connection within the time given (s); raises DeviceError.
        watch: Blocks while all is well, returns soon after its event is set, raises DeviceError after a loss.
        close: Closes the connection; does nothing when it is closed.
        lost: Called with the error once per loss, before the connection is closed.
    """

    def __init__(
        self,
        what: str,
        open_: Callable[[float], object],
        watch: Callable[[threading.Event], None],
        close: Callable[[], None],
        lost: Callable[[DeviceError], None] = lambda _: None,
    ) -> None:
        self.what = what
        self.losses = 0
        """How often the connection was lost: work that started before a loss is over, even after a reconnect."""
        self._loss: DeviceError | None = None
        self._cancelled = 0
        self._open, self._watch, self._close, self._tell_lost = open_, watch, close, lost
        self._life = threading.Lock()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._ending: threading.Thread | None = None
        self._state = Connection.OFFLINE
        self._reason: DeviceError | None = None
        self._turn = threading.Lock()
        self._pause = FIRST_PAUSE
        self._listener: Callable[[Observing], None] | None = getattr(_made_here, "changed", None)

    @property
    def reason(self) -> str:
        """Return why the connection is lost or failed; empty when it is neither."""
        return str(self._reason or "") if self._state in (Connection.LOST, Connection.FAILED) else ""

    @property
    def state(self) -> Connection:
        """Return the state of the connection; it stays "back" until `settled` is called."""
        return self._state

    @property
    def online(self) -> bool:
        """Return whether the device is observed now."""
        return self._state in (Connection.ONLINE, Connection.BACK)

    def settled(self) -> None:
        """Change the state from "back" to "online": a client has noticed the reconnect."""
        with self._turn:
            if self._state is not Connection.BACK:
                return
            self._state = Connection.ONLINE
        self._tell_changed()

    def check(self) -> None:
        """Return while the device is observed. Raises NotConnected, or ConnectionLost with its cause."""
        if self.online:
            return
        if self._state is Connection.LOST:
            raise ConnectionLost("the connection to {what} is lost", str(self._reason or ""), what=self.what)
        raise NotConnected("{what} is not connected", str(self._reason or ""), what=self.what)

    def begin(self, what: str) -> GoOn:
        """Return the check for work that starts now: it raises Cancelled after `cancel`, ConnectionLost after a loss.

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
        """End with Cancelled the work that has started."""
        self._cancelled += 1

    def check_unbroken(self, losses: int) -> None:
        """Return while the device is observed and was since `losses` was read. Raises ConnectionLost, NotConnected."""
        if self.losses != losses:
            raise ConnectionLost(
                "{what}: the connection was lost", str(self._loss or ""), what=self.what
            ) from self._loss
        self.check()

    def start(self, timeout: float) -> None:
        """Open within `timeout` s and watch from then on; does nothing when started. Raises what `open_` raises."""
        with self._life:
            if self._thread is not None:
                self.check()
                return
            deadline = time.monotonic() + timeout
            self._await_former(timeout)
            self._enter(Connection.CONNECTING)
            try:
                self._open(max(deadline - time.monotonic(), 0.001))
            except BaseException as e:
                self._close()
                self._reason = e if isinstance(e, DeviceError) else None
                self._enter(Connection.FAILED)
                raise
            self._reason = None
            self._stopping = threading.Event()
            self._pause = FIRST_PAUSE
            self._enter(Connection.ONLINE)
            self._thread = threading.Thread(
                target=self._run, args=(self._stopping,), name=f"observing {self.what}", daemon=True
            )
            self._thread.start()

    def stop(self) -> None:
        """Close the connection; does nothing when it is closed. A thread that does not end in time ends by itself."""
        with self._life:
            thread, self._thread = self._thread, None
            self._stopping.set()
            if thread is not None and thread is not threading.current_thread():
                thread.join(STOP_WITHIN)
                self._ending = thread if thread.is_alive() else None
            self._enter(Connection.OFFLINE)

    def _enter(self, state: Connection, stopping: threading.Event | None = None) -> bool:
        """Change the state unless `stopping` is set. Return whether it was not set."""
        with self._turn:
            if stopping is not None and stopping.is_set():
                return False
            changes, self._state = self._state is not state, state
        if changes:
            self._tell_changed()
        return True

    def _tell_changed(self) -> None:
        if self._listener is not None:
            self._listener(self)

    def _await_former(self, timeout: float) -> None:
        """Wait for a thread that `stop` did not wait for: it closes the former connection when it ends."""
        if self._ending is not None:
            self._ending.join(timeout)
            if self._ending.is_alive():
                raise DeviceTimeout("the last connection to {what} is still being closed", what=self.what)
            self._ending = None

    def _run(self, stopping: threading.Event) -> None:
        try:
            while not stopping.is_set():
                since = time.monotonic()
                loss = self._attempt(lambda: self._watch(stopping))
                if loss is None:
                    stopping.wait(BREATH)  # a watch that returns at once must not keep a processor busy
                    continue
                if time.monotonic() - since >= STEADY:
                    self._pause = FIRST_PAUSE
                self._come_back(stopping, loss)
        finally:
            self._close()

    def _attempt(self, work: Callable[[], object]) -> DeviceError | None:
        """Call a function of the driver and return its error. A programming error counts as a loss: nothing watches."""
        try:
            work()
        except DeviceError as e:
            return e
        except Exception as e:
            if self._state is not Connection.LOST:  # else it is in the log already, and attempts go on
                log.exception("%s: an error inside the driver", self.what)
            return ConnectionLost("{what}: an error inside the driver", f"{type(e).__name__}: {e}", what=self.what)
        return None

    def _come_back(self, stopping: threading.Event, loss: DeviceError) -> None:
        self._reason = loss
        if not self._enter(Connection.LOST, stopping):
            return
        log.warning("%s lost: %s", self.what, loss)
        self._loss = loss
        self.losses += 1
        self._attempt(lambda: self._tell_lost(loss))
        since = time.monotonic()
        while True:
            self._close()
            if stopping.wait(self._pause):
                return
            self._pause = min(2.0 * self._pause, LONGEST_PAUSE)
            if (error := self._attempt(lambda: self._open(ATTEMPT_TIMEOUT))) is not None:
                self._reason = error
                continue
            if self._enter(Connection.BACK, stopping):
                log.warning("%s back after %.1f s", self.what, time.monotonic() - since)
            return
