"""Settings of a label printer, checked when they are given."""

import dataclasses

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.asked_line import check_line

from .zpl import DEFAULT_TEMPLATE, BadLabel, check_template


@dataclasses.dataclass
class ZplPrinterSettings(Settings):
    """Where the printer is, and what its labels look like.

    :param port: socket://host:9100, or a path such as /dev/ttyUSB0
    :param baud_rate: bits per second; without meaning for a socket
    :param answer_timeout: seconds the printer has to answer
    :param print_timeout: seconds a label may take until the printer has counted it
    :param template: ZPL of a label, with {title}, {text} and {code} (Code 128) where fields go; ^CI28 for UTF-8
    """

    port: str
    baud_rate: int = 9600
    answer_timeout: float = 1.0
    print_timeout: float = 15.0
    template: str = DEFAULT_TEMPLATE

    def __post_init__(self) -> None:
        check_line(self.port, self.baud_rate, self.answer_timeout)
        if not 0.1 <= self.print_timeout <= 90.0:
            raise OutOfRange(f"print_timeout must be 0.1 to 90 s, not {self.print_timeout!r}")
        try:
            check_template(self.template)
        except BadLabel as e:
            raise OutOfRange(f"template must be one label in ZPL: it {e}") from e
