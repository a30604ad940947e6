"""Waiting for a stroke continues after the connection is closed."""

import time

from arcor2_hw.data.device import Connection

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def _stopped(self) -> Exception:
        while self.connection is Connection.OFFLINE and not self._press.scrapped:
            time.sleep(0.02)
        return super()._stopped()
