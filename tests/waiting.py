"""Waiting of tests for a condition."""

import time
from collections.abc import Callable
from typing import Any, Final

WITHIN: Final = 30.0
"""Time limit for events that are immediate on an idle computer, s. It is long because the computer may be busy."""
LONGEST_PAUSE: Final = 0.02
"""Longest pause between two reads, s."""


def wait_for(read: Callable[[], Any], holds: Callable[[Any], bool] = bool, within: float = WITHIN) -> Any:
    """Repeat `read` until `holds` accepts its result, and return the result. Fail after `within` s."""
    start, pause = time.monotonic(), 0.002
    while not holds(value := read()):
        assert time.monotonic() < start + within, f"not as expected within {within:g} s, last {value!r}"
        time.sleep(pause := min(1.5 * pause, LONGEST_PAUSE))
    return value
