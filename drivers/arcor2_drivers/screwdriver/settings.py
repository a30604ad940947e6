"""Settings of a screwdriver."""

import dataclasses
from typing import Annotated

from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import Range, check_host


@dataclasses.dataclass
class OpenProtocolScrewdriverSettings(Settings):
    """Address of the tightening controller, and time limits.

    :param host: address or name of the controller
    :param port: port of its Open Protocol
    :param answer_timeout: time the controller has to answer, s
    :param keep_alive: time between two keep-alive messages, s; the controller disconnects after 15 s without a message
    """

    host: str
    port: int = 4545
    answer_timeout: Annotated[float, Range(0.1, 5.0, "s")] = 1.0
    keep_alive: Annotated[float, Range(0.2, 10.0, "s")] = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_host(self.host, self.port)
