"""The stream of a network source, version 1, as its client speaks it (docs/devices/oak-d.md). Big-endian numbers.

A message is 16 bytes ("OAKS", version, kind, length of the header, length of the payload, CRC-32 of the first 12 bytes
and the header), a header in JSON, and a payload. Nothing here does I/O; every length is capped.
"""

import enum
import struct
import zlib
from typing import Final, NamedTuple, TypeVar

import msgspec

MAGIC: Final = b"OAKS"
VERSION: Final = 1
FIXED: Final = struct.Struct(">4sBBHII")
_CHECKED: Final = struct.Struct(">4sBBHI")
LONGEST_HEADER: Final = 4096
LONGEST_PAYLOAD: Final = 64 << 20
"""Bytes: a 12-megapixel picture with its depth."""

H = TypeVar("H", bound=msgspec.Struct)


class Kind(enum.IntEnum):
    """What a message is."""

    HELLO = 1
    START = 2
    FRAME = 3
    CLOCK = 4
    CONTROL = 5
    STATUS = 6
    REFUSED = 7


class BadStream(Exception):
    """What came is no message of this protocol; nothing sensible can follow."""


class Front(NamedTuple):
    """The first 16 bytes of a message."""

    kind: Kind
    header: int
    payload: int
    checked: bytes
    check: int


class Hello(msgspec.Struct, frozen=True):
    """Header of a hello."""

    vendor: str
    model: str
    serial: str
    firmware: str
    width: int
    height: int
    fps: float
    depth_range: tuple[float, float]

    def __post_init__(self) -> None:
        if not (16 <= self.width <= 8192 and 16 <= self.height <= 8192 and 0.0 < self.fps <= 1000.0):
            raise ValueError(f"{self.width} x {self.height} at {self.fps:g} Hz is no camera's mode")


class FrameHeader(msgspec.Struct, frozen=True):
    """Header of a frame; `stamp` on the source's clock, `exposure` in s."""

    number: int
    stamp: float
    color: str
    color_bytes: int
    depth_bytes: int
    exposure: float | None = None


class Clock(msgspec.Struct, frozen=True):
    """Header of the answer to a question for the clock."""

    asked: float
    at: float


class Status(msgspec.Struct, frozen=True):
    """Header of a status: deg C, and the exposure that is set, None for automatic."""

    temperature: float
    exposure: float | None = None


class Refusal(msgspec.Struct, frozen=True):
    """Header of a refusal."""

    reason: str


def front(data: bytes | bytearray) -> Front:
    """Read the first 16 bytes. Raises BadStream."""
    magic, version, kind, header, payload, check = FIXED.unpack_from(data)
    if magic != MAGIC:
        raise BadStream(f"it does not speak this protocol: a message begins with {bytes(magic)!r}")
    if version != VERSION:
        raise BadStream(f"it speaks version {version} of the protocol, not {VERSION}")
    if header > LONGEST_HEADER or payload > LONGEST_PAYLOAD:
        raise BadStream(f"a message of {header} and {payload} bytes is too long")
    try:
        found = Kind(kind)
    except ValueError:
        raise BadStream(f"there is no message of kind {kind}") from None
    return Front(found, header, payload, bytes(data[: _CHECKED.size]), check)


def check(front_: Front, header: bytes | bytearray) -> None:
    """Compare the checksum. Raises BadStream."""
    if zlib.crc32(header, zlib.crc32(front_.checked)) != front_.check:
        raise BadStream(f"the checksum of a message of kind {front_.kind.name.lower()} is wrong")


def read(header: bytes | bytearray, kind: type[H]) -> H:
    """Read a header. Raises BadStream."""
    try:
        return msgspec.json.decode(header, type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise BadStream(f"a header is not readable: {error}") from error


def message(kind: Kind, header: dict[str, object]) -> bytes:
    """Return a message to the source; none has a payload."""
    text = msgspec.json.encode(header)
    start = _CHECKED.pack(MAGIC, VERSION, kind, len(text), 0)
    return b"".join((start, struct.pack(">I", zlib.crc32(text, zlib.crc32(start))), text))
