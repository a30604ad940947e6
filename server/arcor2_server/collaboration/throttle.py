"""Limits the rate of events: the first is sent at once, later ones replace each other until the period ends."""

import asyncio
from collections.abc import Callable


class Throttle:
    """Passes on messages by `send(key, message)`: of each key at most the newest one per `period` seconds."""

    def __init__(self, period: float, send: Callable[[str, bytes], None]) -> None:
        self._period = period
        self._send = send
        self._waiting: dict[str, bytes] = {}
        self._timers: dict[str, asyncio.TimerHandle] = {}

    def put(self, key: str, message: bytes) -> None:
        """Pass on at once, or in place of what still waits."""
        if key in self._timers:
            self._waiting[key] = message
            return
        self._send(key, message)
        self._start(key)

    def end(self, key: str, message: bytes) -> None:
        """Pass on at once whatever waits: it is the last of its key, which waits no more."""
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
        """Drop what waits."""
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()
        self._waiting.clear()
