"""The press continues without its driver, but is declared to stop."""

from .toy_press import ToyBench, ToyPress


class BrokenPress(ToyPress):
    """A press."""


class BrokenBench(ToyBench):
    watchdog = 3600.0
