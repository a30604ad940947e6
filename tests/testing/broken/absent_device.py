"""The error for a missing device lacks the address."""

from arcor2_hw.exceptions import NotConnected

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _nobody(self, timeout: float) -> Exception:
        return super()._nobody(timeout) if self._there else NotConnected(f"nobody answers at {self.name}")
