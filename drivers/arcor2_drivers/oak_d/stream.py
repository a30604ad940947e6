"""Codec of the network stream, version 1, on the client's side (docs/devices/oak-d.md). Pure functions.

A message is a prefix of 16 bytes, a header in JSON and a payload. The prefix holds, in big-endian order: "OAKS",
version, kind, length of the header, length of the payload, and the CRC-32 of the first 12 bytes and the header.
"""

import enum
import struct
import zlib
from typing import Final, NamedTuple, TypeVar

import msgspec

MAGIC: Final = b"OAKS"
VERSION: Final = 1
PREFIX: Final = struct.Struct(">4sBBHII")
_CHECKED: Final = struct.Struct(">4sBBHI")
MAX_HEADER: Final = 4096
MAX_PAYLOAD: Final = 64 << 20
"""Longest payload, bytes: a 12-megapixel image with its depth."""

H = TypeVar("H", bound=msgspec.Struct)


class Kind(enum.IntEnum):
    """Kind of a message."""

    HELLO = 1
    START = 2
    FRAME = 3
    CLOCK = 4
    CONTROL = 5
    STATUS = 6
    REFUSED = 7


class BadStream(Exception):
    """The bytes are not a valid message; the connection has to be closed."""


class Prefix(NamedTuple):
    """The first 16 bytes of a message: kind, lengths of header and payload (bytes), and checksum."""

    kind: Kind
    header: int
    payload: int
    checked: bytes
    checksum: int


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
            raise ValueError(f"{self.width} x {self.height} at {self.fps:g} Hz is not a valid mode")


class FrameHeader(msgspec.Struct, frozen=True):
    """Header of a frame; `stamp` is on the source's clock, `exposure` is in s."""

    number: int
    stamp: float
    color: str
    color_bytes: int
    depth_bytes: int
    exposure: float | None = None


class Clock(msgspec.Struct, frozen=True):
    """Header of the answer to a clock request: time of the request (our clock), and time of the source's clock, s."""

    asked: float
    at: float


class Status(msgspec.Struct, frozen=True):
    """Header of a status: chip temperature, °C, and exposure time, s; None: automatic."""

    temperature: float
    exposure: float | None = None


class Refusal(msgspec.Struct, frozen=True):
    """Header of a refusal."""

    reason: str


def read_prefix(data: bytes | bytearray) -> Prefix:
    """Decode the first 16 bytes of a message. Raises BadStream."""
    magic, version, kind, header, payload, checksum = PREFIX.unpack_from(data)
    if magic != MAGIC:
        raise BadStream(f"not this protocol: a message starts with {bytes(magic)!r}")
    if version != VERSION:
        raise BadStream(f"version {version} of the protocol, not {VERSION}")
    if header > MAX_HEADER or payload > MAX_PAYLOAD:
        raise BadStream(f"a message of {header} and {payload} bytes is too long")
    try:
        found = Kind(kind)
    except ValueError:
        raise BadStream(f"a message of unknown kind {kind}") from None
    return Prefix(found, header, payload, bytes(data[: _CHECKED.size]), checksum)


def verify(prefix: Prefix, header: bytes | bytearray) -> None:
    """Verify the checksum. Raises BadStream."""
    if zlib.crc32(header, zlib.crc32(prefix.checked)) != prefix.checksum:
        raise BadStream(f"the checksum of a message of kind {prefix.kind.name.lower()} is wrong")


def read_header(header: bytes | bytearray, kind: type[H]) -> H:
    """Decode a header. Raises BadStream."""
    try:
        return msgspec.json.decode(header, type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise BadStream(f"an invalid header: {error}") from error


def encode(kind: Kind, header: dict[str, object]) -> bytes:
    """Return a message to the source. Messages to the source have no payload."""
    text = msgspec.json.encode(header)
    start = _CHECKED.pack(MAGIC, VERSION, kind, len(text), 0)
    return b"".join((start, struct.pack(">I", zlib.crc32(text, zlib.crc32(start))), text))
