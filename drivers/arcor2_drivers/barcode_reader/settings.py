"""Settings of a barcode reader, checked when they are given."""

import dataclasses
import math

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import check_serial_port


@dataclasses.dataclass
class BarcodeReaderSettings(Settings):
    """Where the reader is.

    :param port: a path such as /dev/ttyUSB0, or socket://host:port
    :param baud_rate: bits per second; without meaning for a socket
    :param answer_timeout: seconds the reader has to answer what needs no reading
    """

    port: str
    baud_rate: int = 9600
    answer_timeout: float = 0.5

    def __post_init__(self) -> None:
        check_serial_port("port", self.port)
        if not 300 <= self.baud_rate <= 921600:
            raise OutOfRange(f"baud_rate must be 300 to 921600, not {self.baud_rate!r}")
        if not (math.isfinite(self.answer_timeout) and 0.1 <= self.answer_timeout <= 10.0):
            raise OutOfRange(f"answer_timeout must be 0.1 to 10 s, not {self.answer_timeout!r}")
