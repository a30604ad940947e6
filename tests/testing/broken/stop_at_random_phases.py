"""A stop late in the third stroke of a connection is ignored."""

import time

from arcor2_hw.actions import action

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def stop(self) -> None:
        """Stop."""
        if self._strokes < 3 or time.monotonic() - self._began < 0.25:
            super().stop()

    @action
    def stroke(self, *, an: str | None = None) -> None:
        """Press."""
        self._began = time.monotonic()
        self._strokes += 1
        super().stroke()

    _began = 0.0
    _strokes = 0
