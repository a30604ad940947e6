"""A force beyond the limit is silently reduced to it."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _limit(self, force: float) -> None:
        """Accept every force."""
