"""The life cycle of a fake's process: ready line, orderly end on SIGTERM and SIGINT, end with its parent."""

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
_AHEAD = -10  # niceness that is asked for: a device has a processor of its own
_TICK = 0.02  # s
_HELD_UP = 0.1  # s
_PARENT = os.getppid()
_told_to_end: ContextVar[asyncio.Event] = ContextVar("told_to_end")


class OwnTime:
    """A clock that stops while this process is held up: a device has a processor of its own.

    What arrived meanwhile, such as a trigger of a watchdog, is handled before the watchdog counts the time.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._read, self._elapsed = self._loop.time(), 0.0

    def __call__(self) -> float:
        """Return the seconds that it has run."""
        return self._elapsed + min(self._loop.time() - self._read, _HELD_UP)

    def run(self) -> None:
        """Let it run from now on, in the running event loop."""
        self._elapsed, self._read = self(), self._loop.time()
        self._loop.call_later(_TICK, self.run)


def announce(**addresses: object) -> None:
    """Print the one line on standard output: ``ready {json}``."""
    sys.stdout.write(f"ready {msgspec.json.encode(addresses).decode()}\n")
    sys.stdout.flush()


async def until_told_to_end() -> None:
    """Return on SIGTERM, SIGINT, or when the parent process has gone. To be called within `run`.

    The parent is watched by its id, not by PR_SET_PDEATHSIG: that one fires when the *thread* that started us ends.
    """
    end = _told_to_end.get()
    while os.getppid() == _PARENT:
        try:
            async with asyncio.timeout(_PARENT_WATCH_PERIOD):
                await end.wait()
        except TimeoutError:
            continue
        return


def run(main: Callable[[], Awaitable[None]], name: str, *, ahead: bool = True) -> int:
    """Run a fake to its end and return the exit status: 0, or 1 with one line on standard error (a port is taken).

    `ahead`: it goes before other processes, where we may ask for that; not for one that computes much.
    """
    if ahead:
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, _AHEAD)
    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format=f"{name}: %(message)s")

    async def body() -> None:
        end = asyncio.Event()
        _told_to_end.set(end)
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT):  # before anything is announced: a signal may follow at once
            loop.add_signal_handler(number, end.set)
        await main()

    try:
        uvloop.run(body())
    except OSError as e:
        sys.stderr.write(f"{name}: {e}\n")
        return 1
    return 0
