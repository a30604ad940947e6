"""Frames: splitting a recorded stream into a driver's frames, and recognizing those that act on the device."""

import re
import struct
from collections.abc import Sequence
from typing import Final, Protocol

from arcor2_hw.exceptions import InvalidData


class Frames(Protocol):
    """Reader of a protocol in the direction from the driver to the device."""

    def split(self, stream: bytes) -> list[bytes]:
        """Return the frames of a stream; the last one may be incomplete or invalid."""
        ...

    def acting(self, frame: bytes) -> str:
        """Return the effect of a frame on the device, empty when it only reads."""
        ...


WRITES: Final = {
    5: "write single coil",
    6: "write single register",
    15: "write multiple coils",
    16: "write multiple registers",
    22: "mask write register",
    23: "read/write multiple registers",
}
"""Modbus functions that write (MODBUS Application Protocol Specification V1.1b3, section 6)."""


class ModbusTcp:
    """Modbus TCP: a header of transaction, protocol 0, length, unit; then the function (MBAP)."""

    def split(self, stream: bytes) -> list[bytes]:
        """Split by the length in the header."""
        frames = []
        while len(stream) >= 8 and len(stream) >= (end := 6 + struct.unpack_from(">H", stream, 4)[0]) >= 8:
            frames.append(stream[:end])
            stream = stream[end:]
        return [*frames, stream] if stream else frames

    def acting(self, frame: bytes) -> str:
        """Name the functions that write; an invalid frame counts as acting, because its effect is unknown."""
        if len(frame) < 8 or frame[2:4] != b"\0\0":
            return f"invalid Modbus TCP frame: {frame.hex(' ')}"
        return _modbus(frame[7], frame[8:])


class ModbusRtu:
    """Modbus RTU: unit, function, data, CRC; requests are split by the lengths of their functions."""

    _LENGTHS: Final = {1: 8, 2: 8, 3: 8, 4: 8, 5: 8, 6: 8, 7: 4, 8: 8, 11: 4, 12: 4, 17: 4, 22: 10, 43: 7}
    _COUNTED: Final = {15: 6, 16: 6, 23: 10}  # position of the byte count

    def _length(self, stream: bytes) -> int:
        function = stream[1] if len(stream) > 1 else 0
        if function in self._LENGTHS:
            return self._LENGTHS[function]
        place = self._COUNTED.get(function)
        return 0 if place is None or len(stream) <= place else place + 1 + stream[place] + 2

    def split(self, stream: bytes) -> list[bytes]:
        """Split by the lengths of the requests."""
        frames = []
        while 0 < (end := self._length(stream)) <= len(stream):
            frames.append(stream[:end])
            stream = stream[end:]
        return [*frames, stream] if stream else frames

    def acting(self, frame: bytes) -> str:
        """Name the functions that write; an invalid frame counts as acting."""
        if len(frame) != self._length(frame):
            return f"invalid Modbus RTU frame: {frame.hex(' ')}"
        return _modbus(frame[1], frame[2:])


def _modbus(function: int, data: bytes) -> str:
    if function not in WRITES:
        return ""
    place = 4 if function == 23 else 0
    register = struct.unpack_from(">H", data, place)[0] if len(data) >= place + 2 else -1
    return f"function {function} ({WRITES[function]}) at {register}"


class Lines:
    """Lines of text ended by CR, LF or both; those that start with a declared word act, or are a word with $."""

    def __init__(self, words: Sequence[str]) -> None:
        self._words = tuple(word.encode() for word in words if not word.endswith("$"))
        self._whole = frozenset(word.removesuffix("$").encode() for word in words if word.endswith("$"))

    def split(self, stream: bytes) -> list[bytes]:
        """Split by the ends of the lines."""
        return [line for line in re.split(rb"[\r\n]+", stream) if line]

    def acting(self, frame: bytes) -> str:
        """Return the line when it acts."""
        acts = frame.strip() in self._whole or frame.lstrip().startswith(self._words)
        return frame.decode(errors="replace") if acts else ""


class CanopenSlcan:
    """CANopen in slcan lines: NMT, process data and SDO downloads act, except downloads to declared objects."""

    def __init__(self, declared: Sequence[str] = ()) -> None:
        self._declared = {int(each, 16) for each in declared}

    def split(self, stream: bytes) -> list[bytes]:
        """Split by CR."""
        return [line for line in stream.split(b"\r") if line]

    def acting(self, frame: bytes) -> str:
        """Return what a frame with an 11-bit identifier does (CiA 301); other lines are for the adapter."""
        if not re.fullmatch(rb"t[0-7][0-9A-Fa-f]{2}[0-8]([0-9A-Fa-f]{2})*", frame):
            return ""
        cob, data = int(frame[1:4], 16), bytes.fromhex(frame[5:].decode())
        if cob == 0:
            return f"NMT {data.hex(' ')}"
        if cob & 0x780 in (0x200, 0x300, 0x400, 0x500):
            return f"process data {cob:03x}h"
        if cob & 0x780 == 0x600 and len(data) == 8 and data[0] >> 5 in (0, 1, 6):
            index = data[1] | data[2] << 8
            if data[0] >> 5 == 0 or index not in self._declared:  # a segment does not name its object
                return f"SDO download to {index:04x}h"
        return ""


class Rtde:
    """The ports of a UR controller: RTDE frames, and lines of the dashboard server, scripts and programs.

    In RTDE, setting up inputs (I) reserves registers, and data (U) writes them; the other messages set up and start
    outputs. Source: Universal Robots, "Real-Time Data Exchange (RTDE) Guide".
    """

    _READING: Final = b"VvOSPM"

    def __init__(self, declared: Sequence[str] = ()) -> None:
        self._declared = {each.encode() for each in declared}

    def split(self, stream: bytes) -> list[bytes]:
        """Split a connection into RTDE frames, if it starts with one, otherwise into lines."""
        if stream[:1] != b"\0":
            return [line for line in re.split(rb"[\r\n]+", stream) if line]
        frames = []
        while len(stream) >= 3 and len(stream) >= (end := struct.unpack_from(">H", stream)[0]) >= 3:
            frames.append(stream[:end])
            stream = stream[end:]
        return [*frames, stream] if stream else frames

    def acting(self, frame: bytes) -> str:
        """Return the kind of an RTDE frame that acts, or a line that is not declared to read."""
        if len(frame) >= 3 and struct.unpack_from(">H", frame)[0] == len(frame):
            return "" if frame[2] in self._READING else f"RTDE message {chr(frame[2])}"
        return "" if frame.strip() in self._declared else frame.decode(errors="replace")[:80]


KINDS: Final = ("modbus-tcp", "modbus-rtu", "lines", "canopen-slcan", "rtde")
"""Values of `frames` in quality.yaml."""


def reader(kind: str, words: Sequence[str]) -> Frames:
    """Return the reader of a protocol.

    Args:
        kind: Name of the protocol.
        words: First words of lines that act, objects that may be written, or commands that only read.

    Raises:
        InvalidData: The protocol is unknown.
    """
    if kind == "modbus-tcp":
        return ModbusTcp()
    if kind == "modbus-rtu":
        return ModbusRtu()
    if kind == "lines":
        return Lines(words)
    if kind == "canopen-slcan":
        return CanopenSlcan(words)
    if kind == "rtde":
        return Rtde(words)
    raise InvalidData(
        "frames of the kind {type} are not supported. Available: {kinds}", type=kind, kinds=", ".join(KINDS)
    )
