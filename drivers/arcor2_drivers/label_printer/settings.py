"""Settings of a label printer."""

import dataclasses
from typing import Annotated

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import Range, check_serial_port

from .zpl import DEFAULT_TEMPLATE, BadLabel, check_template


@dataclasses.dataclass
class ZplPrinterSettings(Settings):
    """Address of the printer, time limits, and the template of its labels.

    :param port: socket://host:9100, or a path such as /dev/ttyUSB0
    :param baud_rate: bits per second; ignored for a socket
    :param answer_timeout: time the printer has to answer, s
    :param print_timeout: time until the printer has counted a label, s
    :param template: ZPL of a label, with {title}, {text} and {code} (Code 128) where fields go; ^CI28 for UTF-8
    """

    port: str = dataclasses.field(metadata={"found_by": "serial"})
    baud_rate: Annotated[int, Range(300, 921600)] = 9600
    answer_timeout: Annotated[float, Range(0.1, 10.0, "s")] = 1.0
    print_timeout: Annotated[float, Range(0.1, 90.0, "s")] = 15.0
    template: str = DEFAULT_TEMPLATE

    def __post_init__(self) -> None:
        super().__post_init__()
        check_serial_port("port", self.port)
        try:
            check_template(self.template)
        except BadLabel as e:
            raise OutOfRange("template must be one label in ZPL: it {reason}", reason=e) from e
