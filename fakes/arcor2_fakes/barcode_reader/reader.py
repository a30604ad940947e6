"""The reader without its port: commands, decoding times and answers."""

from __future__ import annotations

import asyncio
import random
from collections import deque
from collections.abc import Callable
from typing import Literal, get_args

import msgspec

Health = Literal["OK", "DIRTY", "HOT", "FAIL"]
HEALTH: tuple[Health, ...] = get_args(Health)

_READ_TIME = (0.05, 0.15)
_DIRTY_FACTOR = 5.0
_TRANSIT = 0.005  # delay between decoding and the first byte of the answer; a LOFF during this time has no effect
_MAX_LINE = 128
_COMMANDS = ("LON", "LOFF", "VER", "STAT", "RST")
_RESERVED = frozenset({*_COMMANDS, "ERROR"})


class Framing(msgspec.Struct, frozen=True):
    """Framing of answers."""

    line_feed: bool = False
    stx: bool = False

    def wrap(self, text: str) -> bytes:
        """Return an answer with its framing."""
        body = text.encode("ascii")
        if self.stx:
            body = b"\x02" + body + b"\x03"
        return body + (b"\r\n" if self.line_feed else b"\r")


class BadCode(ValueError):
    """A barcode cannot contain this text."""


def check_code(code: str) -> str:
    """Return the code if a reader can send it.

    Raises:
        BadCode: It is empty, too long, not printable ASCII, or a word of the protocol.
    """
    if not 1 <= len(code) <= _MAX_LINE or not (code.isascii() and code.isprintable()):
        raise BadCode(f"a code must have 1 to {_MAX_LINE} printable ASCII characters, not {code!r}")
    if code in _RESERVED:
        raise BadCode(f"a code must not be one of {', '.join(sorted(_RESERVED))}")
    return code


class Reader:
    """A fixed-mount reader.

    Args:
        send: Sends bytes.
        seed: Seed of the decoding times.
        timeout: Time limit of a reading, s.
    """

    identity = ("Fake Optics", "BR-20", "FB0001", "2.01")

    def __init__(self, send: Callable[[bytes], None], *, framing: Framing, seed: int = 0, timeout: float = 1.0) -> None:
        self._send = send
        self.framing = framing
        self._timeout = timeout
        self._seed = seed
        self._loop = asyncio.get_running_loop()
        self._line = bytearray()
        self._too_long = False
        self._decoding: asyncio.TimerHandle | None = None
        self._time_out: asyncio.TimerHandle | None = None
        self._under_way: set[asyncio.TimerHandle] = set()  # decoded codes that are not sent yet
        self.received: deque[str] = deque(maxlen=50)
        self.sent: deque[str] = deque(maxlen=50)
        self.as_delivered()

    def as_delivered(self) -> None:
        """Reset everything: healthy, no code in view, no reading."""
        self.close()
        self.drop_input()
        self._random = random.Random(self._seed)
        self._code: str | None = None
        self._extra_delay = 0.0
        self.health: Health = "OK"
        self.received.clear()
        self.sent.clear()

    # ------------------------------------------------------------------------------------------------ serial line

    def feed(self, data: bytes) -> None:
        """Receive bytes."""
        for byte in data:
            if byte == 0x0D:
                line, too_long = bytes(self._line), self._too_long
                self.drop_input()
                if line and not too_long:
                    self._obey(line.decode("ascii", "replace").replace("\ufffd", "?"))
            elif byte != 0x0A:
                if len(self._line) < _MAX_LINE:
                    self._line.append(byte)
                else:
                    self._too_long = True

    def drop_input(self) -> None:
        """Discard an incomplete line."""
        self._line.clear()
        self._too_long = False

    def _obey(self, command: str) -> None:
        self.received.append(command)
        match command:
            case "LON":
                self._start_reading()
            case "LOFF":
                self._stop_reading()
            case "VER":
                self._answer(",".join(("VER", *self.identity)))
            case "STAT":
                self._answer(f"STAT,{int(self.health != 'FAIL')},{self.health}")
            case "RST":
                self.close()
                self._answer("OK,RST")
            case _:
                self._answer(f"ERR,{command},00")

    def _answer(self, text: str) -> None:
        self.sent.append(text)
        self._send(self.framing.wrap(text))

    # ------------------------------------------------------------------------------------------------ reading

    def _start_reading(self) -> None:
        self._stop_reading()
        self.reading = True
        self._time_out = self._loop.call_later(self._timeout, self._give_up)
        self._start_decoding()

    def _stop_reading(self) -> None:
        self.reading = False
        for timer in (self._decoding, self._time_out):
            if timer is not None:
                timer.cancel()
        self._decoding = self._time_out = None

    def _start_decoding(self) -> None:
        """Start to decode the code in view."""
        if self._decoding is not None:
            self._decoding.cancel()
            self._decoding = None
        if self.reading and self._code is not None and self.health != "FAIL":
            duration = self._random.uniform(*_READ_TIME) * (_DIRTY_FACTOR if self.health == "DIRTY" else 1.0)
            self._decoding = self._loop.call_later(duration, self._decoded, self._code)

    def _decoded(self, code: str) -> None:
        self._stop_reading()
        delay, self._extra_delay = _TRANSIT + self._extra_delay, 0.0

        def deliver() -> None:
            self._under_way.discard(timer)
            self._answer(code)

        timer = self._loop.call_later(delay, deliver)
        self._under_way.add(timer)

    def _give_up(self) -> None:
        self._stop_reading()
        self._answer("ERROR")

    # ------------------------------------------------------------------------------------------------ simulated world

    @property
    def code(self) -> str | None:
        """Return the code in front of the reader."""
        return self._code

    def present(self, code: str | None) -> None:
        """Set the code in front of the reader; None: no code.

        Raises:
            BadCode: A reader cannot send it.
        """
        code = None if code is None else check_code(code)
        if code != self._code:
            self._code = code
            self._start_decoding()

    def set_health(self, health: Health) -> None:
        """Set the condition of the reader, from the next reading on."""
        self.health = health
        if health == "FAIL":
            self._start_decoding()

    def delay_next(self, delay: float) -> None:
        """Delay the next decoded code, even if the host has sent another command since."""
        self._extra_delay = delay

    def close(self) -> None:
        """Cancel the reading."""
        self._stop_reading()
        for timer in self._under_way:
            timer.cancel()
        self._under_way.clear()
