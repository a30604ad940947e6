"""Control is taken from whoever has it."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def take_control(self) -> None:
        self._ours = True
