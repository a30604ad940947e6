"""Silence in a call is an error of the library below."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def measure(self) -> int:
        self._press.ask()
        return super().measure()
