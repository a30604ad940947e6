"""The latest log lines, stored in memory for the diagnosis."""

import threading
from collections import deque
from typing import Any, Final

import msgspec
import structlog

MOST_BYTES: Final = 1024 * 1024
LONGEST_LINE: Final = 16 * 1024


class RecentLog:
    """Lines of JSON, the oldest first; the oldest go when there are too many bytes. Any thread may add."""

    def __init__(self, most: int = MOST_BYTES) -> None:
        self._most = most
        self._lines: deque[bytes] = deque()
        self._size = 0
        self._lock = threading.Lock()

    def add(self, line: bytes) -> None:
        """Keep a line; of a long one its beginning."""
        line = line[:LONGEST_LINE]
        with self._lock:
            self._lines.append(line)
            self._size += len(line)
            while self._size > self._most:
                self._size -= len(self._lines.popleft())

    def lines(self) -> list[str]:
        """Return what is kept."""
        with self._lock:
            kept = list(self._lines)
        return [line.decode(errors="replace") for line in kept]

    def __call__(self, logger: Any, name: str, event: structlog.typing.EventDict) -> structlog.typing.EventDict:
        """Keep an event on its way to where it is written (a processor of structlog)."""
        shown = {key: value for key, value in event.items() if not key.startswith("_")}
        told = structlog.processors.format_exc_info(logger, name, shown)
        self.add(msgspec.json.encode(told, enc_hook=repr))
        return event


RECENT: Final = RecentLog()
"""What this process logged."""
