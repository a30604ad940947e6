"""Connecting enables the press."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _greet(self) -> None:
        self._press.ask("enable")
