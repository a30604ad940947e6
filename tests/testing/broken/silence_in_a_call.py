"""A silent device raises an error of the underlying library."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def measure(self) -> int:
        self._press.ask()
        return super().measure()
