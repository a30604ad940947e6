"""A force is returned in kN."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def force(self) -> float:
        return super().force() / 1000.0
