"""ModbusDevice: a device on Modbus TCP or RTU. A mixin of object types."""

import time
from collections.abc import Callable
from typing import Final, TypeVar

from arcor2_hw.data.device import Identity
from arcor2_hw.exceptions import DeviceTimeout
from arcor2_hw.objects.modbus_link import ModbusLink
from arcor2_hw.objects.polled_control import PolledControl
from arcor2_hw.objects.state_observer import Snapshot

T = TypeVar("T")

REQUESTS_TO_OPEN: Final = 4
"""Number of requests within the time limit of connecting: two readings, each repeated once."""
MIN_REQUEST_TIMEOUT: Final = 0.02
"""Shortest time limit of a request, s."""
RELEASE_REQUEST_TIMEOUT: Final = 0.3
"""Time limit of a request that releases control during disconnecting, s, which may take 1 s."""


class ModbusDevice(PolledControl[T]):
    """A device on Modbus. A driver calls `self.use_link(self.link)` in `__init__`; `read_state` uses `self.link`."""

    link: ModbusLink

    def open_link(self, timeout: float) -> Snapshot[T]:
        """Open the connection and read the first state within `timeout` s."""
        self.link.load()
        deadline = time.monotonic() + timeout
        self.link.open(timeout)
        left = (deadline - time.monotonic()) / REQUESTS_TO_OPEN
        with self.link.limited(max(left, MIN_REQUEST_TIMEOUT)):
            return self.snapshot()

    def identify(self) -> Identity:
        """Read the identification of the device (function 43/14)."""
        self.observing.check()
        return self.link.identify()

    @staticmethod
    def repeat_once(write: Callable[[], None]) -> None:
        """Write, and write again when no answer came. Use it only where a repetition does no harm."""
        try:
            write()
        except DeviceTimeout:
            write()

    def leave(self) -> None:
        """Release control during disconnecting."""
        with self.link.limited(RELEASE_REQUEST_TIMEOUT):
            super().leave()


# Names before version 0.2.
LAST_REQUEST, SHORTEST_REQUEST = RELEASE_REQUEST_TIMEOUT, MIN_REQUEST_TIMEOUT
