"""Frames of the Dobot protocol: AA AA, length, id, control, parameters, checksum."""

from __future__ import annotations

from collections.abc import Iterator

_HEAD = 0xAA
_SHORTEST = 2  # id and control


def build(command: int, control: int, parameters: bytes = b"") -> bytes:
    """Return a frame."""
    payload = bytes((command, control)) + parameters
    return bytes((_HEAD, _HEAD, len(payload))) + payload + bytes(((0x100 - sum(payload) % 0x100) % 0x100,))


class FrameBuffer:
    """Finds frames in received bytes; a frame with a wrong checksum is skipped, as by the arm."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def clear(self) -> None:
        """Drop an incomplete frame."""
        self._bytes.clear()

    def feed(self, data: bytes) -> Iterator[tuple[int, int, bytes]]:
        """Return id, control and parameters of each frame completed by `data`."""
        self._bytes += data
        while len(self._bytes) >= 3:
            if self._bytes[0] != _HEAD or self._bytes[1] != _HEAD or self._bytes[2] < _SHORTEST:
                del self._bytes[0]
                continue
            end = 3 + self._bytes[2]
            if len(self._bytes) <= end:
                return
            payload = bytes(self._bytes[3:end])
            if (sum(payload) + self._bytes[end]) % 0x100:
                del self._bytes[0]
                continue
            del self._bytes[: end + 1]
            yield payload[0], payload[1], payload[2:]
