"""A stop in the second half of the stroke is forgotten."""

import time

from arcor2_hw.actions import action

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def stop(self) -> None:
        """Stop."""
        if time.monotonic() - self._began < 0.25:
            super().stop()

    @action
    def stroke(self, *, an: str | None = None) -> None:
        """Press."""
        self._began = time.monotonic()
        super().stroke()

    _began = 0.0
