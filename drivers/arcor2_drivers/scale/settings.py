"""Settings of a scale."""

import dataclasses
from typing import Annotated

from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import Range, check_serial_port


@dataclasses.dataclass
class MtSicsScaleSettings(Settings):
    """Address of the scale, and time limits.

    :param port: a path such as /dev/ttyUSB0, or socket://host:port
    :param baud_rate: bits per second; ignored for a socket
    :param answer_timeout: time the scale has to answer, without waiting for stability, s
    :param stable_timeout: time the load has to become stable, s
    """

    port: str = dataclasses.field(metadata={"found_by": "serial"})
    baud_rate: Annotated[int, Range(300, 921600)] = 9600
    answer_timeout: Annotated[float, Range(0.1, 10.0, "s")] = 0.5
    stable_timeout: Annotated[float, Range(0.1, 60.0, "s")] = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_serial_port("port", self.port)
