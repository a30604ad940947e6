"""Frames of the Dobot protocol.

A frame is AA AA, the length of the payload, the payload (id, control, parameters), and a checksum that makes the sum of
the payload and itself zero, modulo 256. Numbers are little-endian, in millimetres and degrees. Source: Dobot,
"Communication Protocol", section "Protocol format".
"""

import enum
from typing import Final, NamedTuple

HEADER: Final = b"\xaa\xaa"
WRITE: Final = 0x01
QUEUED: Final = 0x02
LONGEST: Final = 0xFF - 2
"""Maximum size of the parameters, bytes: the length byte counts id and control, too."""


class Command(enum.IntEnum):
    """Ids of the commands in use.

    A write to ALARMS clears all alarms. Source: ClearAllAlarmsState in the vendor's DobotDll (id 20, rw 1). Some
    clients use id 21 instead, which the vendor's list of ids does not contain.
    """

    SERIAL_NUMBER = 0
    NAME = 1
    VERSION = 2
    POSE = 10
    ALARMS = 20
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
    """Content of a frame."""

    command: int
    control: int
    parameters: bytes


def encode(command: int, control: int, parameters: bytes = b"") -> bytes:
    """Return the bytes of a frame. Raise ValueError if the parameters are too long."""
    if len(parameters) > LONGEST:
        raise ValueError(f"A frame has at most {LONGEST} bytes of parameters, not {len(parameters)}.")
    payload = bytes((command, control)) + parameters
    return HEADER + bytes((len(payload),)) + payload + bytes((-sum(payload) & 0xFF,))


class FrameBuffer:
    """Splits received bytes into frames; after garbage it synchronizes at the next complete frame."""

    def __init__(self) -> None:
        self._rest = b""
        self.garbage = 0
        """Number of bytes skipped."""

    def feed(self, data: bytes) -> list[Frame]:
        """Add received bytes and return the frames they complete."""
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
                self.garbage += 1  # the next frame may have started inside of this one
                rest = rest[1:]
                continue
            frames.append(Frame(payload[0], payload[1], payload[2:]))
            rest = rest[4 + len(payload) :]
