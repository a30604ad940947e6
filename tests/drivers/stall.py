"""A stalled host process: its interpreter is blocked, so that none of its threads runs."""

import ctypes

BUSY = 0.5
"""Seconds of a stall that must not stop a robot."""


def stall(seconds: float) -> None:
    """Keep the interpreter, as a C extension does that does not release it."""
    ctypes.PyDLL(None).usleep(round(seconds * 1e6))
