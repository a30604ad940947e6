"""The stroke that was cut off goes on after the loss."""

from .toy_press import PRESS, ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _lost(self) -> None:
        self._had = self._acting.locked()
        super()._lost()

    def _back(self) -> None:
        super()._back()
        if self._had:
            PRESS.ask("stroke")

    _had = False
