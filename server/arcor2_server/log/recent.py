"""Stores the latest log lines in memory for the diagnosis bundle."""

import threading
from collections import deque
from typing import Any, Final

import msgspec
import structlog

MAX_BYTES: Final = 1024 * 1024
MAX_LINE: Final = 16 * 1024
"""Maximum length of a stored line, bytes; the rest of a longer line is dropped."""


class RecentLog:
    """The latest lines as JSON. Threads may add lines concurrently.

    Args:
        max_bytes: total size above which the oldest lines are dropped.
    """

    def __init__(self, max_bytes: int = MAX_BYTES) -> None:
        self._max_bytes = max_bytes
        self._lines: deque[bytes] = deque()
        self._size = 0
        self._lock = threading.Lock()

    def add(self, line: bytes) -> None:
        """Store a line."""
        line = line[:MAX_LINE]
        with self._lock:
            self._lines.append(line)
            self._size += len(line)
            while self._size > self._max_bytes:
                self._size -= len(self._lines.popleft())

    def lines(self) -> list[str]:
        """Return the stored lines, oldest first."""
        with self._lock:
            lines = list(self._lines)
        return [line.decode(errors="replace") for line in lines]

    def __call__(self, logger: Any, name: str, event: structlog.typing.EventDict) -> structlog.typing.EventDict:
        """Store an event and pass it on (a processor of structlog)."""
        public = {key: value for key, value in event.items() if not key.startswith("_")}
        formatted = structlog.processors.format_exc_info(logger, name, public)
        self.add(msgspec.json.encode(formatted, enc_hook=repr))
        return event


RECENT: Final = RecentLog()
"""The latest log lines of this process."""
