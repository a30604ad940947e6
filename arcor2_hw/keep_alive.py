"""Feeding a device's watchdog from a child process, so that a busy interpreter does not stop the device."""

import asyncio
import contextlib
import os
import select
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Final, TypeVar

from arcor2_hw.exceptions import DeviceTimeout
from arcor2_hw.keep_alive_process import FROZEN_AFTER as FROZEN_AFTER, PULSE
from arcor2_hw.messages import Message

PULSE_PERIOD: Final = 0.05
"""Time between pulses for drivers without a cycle of their own, s."""
BUSY_FOR: Final = 0.3
"""Running time for which a caller waits for a fresh reading, because a busy process may be late, s."""
STARTS_WITHIN: Final = 5.0
"""Time limit of the start of the child process, s; it takes 0.03 s on an idle computer."""
LONGEST_STEP: Final = 0.05
"""Maximum time that `RunningTime` counts between two readings, s."""
TOO_SLOW: Final = Message.of("this computer was too slow for the robot's watchdog")
"""Message for a watchdog that tripped because this computer was busy."""
_SCRIPT: Final = Path(__file__).with_name("keep_alive_process.py")
T = TypeVar("T")


def pulse() -> bytes:
    """Return the line that reports to a child process that the thread which supervises the device is alive."""
    return PULSE + b"%.6f\n" % time.monotonic()


class KeepAlive:
    """A child process that writes `message` to the open line `fd` of a device every `period` s.

    It stops when this process ends, when `close` is called, and when no `pulse` was sent for FROZEN_AFTER s. The thread
    that supervises the device sends the pulses while all is well, so the messages stop when that thread does.

    Args:
        fd: File descriptor of the device's line.
        message: Message that the device accepts in the middle of other traffic.
        period: Time between two messages, s.
        quiet: Time without a pulse before the first message, s, for lines where messages could collide with answers.

    Raises:
        DeviceTimeout: The process did not start. Arm the watchdog only afterwards.
    """

    def __init__(self, fd: int, message: bytes, period: float, quiet: float = 0.0) -> None:
        self._process = subprocess.Popen(  # noqa: S603 - our own script
            [sys.executable, "-I", "-S", str(_SCRIPT), message.hex(), str(period), str(quiet)],
            stdin=subprocess.PIPE,
            stdout=fd,
            stderr=subprocess.PIPE,
            start_new_session=True,  # with its own share of processor time
        )
        assert self._process.stdin is not None
        assert self._process.stderr is not None
        os.set_blocking(self._process.stdin.fileno(), False)
        with self._process.stderr as ready:
            if not (select.select([ready], [], [], STARTS_WITHIN)[0] and ready.read(1)):
                self.close()
                raise DeviceTimeout(
                    "The process that feeds watchdogs did not start within {starts_within:g} s.",
                    starts_within=STARTS_WITHIN,
                )
        self.pulse()

    @property
    def pid(self) -> int:
        """Return the process id of the child."""
        return self._process.pid

    def pulse(self) -> None:
        """Report that the device is supervised; call it at least every 0.1 s."""
        assert self._process.stdin is not None
        with contextlib.suppress(
            OSError, ValueError
        ):  # the line is closed, or the child has ended; the watchdog of the device then stops it
            os.write(self._process.stdin.fileno(), pulse())

    def close(self) -> None:
        """End the child process. Further calls do nothing."""
        if self._process.stdin is not None and not self._process.stdin.closed:
            self._process.kill()
            self._process.stdin.close()
            self._process.wait()


class RunningTime:
    """A stopwatch of the time in which this process ran: a longer gap between two readings counts as LONGEST_STEP.

    Use it for time limits of another thread of this process, because a stall of the process delays both threads.
    """

    def __init__(self) -> None:
        self._read = time.monotonic()
        self._elapsed = 0.0

    def __call__(self) -> float:
        """Return the seconds since its creation."""
        now = time.monotonic()
        self._elapsed += min(now - self._read, LONGEST_STEP)
        self._read = now
        return self._elapsed


def result_within(future: "Future[T]", timeout: float) -> T:
    """Return the result of a future that a thread of this process sets, within `timeout` s of running time.

    Raises:
        TimeoutError: No result was set in time.
    """
    clock = RunningTime()
    while True:
        try:
            return future.result(min(max(timeout - clock(), 0.0), LONGEST_STEP / 2.0))
        except TimeoutError:
            if future.done() or clock() >= timeout:
                raise


async def awaited_within(work: Coroutine[Any, Any, T], timeout: float) -> T:
    """Return the result of a coroutine, within `timeout` s of running time.

    Raises:
        TimeoutError: It did not end in time, and was cancelled.
    """
    clock, task = RunningTime(), asyncio.ensure_future(work)
    try:
        while True:
            late = clock() >= timeout  # check once more, because this process may have been suspended
            await asyncio.wait({task}, timeout=LONGEST_STEP / 2.0)
            if task.done():
                return task.result()
            if late:
                raise TimeoutError
    finally:
        task.cancel()


def acquire_within(lock: threading.Lock, timeout: float) -> bool:
    """Return whether a lock was acquired within `timeout` s of running time, in which its owner may be delayed, too."""
    clock = RunningTime()
    while not lock.acquire(timeout=LONGEST_STEP / 2.0):
        if clock() >= timeout:
            return False
    return True


def once_within(holds: Callable[[], Any], timeout: float, pause: float) -> bool:
    """Return whether `holds` returns true within `timeout` s of running time; it is called every `pause` s."""
    clock = RunningTime()
    while not holds():
        if clock() >= timeout:
            return False
        time.sleep(pause)
    return True
