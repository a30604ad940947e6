"""Connecting to a silent press ignores the timeout."""

import time

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _nobody(self, timeout: float) -> Exception:
        if self._there:
            time.sleep(timeout + 4.0)
        return super()._nobody(timeout)
