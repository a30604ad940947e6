"""A command acts without control."""

from arcor2_hw.data.device import Connection

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _check_control(self) -> None:
        if self._state is Connection.BACK:
            super()._check_control()
        self._check()
