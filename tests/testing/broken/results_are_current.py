"""An action returns its first result for ever."""

from arcor2_hw.actions import action

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    _first: float | None = None

    @action(quick=True)
    def weigh(self, *, an: str | None = None) -> float:
        """Return the weight of the part, kg."""
        if self._first is None:
            self._first = super().weigh()
        return self._first
