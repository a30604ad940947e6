"""Settings of a functional tester."""

import dataclasses
from typing import Annotated, Final

from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import Range, check_host, within

MAX_WATCHDOG_TIMEOUT: Final = 2000
"""Longest host watchdog, ms; declared in `loss_reaction`."""
MAX_TEST_TIME: Final = 600.0
"""Longest test, s; included in the deadline of the action `test`."""


@dataclasses.dataclass
class FunctionalTesterSettings(Settings):
    """Address of the tester, and time limits.

    :param host: address or name of the tester
    :param port: port of its Modbus TCP server
    :param unit_id: Modbus unit id
    :param watchdog_ms: time without a request after which the tester aborts a test, ms; written when control is taken
    :param request_timeout: time the tester has to answer one request, s
    :param test_timeout: duration of the longest test program, s
    :param door_timeout: time the door has to reach its end position, s
    """

    host: str = dataclasses.field(metadata={"found_by": "modbus"})
    port: int = 502
    unit_id: Annotated[int, Range(0, 255)] = 1
    watchdog_ms: Annotated[int, Range(200, MAX_WATCHDOG_TIMEOUT, "ms")] = 2000
    request_timeout: float = 0.5
    test_timeout: Annotated[float, Range(1.0, MAX_TEST_TIME, "s")] = 60.0
    door_timeout: Annotated[float, Range(0.5, 60.0, "s")] = 5.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_host(self.host, self.port)
        # A repeated reading takes two timeouts; the watchdog must not expire then.
        within("request_timeout", self.request_timeout, 0.05, self.watchdog_ms / 3000.0, "s")
