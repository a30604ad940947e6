"""A public method lacks type hints."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def tonnage(self, scale) -> float:
        return self.force() * scale
