"""Connecting to a silent press does not return."""

import threading

from .toy_press import ToyBench, ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _nobody(self, timeout: float) -> Exception:
        while self._there and not self._press.scrapped:
            threading.Event().wait(0.05)
        return super()._nobody(timeout)


class BrokenBench(ToyBench):
    case_within = 6.0
