"""A second stroke waits for the first."""

from arcor2_hw.actions import action
from arcor2_hw.exceptions import DeviceTimeout
from arcor2_hw.keep_alive import once_within

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    @action
    def stroke(self, *, an: str | None = None) -> None:
        """Press."""
        if not once_within(lambda: not self._acting.locked(), 2.0, 0.01):
            raise DeviceTimeout(f"{self.where}: the first stroke did not end")
        super().stroke()
