"""A stroke that was cut off by a connection loss continues after the loss."""

from arcor2_hw.actions import action
from arcor2_hw.exceptions import ConnectionLost

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    @action
    def stroke(self, *, an: str | None = None) -> None:
        """Press."""
        try:
            super().stroke()
        except ConnectionLost:
            self._unfinished = True
            raise

    def _back(self) -> None:
        super()._back()
        if self._unfinished:
            self._press.ask("stroke")

    _unfinished = False
