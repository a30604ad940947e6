"""Measurements of the suite: resources of the process, duration and errors of calls, concurrent calls."""

import gc
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from arcor2_hw.exceptions import DeviceError
from arcor2_hw.testing.own_time import own_time

POLL: Final = 0.01
TIME_TOLERANCE: Final = 0.5
"""Tolerance added to each time limit for busy machines, s."""
CLEAN_UP_TIMEOUT: Final = 2.0
"""Time in which threads and sockets have to end, s."""


def open_resources() -> set[str]:
    """Return the threads, open sockets and serial ports of this process."""
    found = {f"thread {thread.name} ({thread.ident})" for thread in threading.enumerate()}
    for descriptor in Path("/proc/self/fd").glob("*"):
        try:
            target = str(descriptor.readlink())
        except OSError:
            continue
        if target.startswith(("socket:", "/dev/pts/", "/dev/tty")):
            found.add(f"{target} (descriptor {descriptor.name})")
    return found


def leaked_resources(before: set[str]) -> set[str]:
    """Return the resources that this process did not have before, after waiting for them to end."""
    began = own_time()
    while (left := open_resources() - before) and not began.is_past(CLEAN_UP_TIMEOUT):
        gc.collect()
        time.sleep(POLL)
    return left


def wait_until(holds: Callable[[], bool], within: float, what: str) -> float:
    """Wait until a condition holds, and return the elapsed time, s. Fail after `within` s."""
    began = own_time()
    while not holds():
        assert not began.is_past(within), f"{what}: not within {within:g} s"
        time.sleep(POLL)
    return own_time() - began


def require_throughout(holds: Callable[[], bool], seconds: float, what: str) -> None:
    """Fail when a condition ceases to hold within some seconds."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        assert holds(), what
        time.sleep(POLL)


def require_in_time(call: Callable[[], Any], within: float, what: str) -> Any:
    """Call and return the result. Fail if the call took longer than `within` s plus TIME_TOLERANCE."""
    began = own_time()
    try:
        return call()
    finally:
        took = own_time() - began
        assert took <= within + TIME_TOLERANCE, f"{what} took {took:.2f} s, not {within:g} s at most"


def require_error(call: Callable[[], Any], *kinds: type[DeviceError], within: float, what: str) -> DeviceError:
    """Call, and return the typed error that it raises. Fail if it returns, is late, or raises another error."""
    given: object = None
    error: Exception | None = None
    try:
        given = require_in_time(call, within, what)
    except AssertionError:
        raise
    except Exception as e:  # noqa: BLE001 - judged below
        error = e
    allowed = " or ".join(kind.__name__ for kind in kinds)
    assert error is not None, f"{what} returned {given!r} and did not raise {allowed}"
    assert isinstance(error, kinds), f"{what} raised {type(error).__name__} ({error}), not {allowed}"
    return error


def named(error: DeviceError, name: str, address: str, what: str) -> None:
    """Fail unless an error names the device and its address."""
    text = f"{error} {error.detail}"
    assert name in text, f"the error of {what} does not name {name!r}: {text}"
    assert address in text, f"the error of {what} does not name the address {address}: {text}"


class BackgroundCall:
    """A call on its own thread."""

    def __init__(self, call: Callable[[], Any]) -> None:
        self.error: BaseException | None = None
        self.result: Any = None
        self._thread = threading.Thread(target=self._run, args=(call,), name="beside", daemon=True)
        self._thread.start()

    def _run(self, call: Callable[[], Any]) -> None:
        try:
            self.result = call()
        except BaseException as error:  # noqa: BLE001 - the waiting thread receives it
            self.error = error

    @property
    def over(self) -> bool:
        """Return whether the call has ended."""
        return not self._thread.is_alive()

    def outcome(self, within: float, what: str) -> BaseException | None:
        """Wait for the end and return the raised error. Fail when the call does not end in time."""
        began = own_time()
        while not self.over and not began.is_past(within + TIME_TOLERANCE):
            self._thread.join(POLL)
        assert self.over, f"{what} has not ended within {within:g} s"
        return self.error


# Names before version 0.2.
GRACE, SLACK, held, left_behind, raised, stays, timed = (
    CLEAN_UP_TIMEOUT,
    TIME_TOLERANCE,
    open_resources,
    leaked_resources,
    require_error,
    require_throughout,
    require_in_time,
)
