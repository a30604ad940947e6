"""A force beyond the limit is cut to it in silence."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _limit(self, force: float) -> None:
        """Every force will do."""
