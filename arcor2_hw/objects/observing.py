"""Observing: the life of a driver's connection, kept by a thread of its own: opened, watched, lost, back."""

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Iterator
from typing import Final

from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceTimeout, NotConnected

ATTEMPT_TIMEOUT: Final = 2.0
"""Seconds an attempt to come back may take: a device on a local network answers in one."""
FIRST_PAUSE: Final = 0.1
"""Seconds before the first attempt: a device that resets a connection takes the next at once."""
LONGEST_PAUSE: Final = 2.0
"""Seconds between attempts in the end: a device that was switched on is seen before its operator has walked back."""
STEADY: Final = 0.5
"""Seconds after which a connection that came back counts as one; one that breaks sooner does not shorten the pauses."""
BREATH: Final = 0.005
"""Seconds between two calls of a watch that returns though nobody told it to."""
STOP_WITHIN: Final = 0.9
"""Seconds `stop` waits for the thread; disconnect may take one."""

log = logging.getLogger(__name__)
_made_here = threading.local()


@contextlib.contextmanager
def listening(changed: "Callable[[Observing], None]") -> Iterator[None]:
    """Have `changed` called with each connection that is made on this thread meanwhile, whenever its state changes.

    It is called on the thread that changed the state, right after that; it must not raise, nor wait.
    """
    before = getattr(_made_here, "changed", None)
    _made_here.changed = changed
    try:
        yield
    finally:
        _made_here.changed = before


class Observing:
    """Keeps a connection that only observes. Control never comes back by itself; that is the driver's to take.

    open_(timeout): opens, raises DeviceError. watch(stopping): blocks while all is well, returns soon after `stopping`
    is set, raises DeviceError when the connection is lost. close(): closes, harmless when closed. lost(error): told
    once per loss, before the connection is closed.
    """

    def __init__(
        self,
        what: str,
        open_: Callable[[float], None],
        watch: Callable[[threading.Event], None],
        close: Callable[[], None],
        lost: Callable[[DeviceError], None] = lambda _: None,
    ) -> None:
        self.what = what
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
        """Tell why the connection is lost or failed; empty when it is not."""
        return str(self._reason or "") if self._state in (Connection.LOST, Connection.FAILED) else ""

    @property
    def state(self) -> Connection:
        """Tell how the connection is; it is "back" until `settled` is called."""
        return self._state

    @property
    def online(self) -> bool:
        """Tell whether the device is observed now."""
        return self._state in (Connection.ONLINE, Connection.BACK)

    def settled(self) -> None:
        """Note that somebody has taken note of the connection being back."""
        with self._turn:
            if self._state is not Connection.BACK:
                return
            self._state = Connection.ONLINE
        self._tell_changed()

    def check(self) -> None:
        """Return when the device is observed. Raises NotConnected, or ConnectionLost with what it was lost by."""
        if self.online:
            return
        if self._state is Connection.LOST:
            raise ConnectionLost(f"the connection to {self.what} is lost", str(self._reason or ""))
        raise NotConnected(f"{self.what} is not connected", str(self._reason or ""))

    def start(self, timeout: float) -> None:
        """Open within `timeout` s and watch from then on; harmless when it was started. Raises what open_ raises."""
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
        """Close and be offline; harmless when it is. A thread that does not end in time is left to end by itself."""
        with self._life:
            thread, self._thread = self._thread, None
            self._stopping.set()
            if thread is not None and thread is not threading.current_thread():
                thread.join(STOP_WITHIN)
                self._ending = thread if thread.is_alive() else None
            self._enter(Connection.OFFLINE)

    def _enter(self, state: Connection, stopping: threading.Event | None = None) -> bool:
        """Change the state, unless `stopping` says that this is over; tells whether it did."""
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
        """Let a thread end that `stop` could not wait for: at its end it closes what is open."""
        if self._ending is not None:
            self._ending.join(timeout)
            if self._ending.is_alive():
                raise DeviceTimeout(f"the last connection to {self.what} is still being closed")
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

    def _attempt(self, work: Callable[[], None]) -> DeviceError | None:
        """Do something of the driver's; gives what went wrong. A mistake in it is a loss too: nobody watches then."""
        try:
            work()
        except DeviceError as e:
            return e
        except Exception as e:
            if self._state is not Connection.LOST:  # else it was told, and attempts go on
                log.exception("%s: an error inside the driver", self.what)
            return ConnectionLost(f"{self.what}: an error inside the driver", f"{type(e).__name__}: {e}")
        return None

    def _come_back(self, stopping: threading.Event, loss: DeviceError) -> None:
        self._reason = loss
        if not self._enter(Connection.LOST, stopping):
            return
        log.warning("%s lost: %s", self.what, loss)
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
