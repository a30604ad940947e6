"""Waiting of tests for a condition."""

import time
from collections.abc import Callable
from typing import Any, Final

WITHIN: Final = 30.0
"""Time limit for events that are immediate on an idle computer, s. It is that long for busy ones."""


def wait_for(read: Callable[[], Any], holds: Callable[[Any], bool] = bool, within: float = WITHIN) -> Any:
    """Repeat `read` until `holds` accepts its result, and return the result. Fail after `within` s."""
    deadline = time.monotonic() + within
    while not holds(value := read()):
        assert time.monotonic() < deadline, f"not as expected within {within:g} s, last {value!r}"
        time.sleep(0.005)
    return value
