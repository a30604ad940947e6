"""Telegrams of Open Protocol from the controller's side: a header of 20 bytes, a data field, and NUL."""

from __future__ import annotations

import msgspec

_HEADER = 20
_POSITION = {"length": slice(0, 4), "mid": slice(4, 8), "revision": slice(8, 11), "no_ack": slice(11, 12)}


class BadHeader(ValueError):
    """The stream does not continue with a telegram."""


class Message(msgspec.Struct, frozen=True):
    """A received telegram."""

    mid: int
    revision: int
    no_ack: bool
    data: bytes


def _digits(header: bytes | bytearray, name: str) -> int:
    text = header[_POSITION[name]].decode("ascii", "replace").strip(" ")
    if not text:
        return 0
    if not (text.isascii() and text.isdecimal()):
        raise BadHeader(f"{name} is {text!r}")
    return int(text)


def take(stream: bytearray) -> Message | None:
    """Remove the first telegram from `stream` and return it; None while it is incomplete.

    Raises:
        BadHeader: The header is invalid, or NUL does not follow the telegram.
    """
    if len(stream) < _HEADER:
        return None
    length = _digits(stream, "length")
    if length < _HEADER:
        raise BadHeader(f"length {length}")
    if len(stream) < length + 1:
        return None
    if stream[length] != 0:
        raise BadHeader("no NUL")
    telegram = bytes(stream[:length])
    del stream[: length + 1]
    revision = max(1, _digits(telegram, "revision"))
    return Message(_digits(telegram, "mid"), revision, _digits(telegram, "no_ack") == 1, telegram[_HEADER:])


def build(mid: int, data: bytes | str = b"", revision: int = 1) -> bytes:
    """Return the bytes of a telegram. Station, spindle, sequence number and parts are blank."""
    body = data.encode("latin-1") if isinstance(data, str) else data
    header = f"{_HEADER + len(body):04d}{mid:04d}{revision:03d}"
    return header.encode().ljust(_HEADER) + body + b"\x00"


def numbered(*values: str | bytes) -> bytes:
    """Return a data field whose values follow their numbers, 01 and so on."""
    parts = []
    for number, value in enumerate(values, start=1):
        parts += [b"%02d" % number, value.encode("latin-1") if isinstance(value, str) else value]
    return b"".join(parts)
