"""Packets of Dynamixel protocol 2.0: header, stuffing, CRC."""

from collections.abc import Iterator
from typing import Final, NamedTuple

HEADER: Final = b"\xff\xff\xfd\x00"
STUFFED: Final = b"\xff\xff\xfd"
BROADCAST: Final = 0xFE
STATUS: Final = 0x55
LONGEST: Final = 1024
_SHORTEST: Final = 3  # instruction and CRC


def _table() -> tuple[int, ...]:
    entries = []
    for byte in range(256):
        value = byte << 8
        for _ in range(8):
            value = (value << 1) ^ 0x8005 if value & 0x8000 else value << 1
        entries.append(value & 0xFFFF)
    return tuple(entries)


_TABLE = _table()


def crc16(data: bytes) -> int:
    """Return the checksum: polynomial 8005h, initial value 0, not reflected."""
    value = 0
    for byte in data:
        value = ((value << 8) & 0xFFFF) ^ _TABLE[(value >> 8) ^ byte]
    return value


class Instruction(NamedTuple):
    """A decoded instruction packet."""

    servo: int
    code: int
    parameters: bytes


class BadCrc(NamedTuple):
    """A packet with a wrong checksum, addressed to a servo."""

    servo: int


def packet(servo: int, code: int, parameters: bytes) -> bytes:
    """Return a packet with stuffing and checksum."""
    body = (bytes([code]) + parameters).replace(STUFFED, STUFFED + b"\xfd")
    head = HEADER + bytes([servo]) + (len(body) + 2).to_bytes(2, "little")
    return head + body + crc16(head + body).to_bytes(2, "little")


def status(servo: int, error: int, parameters: bytes = b"") -> bytes:
    """Return a status packet."""
    return packet(servo, STATUS, bytes([error]) + parameters)


class Receiver:
    """Finds packets in a stream of bytes, and drops garbage."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def clear(self) -> None:
        """Drop the bytes received so far."""
        self._buffer.clear()

    def feed(self, data: bytes) -> Iterator[Instruction | BadCrc]:
        """Return the packets completed by `data`."""
        self._buffer += data
        while True:
            start = self._buffer.find(HEADER)
            if start < 0:
                del self._buffer[: -len(HEADER) + 1]
                return
            del self._buffer[:start]
            if len(self._buffer) < 7:
                return
            length = int.from_bytes(self._buffer[5:7], "little")
            if not _SHORTEST <= length <= LONGEST:
                del self._buffer[:1]
                continue
            if len(self._buffer) < 7 + length:
                return
            frame = bytes(self._buffer[: 7 + length])
            del self._buffer[: 7 + length]
            if crc16(frame[:-2]) != int.from_bytes(frame[-2:], "little"):
                yield BadCrc(frame[4])
            elif frame[7] != STATUS:
                body = frame[7:-2].replace(STUFFED + b"\xfd", STUFFED)
                yield Instruction(frame[4], body[0], body[1:])
