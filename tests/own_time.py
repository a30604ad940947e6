"""A clock for upper time limits: it does not count the time for which other processes hold this one up.

A test that a call returns within 1 s would otherwise fail next to processes that take the processor away. On an idle
machine it is the ordinary clock; work of this process itself always counts.
"""

import threading
import time
from pathlib import Path
from typing import Final, NamedTuple

TICK: Final = 0.005
"""Period in s in which the clock samples how long a thread waits for a processor."""


def _waited() -> float:
    """Return for how many seconds the calling thread has waited for a processor since it started."""
    try:
        return int(Path("/proc/thread-self/schedstat").read_text().split()[1]) / 1e9
    except OSError:  # a kernel without these statistics
        return 0.0


class Instant(NamedTuple):
    """A moment; the difference of two is the time between them that this process was not held up."""

    clock: float
    caller_waited: float
    sampler_waited: float

    def __sub__(self, earlier: "Instant") -> float:
        waited = (self.caller_waited - earlier.caller_waited, self.sampler_waited - earlier.sampler_waited)
        return self.clock - earlier.clock - max(waited)


class _Sampler:
    """A thread that wakes up all the time: it waits as other threads and processes do, whose work a caller awaits."""

    def __init__(self) -> None:
        self.waited = 0.0
        threading.Thread(target=self._run, name="own time", daemon=True).start()

    def _run(self) -> None:
        while True:
            time.sleep(TICK)
            self.waited = _waited()


_SAMPLER: Final = _Sampler()


def own_time() -> Instant:
    """Return the present moment; to be compared with others of the same thread."""
    return Instant(time.monotonic(), _waited(), _SAMPLER.waited)
