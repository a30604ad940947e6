"""A connection that was reset is not opened again."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _reopen(self) -> None:
        self._read_at = 0.0
