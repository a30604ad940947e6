"""The reader itself: commands in, answers out, in time. Knows neither pty nor socket."""

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
_TRANSIT = 0.005  # between decoding and the first byte on the line; a LOFF in that time comes too late
_MAX_LINE = 128
_COMMANDS = ("LON", "LOFF", "VER", "STAT", "RST")
_RESERVED = frozenset({*_COMMANDS, "ERROR"})


class Framing(msgspec.Struct, frozen=True):
    """How answers are framed."""

    line_feed: bool = False
    stx: bool = False

    def wrap(self, text: str) -> bytes:
        """Return an answer as it goes on the line."""
        body = text.encode("ascii")
        if self.stx:
            body = b"\x02" + body + b"\x03"
        return body + (b"\r\n" if self.line_feed else b"\r")


class BadCode(ValueError):
    """No barcode can hold this text."""


def check_code(code: str) -> str:
    """Return the code back if a reader can send it.

    Raises:
        BadCode: it is empty, too long, not printable ASCII, or a word of the protocol.
    """
    if not 1 <= len(code) <= _MAX_LINE or not (code.isascii() and code.isprintable()):
        raise BadCode(f"a code has 1 to {_MAX_LINE} printable ASCII characters, not {code!r}")
    if code in _RESERVED:
        raise BadCode(f"a code is never one of {', '.join(sorted(_RESERVED))}")
    return code


class Reader:
    """A fixed-mount reader.

    Args:
        send: puts bytes on the line.
        seed: decides how long each reading takes.
        timeout: the reader's own time-out, s.
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
        self._under_way: set[asyncio.TimerHandle] = set()  # codes decoded and not sent yet
        self.received: deque[str] = deque(maxlen=50)
        self.sent: deque[str] = deque(maxlen=50)
        self.as_delivered()

    def as_delivered(self) -> None:
        """Be without any past: healthy, nothing in view, nothing under way."""
        self.close()
        self.drop_input()
        self._random = random.Random(self._seed)
        self._code: str | None = None
        self._extra_delay = 0.0
        self.health: Health = "OK"
        self.received.clear()
        self.sent.clear()

    # ------------------------------------------------------------------------------------------------ the line's side

    def feed(self, data: bytes) -> None:
        """Take bytes from the line."""
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
        """Forget the part of a line that has come so far."""
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
        self._look()

    def _stop_reading(self) -> None:
        self.reading = False
        for timer in (self._decoding, self._time_out):
            if timer is not None:
                timer.cancel()
        self._decoding = self._time_out = None

    def _look(self) -> None:
        """Begin to decode what is in view."""
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

    # ------------------------------------------------------------------------------------------------ the world's side

    @property
    def code(self) -> str | None:
        """The code that lies in front."""
        return self._code

    def present(self, code: str | None) -> None:
        """Lay a code in front of the reader, or nothing.

        Raises:
            BadCode: no reader could send that.
        """
        code = None if code is None else check_code(code)
        if code != self._code:
            self._code = code
            self._look()

    def set_health(self, health: Health) -> None:
        """Change the reader's condition; it counts from the next look on."""
        self.health = health
        if health == "FAIL":
            self._look()

    def delay_next(self, delay: float) -> None:
        """Let the next decoded code reach the line so many seconds late, whatever the host has asked for since."""
        self._extra_delay = delay

    def close(self) -> None:
        """Cancel everything that is under way."""
        self._stop_reading()
        for timer in self._under_way:
            timer.cancel()
        self._under_way.clear()
