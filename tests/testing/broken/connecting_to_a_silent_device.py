"""Connecting to a silent press ignores the timeout."""

from .toy_press import ToyPress, dawdle


class BrokenPress(ToyPress):
    """A press."""

    def _nobody(self, timeout: float) -> Exception:
        if self._there:
            dawdle(timeout + 2.0)
        return super()._nobody(timeout)
