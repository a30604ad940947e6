"""A stalled host process: its interpreter is blocked, so that none of its threads runs."""

import ctypes

BUSY = 0.5
"""Duration of a stall that must not stop a robot, s."""


def stall(seconds: float) -> None:
    """Hold the interpreter lock, like a C extension that does not release it."""
    ctypes.PyDLL(None).usleep(round(seconds * 1e6))
