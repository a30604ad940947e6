"""The press releases its part without its driver, but is declared to hold."""

from .toy_device import WATCHDOG
from .toy_reactions import HoldingBench, HoldingPress


class BrokenPress(HoldingPress):
    """A press."""


class BrokenBench(HoldingBench):
    lets_go_after = WATCHDOG
