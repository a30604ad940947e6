"""A press that goes on without its owner, and is declared to stop."""

from .toy_press import ToyBench, ToyPress


class BrokenPress(ToyPress):
    """A press."""


class BrokenBench(ToyBench):
    watchdog = 3600.0
