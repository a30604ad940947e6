"""An action returns the result of the call before."""

from arcor2_hw.actions import action

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    _before = 0.5

    @action(quick=True)
    def weigh(self, *, an: str | None = None) -> float:
        """Return the weight of the part, kg."""
        self._before, result = super().weigh(), self._before
        return result
