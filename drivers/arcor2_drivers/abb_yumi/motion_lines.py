"""Protocol of the RAPID motion server (rapid/README.md): codes, statuses, encoding and decoding of lines."""

import enum
import math
from collections.abc import Iterable
from typing import Final, NamedTuple

from arcor2_hw.exceptions import DeviceFault
from arcor2_hw.messages import translatable

VERSION: Final = 1
MAX_LINE_LENGTH: Final = 79
"""Maximum number of characters before the line feed: a RAPID string holds 80."""
MAX_SEQUENCE: Final = 9999
MAX_WAYPOINTS: Final = 50


class Code(enum.IntEnum):
    """Code of a command."""

    HELLO = 1
    BEGIN = 2
    END = 3
    SPEED = 4
    ZONE = 5
    TOOL = 6
    LOAD = 7
    JOINTS = 10
    POSITION = 11
    ORIENTATION = 12
    STAGE_JOINTS = 20
    STAGE_POSITION = 21
    STAGE_ORIENTATION = 22
    CLEAR_PATH = 23
    APPEND = 24
    MOVE_JOINTS = 30
    MOVE_LINEAR = 31
    MOVE_POSE = 32
    RUN_PATH = 33
    MOVE_TOGETHER = 34
    INVERSE = 40
    FORWARD_POSITION = 41
    FORWARD_ORIENTATION = 42
    HAND_CALIBRATE = 50
    HAND_GRIP = 51
    HAND_MOVE = 52
    HAND_STATE = 53
    HAND_VACUUM = 54
    HAND_BLOW = 55
    KEEP_ALIVE = 90
    STOP = 91


class Status(enum.IntEnum):
    """Status of an answer."""

    DONE = 0
    ACCEPTED = 1
    STOPPED = 2
    WATCHDOG = 3
    BAD_CHECK = 10
    BAD_CODE = 11
    BAD_COUNT = 12
    BAD_VALUE = 13
    UNREACHABLE = 14
    NO_SESSION = 15
    BY_HAND = 16
    NO_PARTNER = 20
    RAPID_ERROR = 30


MEANING: Final = translatable(
    {
        Status.STOPPED: "stopped",
        Status.WATCHDOG: "stopped by its watchdog: this computer was too slow",
        Status.BAD_CHECK: "the checksum of the line was wrong",
        Status.BAD_CODE: "the RAPID modules do not know the code",
        Status.BAD_COUNT: "the number of arguments was wrong",
        Status.BAD_VALUE: "a value was refused",
        Status.UNREACHABLE: "the target cannot be reached",
        Status.NO_SESSION: "no session was started, or its watchdog ended it",
        Status.BY_HAND: "the arm is being moved by hand",
        Status.NO_PARTNER: "the other arm did not join the synchronized motion",
        Status.RAPID_ERROR: "a RAPID error",
    }
)


class Answer(NamedTuple):
    """An answer of the server."""

    sequence: int
    code: int
    status: int
    values: tuple[float, ...]


def check(text: str) -> int:
    """Return the checksum: the sum of position (from 1) times character code, modulo 997."""
    return sum(place * ord(sign) for place, sign in enumerate(text, 1)) % 997


QUATERNIONS: Final = {Code.TOOL: 3, Code.STAGE_ORIENTATION: 0}
"""First argument that is part of a quaternion, with six decimals; other arguments have three."""


def number(value: float, decimals: int = 3) -> str:
    """Format a number without trailing zeros. Raise ValueError unless it is finite."""
    if not math.isfinite(value):
        raise ValueError("The numbers of a command must be finite.")
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def line(sequence: int, code: Code, values: Iterable[float] = ()) -> bytes:
    """Return the line of a command. Raise ValueError if it is too long, or a number is not finite."""
    first = QUATERNIONS.get(code, MAX_LINE_LENGTH)
    numbers = (number(value, 6 if place >= first else 3) for place, value in enumerate(values))
    text = " ".join([str(sequence), str(int(code)), *numbers])
    out = f"{text}*{check(text)}"
    if len(out) > MAX_LINE_LENGTH:
        raise ValueError(f"The line has {len(out)} characters; at most {MAX_LINE_LENGTH} are allowed: {out}")
    return f"{out}\n".encode()


def answer(raw: bytes) -> Answer:
    """Decode a line. Raise DeviceFault for a garbled one."""
    try:
        text, star, given = raw.decode("ascii").rstrip("\r").rpartition("*")
        if not star or int(given) != check(text):
            raise ValueError
        sequence, code, status, *values = text.split(" ")
        return Answer(int(sequence), int(code), int(status), tuple(map(float, values)))
    except ValueError:  # UnicodeDecodeError is a ValueError
        raise DeviceFault("A line of the motion server is garbled.", repr(raw[:100]), "garbled") from None
