"""Settings of a scale, checked when they are given."""

import dataclasses

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.asked_line import check_line


@dataclasses.dataclass
class MtSicsScaleSettings(Settings):
    """Where the scale is.

    :param port: a path such as /dev/ttyUSB0, or socket://host:port
    :param baud_rate: bits per second; without meaning for a socket
    :param answer_timeout: seconds the scale has to answer what needs no waiting
    :param stable_timeout: seconds the load may take to come to rest
    """

    port: str
    baud_rate: int = 9600
    answer_timeout: float = 0.5
    stable_timeout: float = 10.0

    def __post_init__(self) -> None:
        check_line(self.port, self.baud_rate, self.answer_timeout)
        if not 0.1 <= self.stable_timeout <= 60.0:
            raise OutOfRange(f"stable_timeout must be 0.1 to 60 s, not {self.stable_timeout!r}")
