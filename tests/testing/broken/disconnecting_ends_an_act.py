"""Waiting for a stroke continues after the connection is closed."""

import time

from arcor2_hw.data.device import Connection

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _stopped(self) -> Exception:
        if self.connection is Connection.OFFLINE:
            time.sleep(5.0)
        return super()._stopped()
