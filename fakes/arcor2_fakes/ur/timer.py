"""A periodic kernel timer for the control cycle: asyncio timers have a resolution of one millisecond."""

import asyncio
import contextlib
import ctypes
import os
import struct
import time
from collections.abc import Callable

_TFD_NONBLOCK = os.O_NONBLOCK
_TFD_CLOEXEC = os.O_CLOEXEC


class _Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class _Itimerspec(ctypes.Structure):
    _fields_ = (("interval", _Timespec), ("value", _Timespec))


class PeriodicTimer:
    """Calls `tick(n)` in the event loop each period; n > 1 if the process was delayed by several periods.

    Uses ctypes, because Python has timerfd only from 3.13 on.
    """

    def __init__(self, period: float, tick: Callable[[int], None]) -> None:
        libc = ctypes.CDLL(None, use_errno=True)
        self._fd: int = libc.timerfd_create(time.CLOCK_MONOTONIC, _TFD_NONBLOCK | _TFD_CLOEXEC)
        if self._fd < 0:
            raise OSError(ctypes.get_errno(), "timerfd_create")
        self._libc = libc
        self._period = period
        self._tick = tick
        self._count = struct.Struct("@Q")
        self._periods = 0
        self.every(1)

    def every(self, periods: int) -> None:
        """Tick only once in so many periods from now on."""
        if periods == self._periods:
            return
        self._periods = periods
        nanoseconds = round(self._period * periods * 1e9)
        each = _Timespec(nanoseconds // 1_000_000_000, nanoseconds % 1_000_000_000)
        if self._libc.timerfd_settime(self._fd, 0, ctypes.byref(_Itimerspec(each, each)), None) < 0:
            raise OSError(ctypes.get_errno(), "timerfd_settime")

    def start(self) -> None:
        """Start in the running event loop."""
        asyncio.get_running_loop().add_reader(self._fd, self._expired)

    def close(self) -> None:
        """Stop the timer, if it runs."""
        if self._fd >= 0:
            asyncio.get_running_loop().remove_reader(self._fd)
            os.close(self._fd)
            self._fd = -1

    def _expired(self) -> None:
        with contextlib.suppress(BlockingIOError):
            self._tick(self._count.unpack(os.read(self._fd, 8))[0] * self._periods)
