"""ModbusDevice: a device that is read and commanded over Modbus TCP or RTU. A mixin of object types."""

import time
from typing import Final, TypeVar

from arcor2_hw.data.device import Identity
from arcor2_hw.objects.modbus_link import ModbusLink
from arcor2_hw.objects.polled_control import PolledControl
from arcor2_hw.objects.state_observer import Snapshot

T = TypeVar("T")

REQUESTS_TO_OPEN: Final = 4
"""Requests that have to fit into the time for connecting: two readings, each repeated once."""
SHORTEST_REQUEST: Final = 0.02
LAST_REQUEST: Final = 0.3
"""Time for a request that releases control while we disconnect, s; disconnecting may take one second."""


class ModbusDevice(PolledControl[T]):
    """A device on Modbus: `self.use_link(self.link)` in `__init__`, `read_state` reads by `self.link`."""

    link: ModbusLink

    def open_link(self, timeout: float) -> Snapshot[T]:
        """Open the connection and read the first state within `timeout` s."""
        deadline = time.monotonic() + timeout
        self.link.open(timeout)
        left = (deadline - time.monotonic()) / REQUESTS_TO_OPEN
        with self.link.limited(max(left, SHORTEST_REQUEST)):
            return Snapshot.by(self.read_state)

    def identify(self) -> Identity:
        """Read the identification of the device (function 43/14)."""
        self.observing.check()
        return self.link.identify()

    def leave(self) -> None:
        """Release control because we disconnect."""
        with self.link.limited(LAST_REQUEST):
            super().leave()
