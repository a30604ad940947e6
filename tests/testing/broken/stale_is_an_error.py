"""The last reading is given for ever."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def reading(self) -> float:
        return self._read_at
