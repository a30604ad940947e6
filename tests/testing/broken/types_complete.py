"""A public method that does not say what it takes."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def tonnage(self, scale) -> float:
        return self.force() * scale
