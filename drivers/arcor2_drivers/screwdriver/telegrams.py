"""Codec of the telegrams (docs/devices/screwdriver.md). Pure functions.

Source: Atlas Copco, Open Protocol Specification, 9836 4415 01, release 2.8.0; Bosch Rexroth, Nexo cordless Wi-Fi
nutrunner, 3 608 870 A47, section 7.5.
"""

import enum
from collections.abc import Sequence
from typing import Final, NamedTuple

from arcor2_hw.data.device import Identity
from arcor2_hw.messages import translatable

HEADER: Final = 20
"""Length of the header, bytes: length, MID, revision, no-ack flag, station, spindle, sequence number, parts."""
END: Final = b"\0"
"""End of a telegram. The length in the header does not include it."""


class Mid(enum.IntEnum):
    """Message ids in use."""

    START = 1
    START_ACKNOWLEDGE = 2
    STOP = 3
    ERROR = 4
    ACCEPTED = 5
    SELECT_PROGRAM = 18
    SELECT_JOB = 38
    TOOL_DATA_REQUEST = 40
    TOOL_DATA = 41
    DISABLE_TOOL = 42
    ENABLE_TOOL = 43
    SUBSCRIBE_RESULTS = 60
    RESULT = 61
    RESULT_ACKNOWLEDGE = 62
    SUBSCRIBE_ALARMS = 70
    ALARM = 71
    ALARM_ACKNOWLEDGE = 72
    ALARM_CLEARED = 74
    ALARM_CLEARED_ACKNOWLEDGE = 75
    ALARM_STATUS = 76
    ALARM_STATUS_ACKNOWLEDGE = 77
    CLEAR_ALARM = 78
    KEEP_ALIVE = 9999


def title(mid: Mid) -> str:
    """Return a message id for error messages: `MID 0018 (select program)`."""
    return f"MID {mid:04d} ({mid.name.lower().replace('_', ' ')})"


START_REVISIONS: Final = (6, 5, 4, 3, 2, 1)
RESULT_REVISIONS: Final = (2, 1)
ALARM_REVISIONS: Final = (2, 1)
FIRST_LIGHT_REVISION: Final = 900
"""First revision of a result whose layout does not extend that of revision 2."""

TOOL_DATA_REVISIONS: Final = (2, 1)

ALREADY_SUBSCRIBED: Final = (9, 11)
CLIENT_CONNECTED: Final = (16, 96)
UNSUPPORTED: Final = (97, 99)
NO_CONTROL: Final = (35, 92, 95)
ERRORS: Final = translatable(
    {
        1: "invalid data",
        2: "this program does not exist",
        3: "the program cannot be selected now",
        4: "the program is not running",
        16: "the protocol is busy",
        17: "this job does not exist",
        20: "the job cannot be selected now",
        21: "the job is not running",
        27: "the tool is inaccessible",
        28: "a job is being aborted",
        29: "this tool does not exist",
        35: "another master client",
        58: "no alarm is active",
        59: "the tool is in use",
        79: "the command failed",
        92: "an input of the controller, which disables commands of Open Protocol,",
        95: "the manual mode",
        96: "another client is connected",
        97: "it does not support this revision of the message",
        98: "an internal request timed out",
        99: "it does not support this message",
        101: "a tightening is in progress",
    }
)
"""Texts of the error codes of MID 0004 that a request of this driver can cause."""

VENDORS: Final = {"ACT": "Atlas Copco", "BRC": "Bosch Rexroth"}


class Telegram(NamedTuple):
    """A telegram: message id, revision (1 or more) and data field."""

    mid: int
    revision: int
    data: bytes = b""


def encode(mid: int, data: bytes = b"", revision: int = 1) -> bytes:
    """Return a telegram with its end. The no-ack flag is 0; station, spindle and sequence number are not used."""
    return f"{HEADER + len(data):04d}{mid:04d}{revision:03d}0        ".encode("ascii") + data + END


class TelegramBuffer:
    """Splits a stream into telegrams by the lengths in their headers, because data fields may contain NUL."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[Telegram]:
        """Return the telegrams that `data` completes. Raises ValueError when the stream is not Open Protocol."""
        self._rest += data
        found = []
        while len(self._rest) >= HEADER:
            length = _number(self._rest[:4], "length")
            if length < HEADER:
                raise ValueError(f"length {length} is less than that of a header")
            if len(self._rest) <= length:
                break
            raw, self._rest = self._rest[:length], self._rest[length:]
            if not self._rest.startswith(END):
                raise ValueError(f"no NUL after a telegram of length {length}")
            self._rest = self._rest[1:]
            found.append(Telegram(_number(raw[4:8], "MID"), _number(raw[8:11], "revision") or 1, raw[HEADER:]))
        return found


def _number(raw: bytes, name: str) -> int:
    """Parse a decimal number with an optional sign. Blanks count as 0."""
    text = raw.strip()
    if text and not text.removeprefix(b"-").isdigit():
        raise ValueError(f"{name} is {raw!r}")
    return int(text or b"0")


def fields(data: bytes, lengths: Sequence[int], more: bool = False) -> list[bytes]:
    """Return the values of numbered fields: each starts with its number, in two digits, from 01 on.

    Args:
        data: Data field of a telegram.
        lengths: Lengths of the values, bytes.
        more: Whether further data may follow.

    Raises:
        ValueError: A number or the length is wrong.
    """
    values, place = [], 0
    for number, length in enumerate(lengths, 1):
        if (found := data[place : place + 2]) != b"%02d" % number:
            raise ValueError(f"field {number:02d} starts with {found!r}")
        values.append(data[place + 2 : place + 2 + length])
        place += 2 + length
    if len(data) < place or (len(data) > place and not more):
        raise ValueError(f"the data field has {len(data)} bytes instead of {place}")
    return values


# ------------------------------------------------------------------------------------------------ answers
def rejected(telegram: Telegram) -> tuple[int, int]:
    """Return the rejected MID and the error code of MID 0004. Raises ValueError."""
    return _number(telegram.data[:4], "rejected MID"), _number(telegram.data[4:], "error code")


def accepted(telegram: Telegram) -> int:
    """Return the MID that MID 0005 accepts. Raises ValueError."""
    return _number(telegram.data[:4], "accepted MID")


_START: Final = (4, 2, 25, 3, 19, 19, 19, 24, 10)
_START_FIELDS: Final = {1: 3, 2: 4, 3: 7}  # revision: number of fields; all of them from revision 4 on


def identity(telegram: Telegram) -> Identity:
    """Return vendor, model, serial and firmware from MID 0002; those of higher revisions are empty. Raises ValueError.

    The fields are cell, channel, name (1), supplier (2), versions of protocol, controller and tool (3), type of the
    memory module, and serial number (4), with the revision that adds them in brackets.
    """
    lengths = _START[: _START_FIELDS.get(telegram.revision, len(_START))]
    _, _, name, *rest = (_text(each) for each in fields(telegram.data, lengths, more=telegram.revision > 4))
    supplier, _, firmware, _, _, serial = [*rest, *[""] * (6 - len(rest))]
    return Identity(VENDORS.get(supplier, supplier), name, serial, firmware)


_TOOL: Final = (14, 10, 19, 10, 6, 19, 10)
_TOOL_FIELDS: Final = {1: 4}


def tool_counters(telegram: Telegram) -> dict[str, int]:
    """Return the tightenings of the tool from MID 0041, and from revision 2 on those since its service.

    The fields are serial number of the tool, tightenings, last calibration, serial number of the controller (1);
    calibration value, last service, tightenings since then (2). Raises ValueError.
    """
    values = fields(telegram.data, _TOOL[: _TOOL_FIELDS.get(telegram.revision, len(_TOOL))], more=True)
    found = {translatable("tightenings"): _number(values[1], "number of tightenings")}
    if len(values) == len(_TOOL):
        found[translatable("tightenings since service")] = _number(values[6], "tightenings since the service")
    return found


# ------------------------------------------------------------------------------------------------ results
class Result(NamedTuple):
    """The result of one tightening; torque in N m."""

    tightening_id: int
    program: int
    job: int
    ok: bool
    torque: float
    angle_degrees: float
    stamp: str
    """Time by the clock of the controller."""


class _Layout(NamedTuple):
    """Lengths of the fields of MID 0061, and the numbers of those in use."""

    lengths: tuple[int, ...]
    job: int
    program: int
    ok: int
    torque: int
    angle: int
    stamp: int
    tightening_id: int


_FIRST: Final = _Layout((4, 2, 25, 25, 2, 3, 4, 4, 1, 1, 1, *[6] * 4, *[5] * 4, 19, 19, 1, 10), 5, 6, 9, 15, 19, 20, 23)
_SECOND: Final = _Layout(
    (4, 2, 25, 25, 4, 3, 2, 5, 4, 4, *[1] * 9, 10, *[6] * 4, *[5] * 7, *[3] * 3, *[6] * 6, 10, 5, 5, 14, 19, 19),
    *(5, 6, 11, 24, 28, 45, 41),
)


def result(telegram: Telegram) -> Result:
    """Return the result in MID 0061. Revisions above 2 add fields at its end. Raises ValueError."""
    if telegram.revision >= FIRST_LIGHT_REVISION:
        raise ValueError(f"revision {telegram.revision} of MID 0061 is not supported")
    layout = _FIRST if telegram.revision == 1 else _SECOND
    values = fields(telegram.data, layout.lengths, more=telegram.revision > 2)

    def number(field: int) -> int:
        return _number(values[field - 1], f"field {field:02d}")

    return Result(
        tightening_id=number(layout.tightening_id),
        program=number(layout.program),
        job=number(layout.job),
        ok=number(layout.ok) == 1,
        torque=number(layout.torque) / 100.0,
        angle_degrees=float(number(layout.angle)),
        stamp=_text(values[layout.stamp - 1]),
    )


# ------------------------------------------------------------------------------------------------ alarms
class AlarmReport(NamedTuple):
    """An alarm of the controller; the text is empty where the controller sends none."""

    code: str
    ready: bool
    """Whether controller and tool are ready nevertheless."""
    text: str = ""


def alarm(telegram: Telegram) -> AlarmReport | None:
    """Return the alarm in MID 0071 or MID 0076, None when MID 0076 reports that there is none. Raises ValueError."""
    later = telegram.revision > 1
    lengths = [5 if later else 4, 1, 1, 19]
    if telegram.mid == Mid.ALARM_STATUS:
        lengths.insert(0, 1)
    elif later:
        lengths.append(50)
    values = fields(telegram.data, lengths, more=telegram.revision > 2)
    if telegram.mid == Mid.ALARM_STATUS and values.pop(0) != b"1":
        return None
    code, controller, tool, _, *text = (_text(value) for value in values)
    return AlarmReport(code, controller == tool == "1", text[0] if text else "")


def cleared(telegram: Telegram) -> str:
    """Return the code of the alarm in MID 0074."""
    return _text(telegram.data)


def _text(raw: bytes) -> str:
    return "".join(sign for sign in raw.decode("latin-1") if sign.isprintable()).strip()
