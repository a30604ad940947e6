"""Observation does not resume after a loss; only a loss during control is repaired."""

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _lost(self) -> None:
        self._for_ever = not self._ours
        super()._lost()

    def _back(self) -> None:
        if not self._for_ever:
            super()._back()

    _for_ever = False
