"""Silence in a call is an error of the library below."""

from .toy_press import PRESS, ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def measure(self) -> int:
        PRESS.ask()
        return super().measure()
