"""The register map (docs/devices/remote-io.md) as data. Pure functions."""

import enum
from collections.abc import Sequence
from typing import Final, NamedTuple

CHANNELS: Final = {"DI": 16, "DO": 16, "AI": 4, "AO": 2}
WATCHDOGS: Final = 4
RAW_MAX: Final = 32767
BROKEN_WIRE: Final = -32768
IMAGE_COUNT: Final = 17
PULSE: Final = 16
"""Holding register of the pulse of DO0."""
MAX_PULSE_TIME: Final = 60.0
"""Longest pulse of the block, s."""
WATCHDOG_STATES: Final = 9
"""Input register of the state of watchdog 0."""
WATCHDOG: Final = 64
WATCHDOG_SIZE: Final = 16
"""First holding register of watchdog 0, number of registers of a watchdog, and two offsets in them."""
TRIGGER: Final = 1
COMMAND: Final = 2
ACKNOWLEDGE: Final = 1
RELEASE: Final = 2
DIAGNOSES: Final = {1: "supply_missing", 2: "overload"}
"""Codes of the alarms by diagnosis bit."""


class WatchdogState(enum.IntEnum):
    """State of a watchdog of the block."""

    OFF = 0
    RUNNING = 1
    EXPIRED = 2


class Image(NamedTuple):
    """The process image of one instant: the input registers, decoded on access."""

    words: Sequence[int]

    @property
    def diagnosis(self) -> int:
        """Return the diagnosis bits."""
        return self.words[8]

    def digital(self, kind: str, channel: int) -> bool:
        """Return a digital channel."""
        return bool(self.words[0 if kind == "DI" else 1] >> channel & 1)

    def analog(self, kind: str, channel: int) -> int:
        """Return the raw value of an analogue channel."""
        value = self.words[(2 if kind == "AI" else 6) + channel]
        return value - 0x10000 if value & 0x8000 else value

    def watchdog(self, index: int) -> tuple[WatchdogState, int]:
        """Return the state of a watchdog, and the number of the host that triggers it."""
        return WatchdogState(self.words[WATCHDOG_STATES + index]), self.words[13 + index]


def decode(words: Sequence[int]) -> Image:
    """Return the image in input registers 0 to 16. Raises ValueError for invalid content."""
    if (state := max(words[9:13])) > WatchdogState.EXPIRED:
        raise ValueError(f"unknown state {state} of the watchdog")
    return Image(words)
