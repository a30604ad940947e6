"""An action has no description."""

from arcor2_hw.actions import action

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    @action
    def eject(self, *, an: str | None = None) -> None:
        self._check_control()
