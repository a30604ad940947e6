"""Control is taken again after a loss, unless the loss interrupted an action."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _lost(self) -> None:
        self._had = self._ours and not self._acting.locked()
        super()._lost()

    def _back(self) -> None:
        super()._back()
        self._ours = self._had

    _had = False
