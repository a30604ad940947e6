"""The press stops without its driver and reports that it is running, but is declared to continue."""

from .toy_device import WATCHDOG
from .toy_reactions import ContinuingBench, ContinuingPress


class BrokenPress(ContinuingPress):
    """A press."""


class BrokenBench(ContinuingBench):
    stops_after = WATCHDOG
