"""Settings of a functional tester, checked when they are given."""

import dataclasses
import math
from typing import Final

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import check_host

LONGEST_WATCHDOG: Final = 2000
"""ms: what the type declares as its reaction to a loss (`loss_reaction`) holds up to here."""
LONGEST_TEST: Final = 600.0
"""s: the deadline of the action `test` is made for this."""


def within(name: str, value: float, low: float, high: float) -> None:
    """Raise OutOfRange, naming the parameter, unless the value lies in the range."""
    if not (math.isfinite(value) and low <= value <= high):
        raise OutOfRange(f"{name} must be {low:g} to {high:g}, not {value!r}")


@dataclasses.dataclass
class FunctionalTesterSettings(Settings):
    """Where the tester is, and how long it may take.

    :param host: address or name of the tester
    :param port: port of its Modbus TCP server
    :param unit_id: Modbus unit id
    :param watchdog_ms: ms without a request after which the tester gives a test up; set when control is taken
    :param request_timeout: seconds the tester has to answer one request
    :param test_timeout: seconds the longest test program takes
    :param door_timeout: seconds the door has to reach its end position
    """

    host: str
    port: int = 502
    unit_id: int = 1
    watchdog_ms: int = 2000
    request_timeout: float = 0.5
    test_timeout: float = 60.0
    door_timeout: float = 5.0

    def __post_init__(self) -> None:
        check_host(self.host, self.port)
        within("unit_id", self.unit_id, 0, 255)
        within("watchdog_ms", self.watchdog_ms, 200, LONGEST_WATCHDOG)
        # A reading that is asked for a second time must not trip the watchdog: two time-outs, and one to spare.
        within("request_timeout", self.request_timeout, 0.05, self.watchdog_ms / 3000.0)
        within("test_timeout", self.test_timeout, 1.0, LONGEST_TEST)
        within("door_timeout", self.door_timeout, 0.5, 60.0)
