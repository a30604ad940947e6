"""The register map (docs/devices/remote-io.md) as data: what words and bits mean. Pure functions."""

import enum
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

from arcor2_hw.objects.small import OnLoss

if TYPE_CHECKING:
    from .points import Point

CHANNELS: Final = {"DI": 16, "DO": 16, "AI": 4, "AO": 2}
WATCHDOGS: Final = 4
RAW_MAX: Final = 32767
BROKEN_WIRE: Final = -32768
IMAGE_COUNT: Final = 17
PULSE: Final = 16
"""Holding register of the pulse of DO0."""
LONGEST_PULSE: Final = 60.0
"""s, of the block's own pulse."""
TRIGGER: Final = 1
COMMAND: Final = 2
ACKNOWLEDGE: Final = 1
RELEASE: Final = 2
SUPPLY_MISSING: Final = 1
OVERLOAD: Final = 2


class WatchdogState(enum.IntEnum):
    """What a watchdog of the block is doing."""

    OFF = 0
    RUNNING = 1
    EXPIRED = 2


class Image(NamedTuple):
    """The process image, of one instant: the input registers as they came, taken apart where somebody looks."""

    words: Sequence[int]

    @property
    def digital_inputs(self) -> int:
        """Give the inputs as bits."""
        return self.words[0]

    @property
    def digital_outputs(self) -> int:
        """Give the outputs as bits."""
        return self.words[1]

    @property
    def diagnosis(self) -> int:
        """Give the diagnosis bits."""
        return self.words[8]

    def digital(self, kind: str, channel: int) -> bool:
        """Give a digital channel."""
        return bool(self.words[0 if kind == "DI" else 1] >> channel & 1)

    def analog(self, kind: str, channel: int) -> int:
        """Give the raw value of an analogue channel."""
        return _signed(self.words[(2 if kind == "AI" else 6) + channel])

    def watchdog(self, index: int) -> tuple[WatchdogState, int]:
        """Give what a watchdog is doing, and the number of the host that triggers it."""
        return WatchdogState(self.words[9 + index]), self.words[13 + index]


def decode(words: Sequence[int]) -> Image:
    """Take input registers 0 to 16. Raises ValueError for what no block tells."""
    if len(words) != IMAGE_COUNT:
        raise ValueError(f"{len(words)} of {IMAGE_COUNT} input registers came")
    if (state := max(words[9:13])) > WatchdogState.EXPIRED:
        raise ValueError(f"a watchdog in state {state}")
    return Image(words)


def watchdog_address(index: int) -> int:
    """Give the first holding register of a watchdog."""
    return 64 + 16 * index


def arming(points: Iterable["Point"], time_ms: int, number: int) -> list[int]:
    """Give the ten registers of a watchdog that guards the outputs among the points, and start it."""
    digital = {"guarded": 0, "switched": 0, "safe": 0}
    analog = {"guarded": 0, "switched": 0}
    for point in points:
        if point.kind not in ("DO", "AO"):
            continue
        masks, bit = (digital if point.kind == "DO" else analog), 1 << point.channel
        masks["guarded"] |= bit
        if point.io.on_loss is not OnLoss.HOLD:
            masks["switched"] |= bit
        if point.io.on_loss is OnLoss.ON:
            masks["safe"] |= bit
    return [time_ms, number, 0, *digital.values(), *analog.values(), 0, 0]


def word(value: int) -> int:
    """Give a signed value as it goes over the wire."""
    return value & 0xFFFF


def _signed(value: int) -> int:
    return value - 0x10000 if value & 0x8000 else value
