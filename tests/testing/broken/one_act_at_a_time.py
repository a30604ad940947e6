"""A second stroke waits for the first."""

import time

from arcor2_hw.actions import action

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    @action
    def stroke(self, *, an: str | None = None) -> None:
        """Press."""
        until = time.monotonic() + 5.0
        while self._acting.locked() and time.monotonic() < until:
            time.sleep(0.01)
        super().stroke()
