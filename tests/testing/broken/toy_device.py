"""The simulated press."""

import math
import time

WATCHDOG = 0.6  # s
STROKE = 20.0  # s


class Press:
    """The device. A stroke ends after its duration, by a stop, or by the watchdog when the press is unreachable.

    The watchdog counts from the moment at which the press falls silent, not from the last request, so a thread that
    runs late on a busy computer does not trip it.
    """

    def __init__(self) -> None:
        self.writes: list[str] = []
        self.wire: list[str] = []
        self.torn = False
        self.silent_since = math.inf
        self.owner: str | None = None
        self.until = 0.0
        self.link = 0
        self.force = 250.0  # N
        self.weight = 0.5  # kg, of the part
        self.scrapped = False

    @property
    def silent(self) -> bool:
        return self.silent_since != math.inf

    def fall_silent(self) -> None:
        self.silent_since = time.monotonic()

    def heal(self) -> None:
        self.running()
        self.silent_since, self.torn = math.inf, False

    def scrap(self) -> None:
        """End the threads that a broken driver did not end."""
        self.scrapped, self.until = True, 0.0

    def ask(self, write: str = "", link: int | None = None) -> None:
        if link is not None and link != self.link:
            raise ConnectionResetError
        if self.silent or self.scrapped:
            raise TimeoutError
        if write:
            self.writes.append(write)
            self.wire.append(write)
        if write == "stroke":
            self.until = time.monotonic() + STROKE
        if write == "halt":
            self.until = 0.0

    def running(self) -> bool:
        if time.monotonic() - self.silent_since > WATCHDOG:
            self.until = 0.0
        return time.monotonic() < self.until

    def answer(self) -> bytes:
        if self.torn:
            self.torn = False
            self.fall_silent()
            return b"\x00"
        return b"\x00\x2a"


PRESSES: dict[str, Press] = {}
"""The presses by address; each bench has its own, and each case a new one at the same address."""
