"""A clock for time limits that stops while this process or its children wait for a processor.

Otherwise, a test that a call returns within 1 s would fail if other processes delay the driver or its fake. On an idle
machine it is the ordinary clock; on the busiest it runs at a tenth of the speed.
"""

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

PROC: Final = Path("/proc")
SLOWEST: Final = 0.1
"""Lowest speed of the clock, so that a call that hangs is noticed on any machine."""


class Instant(NamedTuple):
    """A moment. The difference of two moments is the time between them, s, without the time of waiting for a processor.

    Attributes:
        clock: Monotonic time, s.
        waited: Time for which each thread of the process and its children has waited for a processor, s.
    """

    clock: float
    waited: dict[str, float]

    def __sub__(self, earlier: "Instant") -> float:
        waited = sum(value - earlier.waited.get(thread, 0.0) for thread, value in self.waited.items())
        elapsed = self.clock - earlier.clock
        return max(elapsed - waited, SLOWEST * elapsed)

    def is_past(self, limit: float) -> bool:
        """Return whether at least `limit` s have passed since, without the time spent waiting for a processor."""
        # The statistics of all threads take a millisecond: read them only when the ordinary clock is past the limit.
        return time.monotonic() - self.clock >= limit and own_time() - self >= limit


def own_time() -> Instant:
    """Return the present moment."""
    return Instant(time.monotonic(), dict(_waited(str(os.getpid()))))


def _waited(process: str) -> Iterator[tuple[str, float]]:
    """Yield the threads of a process and its children, each with its time of waiting for a processor, s."""
    with contextlib.suppress(OSError):  # the process has ended, or the kernel has no such statistics
        for thread in (PROC / process / "task").iterdir():
            with contextlib.suppress(OSError):
                yield thread.name, int((thread / "schedstat").read_text().split()[1]) / 1e9
                for child in (thread / "children").read_text().split():
                    yield from _waited(child)
