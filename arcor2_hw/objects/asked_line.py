"""AskedLine: a LineDevice made of functions, for drivers in released packages. New drivers derive from LineDevice."""

from collections.abc import Callable

from arcor2_hw.exceptions import DeviceError, DeviceTimeout
from arcor2_hw.messages import Message
from arcor2_hw.objects.line_device import LineDevice
from arcor2_hw.objects.settings import check_serial_port, within


class AskedLine(LineDevice):
    """A LineDevice whose hooks are functions; see there."""

    def __init__(
        self,
        who: str | Message,
        port: str,
        baud_rate: int,
        answer_timeout: float,
        greet: Callable[[float], None],
        poll: Callable[[], None],
        period: float,
        unasked: Callable[[bytes], None] = lambda _: None,
        lost: Callable[[DeviceError], None] = lambda _: None,
        overdue: Callable[[DeviceTimeout], DeviceError] = lambda error: error,
    ) -> None:
        self.name, self.poll_period, self.answer_timeout = str(who), period, answer_timeout
        self._lost = lost
        self.__dict__ |= {"greet": greet, "poll": poll, "on_unasked": unasked, "overdue": overdue}
        self.use_line(port, baud_rate, answer_timeout)
        self.who = self.line.who = self.observing.what = who

    def send(self, data: bytes) -> None:
        """Send bytes that have no answer. Raises ConnectionLost, DeviceTimeout."""
        self.line.send(data)

    def close(self) -> None:
        """Stop observing and close the line."""
        self.disconnect()

    def on_lost(self, error: DeviceError) -> None:
        """Call `lost`."""
        super().on_lost(error)
        self._lost(error)


def check_line(port: str, baud_rate: int, answer_timeout: float) -> None:
    """Check the settings of a line. Raises OutOfRange with the setting's name."""
    check_serial_port("port", port)
    within("baud_rate", baud_rate, 300, 921600)
    within("answer_timeout", answer_timeout, 0.1, 10.0, "s")
