"""Frames of the Dobot protocol: bytes in, messages out. Pure; the vendor's communication protocol, "Protocol format".

AA AA, length of the payload, then the payload (id, control, parameters), then the checksum: what makes the sum of the
payload's bytes zero, modulo 256. Numbers are little-endian; millimetres, degrees.
"""

import enum
from typing import Final, NamedTuple

HEADER: Final = b"\xaa\xaa"
WRITE: Final = 0x01
QUEUED: Final = 0x02
LONGEST: Final = 0xFF - 2
"""Bytes of parameters: the length byte counts id and control too."""


class Command(enum.IntEnum):
    """Ids as far as they are used here."""

    SERIAL_NUMBER = 0
    NAME = 1
    VERSION = 2
    POSE = 10
    ALARMS = 20
    CLEAR_ALARMS = 21
    HOME = 31
    END_EFFECTOR = 60
    SUCTION_CUP = 62
    GRIPPER = 63
    PTP_JOINT = 80
    PTP_COORDINATE = 81
    PTP_JUMP = 82
    PTP_COMMON = 83
    PTP = 84
    STEPPER = 135
    QUEUE_START = 240
    QUEUE_FORCE_STOP = 242
    QUEUE_CLEAR = 245
    QUEUE_INDEX = 246


class Frame(NamedTuple):
    """What one frame carries."""

    command: int
    control: int
    parameters: bytes


def encode(command: int, control: int, parameters: bytes = b"") -> bytes:
    """Give the bytes of a frame. Raises ValueError when the parameters are too long for one."""
    if len(parameters) > LONGEST:
        raise ValueError(f"a frame has at most {LONGEST} bytes of parameters, not {len(parameters)}")
    payload = bytes((command, control)) + parameters
    return HEADER + bytes((len(payload),)) + payload + bytes((-sum(payload) & 0xFF,))


class FrameBuffer:
    """Cuts frames out of what comes; after bytes that are none it comes into step at the next whole frame."""

    def __init__(self) -> None:
        self._rest = b""
        self.garbage = 0
        """Bytes passed over."""

    def feed(self, data: bytes) -> list[Frame]:
        """Give the frames completed by `data`."""
        frames: list[Frame] = []
        rest = self._rest + data
        while True:
            start = rest.find(HEADER)
            if start < 0:
                keep = 1 if rest.endswith(HEADER[:1]) else 0
                self.garbage += len(rest) - keep
                self._rest = rest[len(rest) - keep :]
                return frames
            self.garbage += start
            rest = rest[start:]
            if len(rest) < 3 or (rest[2] >= 2 and len(rest) < rest[2] + 4):
                self._rest = rest
                return frames
            payload = rest[3 : 3 + rest[2]]
            if rest[2] < 2 or (sum(payload) + rest[3 + rest[2]]) & 0xFF:
                self.garbage += 1  # the next frame may have begun inside of what looked like this one
                rest = rest[1:]
                continue
            frames.append(Frame(payload[0], payload[1], payload[2:]))
            rest = rest[4 + len(payload) :]
