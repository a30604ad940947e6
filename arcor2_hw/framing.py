"""How our own processes cut a stream into messages: four bytes of length, little-endian, then the message."""

import struct
from typing import Final

_PREFIX: Final = struct.Struct("<I")
PREFIX_SIZE: Final = _PREFIX.size


def prefix(length: int) -> bytes:
    """Give what stands in front of a message of so many bytes."""
    return _PREFIX.pack(length)


def framed(body: bytes) -> bytes:
    """Give a message with its length in front."""
    return prefix(len(body)) + body


def body_length(prefix: bytes, limit: int) -> int:
    """Read the length in front of a message, bytes; ValueError beyond the limit."""
    (length,) = _PREFIX.unpack(prefix)
    if length > limit:
        raise ValueError(f"a message of {length} bytes is longer than {limit}")
    return int(length)
