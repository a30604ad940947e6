"""Limits the rate of events: the first is sent at once, and the latest one at the end of each period."""

import asyncio
from collections.abc import Callable


class Throttle:
    """Calls `send(key, message)` with the latest message of each key, at most once per `period` seconds."""

    def __init__(self, period: float, send: Callable[[str, bytes], None]) -> None:
        self._period = period
        self._send = send
        self._waiting: dict[str, bytes] = {}
        self._timers: dict[str, asyncio.TimerHandle] = {}

    def put(self, key: str, message: bytes) -> None:
        """Send a message at once, or at the end of the period in place of a waiting one."""
        if key in self._timers:
            self._waiting[key] = message
            return
        self._send(key, message)
        self._start(key)

    def end(self, key: str, message: bytes) -> None:
        """Send the last message of a key at once, in place of a waiting one."""
        self._waiting.pop(key, None)
        if (timer := self._timers.pop(key, None)) is not None:
            timer.cancel()
        self._send(key, message)

    def _start(self, key: str) -> None:
        self._timers[key] = asyncio.get_running_loop().call_later(self._period, self._period_ended, key)

    def _period_ended(self, key: str) -> None:
        del self._timers[key]
        if (message := self._waiting.pop(key, None)) is not None:
            self._send(key, message)
            self._start(key)

    def close(self) -> None:
        """Drop the waiting messages."""
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()
        self._waiting.clear()
