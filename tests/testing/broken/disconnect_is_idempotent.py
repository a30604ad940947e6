"""A second disconnect waits for a thread that has ended."""

from arcor2_hw.data.device import Connection

from .toy_press import ToyPress, dawdle


class BrokenPress(ToyPress):
    """A press."""

    def disconnect(self) -> None:
        if self._read_at and self.connection is Connection.OFFLINE:
            dawdle(3.0)
        super().disconnect()
