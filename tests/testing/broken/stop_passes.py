"""The first stop on a connection returns before the press stands."""

import threading
import time

from arcor2_hw.actions import action

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def stop(self) -> None:
        """Stop."""
        if self._stopped_once or time.monotonic() - self._began > 0.08:
            super().stop()
            return
        self._stopped_once = True
        threading.Timer(0.15, super().stop).start()

    @action
    def stroke(self, *, an: str | None = None) -> None:
        """Press."""
        self._began = time.monotonic()
        super().stroke()

    _stopped_once = False
    _began = 0.0
