"""The last reading is returned at any age."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def reading(self) -> float:
        return self._read_at
