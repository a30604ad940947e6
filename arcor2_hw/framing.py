"""Framing of messages between our own processes: a length of four bytes, little-endian, then the message."""

import struct
from typing import Final

_PREFIX: Final = struct.Struct("<I")
PREFIX_SIZE: Final = _PREFIX.size


def prefix(length: int) -> bytes:
    """Return the length prefix of a message of `length` bytes."""
    return _PREFIX.pack(length)


def framed(body: bytes) -> bytes:
    """Return a message with its length prefix."""
    return prefix(len(body)) + body


def body_length(prefix: bytes, limit: int) -> int:
    """Read the length prefix of a message.

    Raises:
        ValueError: The length exceeds the limit.
    """
    (length,) = _PREFIX.unpack(prefix)
    if length > limit:
        raise ValueError(f"a message of {length} bytes is longer than the maximum of {limit}")
    return int(length)
