"""The printer without its port: status requests, queue of formats, printing in time."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any, Final

import msgspec

from arcor2_fakes.label_printer.zpl import Format, Stream

MODEL: Final = "ZT411-203dpi"
FIRMWARE: Final = "V92.21.39Z"
SERIAL_NUMBER: Final = "99J204200001"
BUFFER: Final = 8
"""Largest number of queued formats; more are discarded, as by a printer whose host ignores the buffer-full flag."""


SETTINGS: Final[dict[str, tuple[str, Callable[[str], bool]]]] = {
    "print.tone": ("10.0", lambda text: _is_number(text) and 0.0 <= float(text) <= 30.0),
    "media.speed": ("4.0", lambda text: _is_number(text) and 2.0 <= float(text) <= 14.0),
    "ezpl.print_width": ("832", lambda text: text.isdigit() and 2 <= int(text) <= 832),
    "ezpl.media_type": ("gap/notch", ("continuous", "gap/notch", "mark").__contains__),
    "ezpl.print_method": ("thermal trans", ("thermal trans", "direct thermal").__contains__),
    "ezpl.tear_off": ("0", lambda text: _is_number(text) and abs(float(text)) <= 120.0),
    "ezpl.power_up_action": ("calibrate", ("feed", "calibrate", "length", "no motion").__contains__),
    "ezpl.head_close_action": ("feed", ("feed", "calibrate", "length", "no motion").__contains__),
}
"""Settings by SGD name: default, and whether a value is acceptable."""


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


class Label(msgspec.Struct, frozen=True):
    """A printed label."""

    number: int
    zpl: str
    fields: list[dict[str, Any]]


class LabelPrinter:
    """A thermal transfer printer.

    Args:
        send: Sends bytes.
        printed: Called for each printed label.
        duration: Printing time of a label, s.
        mute: Whether the printer does not answer while it has no media or its head is open.
    """

    def __init__(
        self,
        send: Callable[[bytes], None],
        printed: Callable[[], None],
        *,
        duration: float,
        mute: bool,
        labels: int,
        serial_number: str = SERIAL_NUMBER,
        firmware: str = FIRMWARE,
    ) -> None:
        self.identity = (MODEL, firmware, 8, 65536)
        self.unique_id = serial_number
        self.settings = {name: default for name, (default, _) in SETTINGS.items()}
        self._send, self._printed = send, printed
        self._duration = duration
        self._loop = asyncio.get_running_loop()
        self._stream = Stream()
        self._queue: deque[Format] = deque()
        self._left = 0  # remaining labels of the present format
        self._timer: asyncio.TimerHandle | None = None
        self.mute = mute
        self.media = labels
        self.counter = 0
        self.paused = self.head_open = self.ribbon_out = self.hot = False
        self.forgetful = False
        self.labels: deque[Label] = deque(maxlen=1000)
        self.received: deque[str] = deque(maxlen=200)

    @property
    def partial(self) -> bool:
        """Return whether a format was received partially."""
        return self._stream.partial

    @property
    def waiting(self) -> int:
        """Return the number of formats that are not printed."""
        return len(self._queue)

    # ------------------------------------------------------------------------------------------------ serial line
    def feed(self, data: bytes) -> None:
        """Receive bytes."""
        for item in self._stream.feed(data):
            if isinstance(item, Format):
                self.received.append("format")
                if self.forgetful:
                    continue
                if len(self._queue) < BUFFER:
                    self._queue.append(item)
                    self.go_on()
            else:
                self.received.append(item)
                self._obey(item)

    def drop_input(self) -> None:
        """Discard a format that was received partially."""
        self._stream.clear()

    def _obey(self, command: str) -> None:
        if self.mute and (self.media <= 0 or self.head_open):
            return
        if command == "~HS":
            self._send(self._host_status())
        elif command == "~HI":
            model, firmware, dots, memory = self.identity
            self._send(_framed(f"{model},{firmware},{dots},{memory}KB"))
        elif command == "~PS":
            self.pause(False)
        elif command == "~PP":
            self.pause(True)
        elif command.startswith("getvar "):
            values = {"odometer.total_label_count": str(self.counter), "device.unique_id": self.unique_id}
            values |= self.settings
            self._send(f'"{values.get(command.removeprefix("getvar "), "?")}"'.encode("ascii"))

        elif command.startswith("setvar "):
            name, _, value = command.removeprefix("setvar ").partition("=")
            if name in SETTINGS and SETTINGS[name][1](value):
                self.settings[name] = value

    def _host_status(self) -> bytes:
        waiting = len(self._queue)
        one = (
            f"030,{self.media <= 0:d},{self.paused:d},1245,{waiting:03d},{waiting >= BUFFER:d},0,{self.partial:d},"
            f"000,0,0,{self.hot:d}"
        )
        two = f"000,0,{self.head_open:d},{self.ribbon_out:d},1,2,6,0,{self._left:08d},1,000"
        return _framed(one) + _framed(two) + _framed("1234,0")

    # ------------------------------------------------------------------------------------------------ printing
    @property
    def _able(self) -> bool:
        return self.media > 0 and not (self.paused or self.head_open or self.ribbon_out or self.hot)

    def go_on(self) -> None:
        """Print the queued formats, if possible."""
        if self._timer is None and self._queue and self._able:
            if self._left == 0:
                self._left = self._queue[0].quantity
            self._timer = self._loop.call_later(self._duration, self._finish_label)

    def hold(self) -> None:
        """Stop printing; an unfinished label is printed again."""
        if self._timer is not None and not self._able:
            self._timer.cancel()
            self._timer = None

    def _finish_label(self) -> None:
        self._timer = None
        format_ = self._queue[0]
        self.counter += 1
        self.media -= 1
        self._left -= 1
        self.labels.append(Label(self.counter, format_.zpl, [msgspec.to_builtins(f) for f in format_.fields]))
        if self._left == 0:
            self._queue.popleft()
        self._printed()
        self.go_on()

    # ------------------------------------------------------------------------------------------------ simulated world
    def pause(self, on: bool) -> None:
        """Press the pause key."""
        self.paused = on
        self.hold()
        self.go_on()

    def renew(self, labels: int) -> None:
        """Reset everything, with a number of labels on the roll."""
        self.power_cycle()
        self.media, self.counter = labels, 0
        self.head_open = self.ribbon_out = self.hot = self.forgetful = False
        self.labels.clear()
        self.received.clear()

    def power_cycle(self) -> None:
        """Switch off and on: the queue is lost, the odometer stays."""
        self.close()
        self._queue.clear()
        self._left = 0
        self._stream.clear()
        self.paused = False

    def close(self) -> None:
        """Cancel printing."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


def _framed(text: str) -> bytes:
    return b"\x02" + text.encode("ascii") + b"\x03\r\n"
