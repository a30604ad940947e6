"""Control is taken from another client."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def take_control(self) -> None:
        self._ours = True
