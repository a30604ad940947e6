"""The lanes of a session between a server and a node, and the form of messages on them.

Each lane has a connection of its own, so that a stop overtakes calls, and large frames delay neither.
"""

import struct
from collections.abc import Iterator
from enum import StrEnum
from typing import Final, NamedTuple

PREFIX: Final = "arcor2"
"""First token of all subjects."""
PART_SIZE: Final = 256 * 1024
"""Maximum size of a part of a message, bytes; a broker accepts 1 MiB unless configured otherwise."""
MORE: Final = 1
"""Flag: further parts of this message follow."""
END: Final = 2
"""Flag: the sender ends the session; the message is its reason."""
_HEADER: Final = struct.Struct("<QQdB")


class Lane(StrEnum):
    """A connection with a purpose."""

    CALLS = "calls"
    """Calls, answers and events, in order."""
    STOP = "stop"
    """Stops, their answers, and the beats."""
    FRAMES = "frames"
    """Large results and streamed values, and files."""


class Header(NamedTuple):
    """Properties of a message that are known without decoding it.

    number: counts the messages of the sender over all lanes. part: counts the parts of the lane. sent: when it was
    sent, on the sender's monotonic clock, s. flags: MORE, END.
    """

    number: int
    part: int
    sent: float
    flags: int


class MessageLost(Exception):
    """A message of a lane is missing."""


class LaneWriter:
    """Divides the messages of a lane into numbered parts."""

    def __init__(self) -> None:
        self._index = 0

    def parts(self, number: int, sent: float, flags: int, body: bytes) -> Iterator[bytes]:
        """Yield the parts of a message."""
        view = memoryview(body)
        for start in range(0, max(len(body), 1), PART_SIZE):
            more = MORE if start + PART_SIZE < len(body) else 0
            header = _HEADER.pack(number, self._index, sent, flags | more)
            self._index += 1
            yield header + view[start : start + PART_SIZE]


class LaneReader:
    """Joins the parts of a lane to messages."""

    def __init__(self) -> None:
        self._expected = 0
        self._parts: list[bytes] = []

    def message(self, payload: bytes) -> tuple[Header, bytes] | None:
        """Return the message that a part completes, None if parts are missing.

        Raises:
            MessageLost: a part was lost, so the following messages of the lane cannot be used.
        """
        if len(payload) < _HEADER.size:
            raise MessageLost
        header = Header(*_HEADER.unpack_from(payload))
        if header.part != self._expected:
            raise MessageLost
        self._expected += 1
        self._parts.append(payload[_HEADER.size :])
        if header.flags & MORE:
            return None
        body = b"".join(self._parts)
        self._parts.clear()
        return header, body
