"""Codec of the network stream, version 1, on the side of the source. Numbers are big-endian.

    offset  size  field
    0       4     "OAKS"
    4       1     version, 1
    5       1     kind
    6       2     length of the header, bytes
    8       4     length of the payload, bytes
    12      4     CRC-32 (zlib) of bytes 0 to 11 and the header
    16            header: a JSON object, UTF-8
                  payload

| kind | name    | direction | header                                                            | payload           |
|------|---------|-----------|-------------------------------------------------------------------|-------------------|
| 1    | hello   | to client | vendor, model, serial, firmware, width, height, fps, depth_range  | EEPROM JSON       |
| 2    | start   | to source | client: its name; color: "bgr" or "jpeg"                          |                   |
| 3    | frame   | to client | number, stamp, exposure, color, color_bytes, depth_bytes          | colour, depth     |
| 4    | clock   | both      | asked: the client's clock; answer: also at, the source's clock    |                   |
| 5    | control | to source | exposure: seconds, or null for automatic                          |                   |
| 6    | status  | to client | temperature (deg C), exposure (s or null)                         |                   |
| 7    | refused | to client | reason                                                            |                   |

The source sends hello when a client has connected, and nothing else until start. `stamp` is the end of the exposure on
the clock of the source (s, monotonic). Colour is rows of B, G, R, or a JPEG file. Depth is rows of 16-bit mm,
little-endian, 0 where there is none; a frame without depth has depth_bytes 0. The source sends status after start, on
every change and once per second, and as the answer to control. The CRC does not cover the payload: TCP has a checksum,
and a CRC of 4.6 MB per frame takes longer than rendering.
"""

from __future__ import annotations

import enum
import struct
import zlib
from collections.abc import Callable
from typing import Any, Final

import msgspec

MAGIC: Final = b"OAKS"
VERSION: Final = 1
FIXED: Final = struct.Struct(">4sBBHII")
MAX_HEADER: Final = 4096
MAX_CLIENT_PAYLOAD: Final = 0
"""Longest payload from a client, bytes: its messages have none."""


class Kind(enum.IntEnum):
    """Kind of a message."""

    HELLO = 1
    START = 2
    FRAME = 3
    CLOCK = 4
    CONTROL = 5
    STATUS = 6
    REFUSED = 7


class BadMessage(Exception):
    """The bytes are not a valid message."""


def encode(kind: Kind, header: dict[str, Any], payload: bytes = b"", *, wrong_checksum: bool = False) -> bytes:
    """Return a message."""
    text = msgspec.json.encode(header)
    front = struct.pack(">4sBBHI", MAGIC, VERSION, kind, len(text), len(payload))
    check = zlib.crc32(text, zlib.crc32(front)) ^ (0xDEADBEEF if wrong_checksum else 0)
    return b"".join((front, struct.pack(">I", check), text, payload))


class Questions:
    """Splits the bytes from a client into messages, and calls `take` with each."""

    def __init__(self, take: Callable[[Kind, dict[str, Any]], None]) -> None:
        self._take = take
        self._rest = b""

    def feed(self, data: bytes) -> None:
        """Receive bytes. Raises BadMessage; the connection must be closed then."""
        self._rest += data
        while len(self._rest) >= FIXED.size:
            magic, version, kind, length, payload, check = FIXED.unpack_from(self._rest)
            if magic != MAGIC or version != VERSION or length > MAX_HEADER or payload > MAX_CLIENT_PAYLOAD:
                raise BadMessage("not a message of version 1")
            if len(self._rest) < FIXED.size + length:
                return
            header = self._rest[FIXED.size : FIXED.size + length]
            if zlib.crc32(header, zlib.crc32(self._rest[:12])) != check:
                raise BadMessage("wrong checksum")
            self._rest = self._rest[FIXED.size + length :]
            try:
                self._take(Kind(kind), msgspec.json.decode(header, type=dict[str, Any]))
            except (ValueError, msgspec.DecodeError) as e:
                raise BadMessage(str(e)) from e
