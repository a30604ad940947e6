"""Connecting enables the press."""

from .toy_press import PRESS, ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _greet(self) -> None:
        PRESS.ask("enable")
