"""Process of a fake: its ready line, and its orderly end on SIGTERM, on SIGINT, or with its parent process."""

import asyncio
import contextlib
import logging
import os
import signal
import sys
from collections.abc import Awaitable, Callable
from contextvars import ContextVar

import msgspec
import uvloop

_PARENT_WATCH_PERIOD = 0.2  # s
_AHEAD = -10  # requested niceness where real-time scheduling is not permitted
_TICK = 0.02  # s, period of `OwnTime`
_HELD_UP = 0.1  # s, longest step of `OwnTime`
_PARENT = os.getppid()
_end: ContextVar[asyncio.Event] = ContextVar("end")


class OwnTime:
    """A clock that stops while this process is not scheduled: a real device would not have to wait for a processor.

    Data received meanwhile, such as a watchdog signal, is handled before a watchdog counts the time.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._read, self._elapsed = self._loop.time(), 0.0

    def __call__(self) -> float:
        """Return the running time, s."""
        return self._elapsed + min(self._loop.time() - self._read, _HELD_UP)

    def run(self) -> None:
        """Start the clock in the running event loop."""
        self._elapsed, self._read = self(), self._loop.time()
        self._loop.call_later(_TICK, self.run)


def announce(**addresses: object) -> None:
    """Print the ready line on standard output: ``ready {json}``."""
    sys.stdout.write(f"ready {msgspec.json.encode(addresses).decode()}\n")
    sys.stdout.flush()


async def wait_for_end() -> None:
    """Wait for SIGTERM, SIGINT, or the end of the parent process. Call it within `run`.

    The id of the parent is polled, because PR_SET_PDEATHSIG fires when the *thread* that started this process ends.
    """
    end = _end.get()
    while os.getppid() == _PARENT:
        try:
            async with asyncio.timeout(_PARENT_WATCH_PERIOD):
                await end.wait()
        except TimeoutError:
            continue
        return


def _go_ahead() -> None:
    """Run before other processes, if permitted: like a real device, a fake should not wait for a processor.

    Niceness counts only within a session where the kernel groups processes by session (`sched_autogroup_enabled`).
    """
    try:
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(1))
    except OSError:
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, _AHEAD)


def run(main: Callable[[], Awaitable[None]], name: str, *, ahead: bool = True) -> int:
    """Run a fake until its end and return the exit status.

    It is 0, or 1 with a line on standard error if a port is in use or a module is missing.

    Args:
        main: The fake.
        name: Name of the fake, for messages.
        ahead: Whether to run before other processes, if permitted; not for a fake that computes much.
    """
    if ahead:
        _go_ahead()
    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format=f"{name}: %(message)s")

    async def body() -> None:
        end = asyncio.Event()
        _end.set(end)
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT):  # before the ready line, after which a signal may arrive at once
            loop.add_signal_handler(number, end.set)
        await main()

    try:
        uvloop.run(body())
    except (OSError, ModuleNotFoundError) as e:
        sys.stderr.write(f"{name}: {e}\n")
        return 1
    return 0
