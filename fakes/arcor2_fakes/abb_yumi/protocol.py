"""Lines of the RAPID motion server: codes, statuses, encoding and decoding.

A line is ``seq code argument... *check``: at most 79 characters, fields separated by one space. The check is the sum of
position (from 1) times character code, modulo 997, of all before the asterisk. An answer is ``seq code status value...
*check``.
"""

import math
from collections import deque
from collections.abc import Iterable
from typing import Final

from arcor2_fakes.wire import Connection

VERSION: Final = 1
MAX_LINE: Final = 79

DONE, ACCEPTED, STOPPED, WATCHDOG_STOPPED = 0, 1, 2, 3
BAD_CHECK, BAD_CODE, BAD_COUNT, BAD_VALUE, UNREACHABLE, NO_SESSION, BY_HAND, NO_PARTNER = 10, 11, 12, 13, 14, 15, 16, 20
MOVE_TOGETHER, KEEP_ALIVE, STOP = 34, 90, 91

_COUNTS: Final = {
    0: (3, 10, 11, 12, 1, 23, 24, 31, 33, 40, 41, 42, 50, 53),
    1: (2, 5, 30, 32, 51, 52, 54, 55),
    2: (4, MOVE_TOGETHER),
    4: (7, 21),
    7: (6, 20),
    8: (22,),
}
ARGUMENTS: Final = {code: count for count, codes in _COUNTS.items() for code in codes}
"""Number of arguments by code."""
NEED_SESSION: Final = frozenset({6, 7, 30, 31, 32, 33, MOVE_TOGETHER, 50, 51, 52, 54, 55})
_QUATERNIONS: Final = frozenset({12, 42})  # codes answered with a quaternion


class Rejected(Exception):
    """A command is refused; `args[0]` is the status."""


def require(holds: bool) -> None:
    """Raise Rejected for a bad value."""
    if not holds:
        raise Rejected(BAD_VALUE)


def check(text: str) -> int:
    """Return the checksum of a line's text."""
    return sum(place * ord(sign) for place, sign in enumerate(text, 1)) % 997


def framed(text: str) -> bytes:
    """Return the line of a text."""
    return f"{text}*{check(text)}\n".encode()


def parsed(line: str) -> tuple[int, int, list[float]]:
    """Return sequence number, code and arguments of a line. Raise Rejected."""
    text, star, number = line.rpartition("*")
    if not star or len(line) > MAX_LINE or number != str(check(text)):
        raise Rejected(BAD_CHECK)
    try:
        sequence, code, *arguments = text.split(" ")
        values = [float(each) for each in arguments]
        if not all(map(math.isfinite, values)):
            raise ValueError
        return int(sequence), int(code), values
    except ValueError:
        raise Rejected(BAD_VALUE) from None


def answer(sequence: int, code: int, status: int, values: Iterable[float]) -> bytes:
    """Return the line of an answer."""
    decimals = 6 if code in _QUATERNIONS else 3
    return framed(" ".join([f"{sequence} {code} {status}", *(_number(value, decimals) for value in values)]))


def _number(value: float, decimals: int) -> str:
    """Format a number as RAPID's NumToStr does."""
    return f"{value:.{decimals}f}".rstrip("0").rstrip(".")


class Lines:
    """Lines received on a connection, waiting until the server reads them."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.waiting: deque[str] = deque()
        self._rest = b""
        connection.received = self._feed

    def _feed(self, data: bytes) -> None:
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[-2 * MAX_LINE :]
        self.waiting.extend(line.decode("latin-1") for line in lines)
