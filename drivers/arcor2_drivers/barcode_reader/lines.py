"""The reader's lines: bytes in, what they mean out. Pure; docs/devices/barcode-reader.md is the source."""

import dataclasses
from typing import Final

from arcor2_hw.data.device import Health, Identity

MAX_LINE: Final = 512
"""Bytes: a code has 128 at most, an identification hardly more; what is longer is noise."""
MAX_CODE: Final = 128
STX, ETX, CR, LF = b"\x02", b"\x03", b"\r", b"\n"

TRIGGER: Final = "LON"
STOP: Final = "LOFF"
RESET: Final = "RST"
STATUS: Final = "STAT"
IDENTIFY: Final = "VER"
RESET_DONE: Final = "OK,RST"
NO_CODE: Final = "ERROR"

HEALTH: Final = {
    "OK": Health.NORMAL,
    "DIRTY": Health.MAINTENANCE_REQUIRED,
    "HOT": Health.OFF_SPEC,
    "FAIL": Health.FAILURE,
}


class LineBuffer:
    """Cuts lines out of what comes: ended by CR, with LF behind or not, framed by STX and ETX or not."""

    def __init__(self) -> None:
        self._rest = b""
        self._skipping = False
        self.garbage = 0
        """Lines dropped: too long, or with bytes that no answer has."""

    def feed(self, data: bytes) -> list[str]:
        """Give the lines completed by `data`."""
        *complete, self._rest = (self._rest + data).split(CR)
        lines = []
        for raw in complete:
            if self._skipping:
                self._skipping = False
                continue
            text = _text(raw)
            if text is None:
                self.garbage += 1
            elif text:
                lines.append(text)
        if len(self._rest) > MAX_LINE:
            self._rest = b""
            if not self._skipping:
                self.garbage += 1
            self._skipping = True
        return lines


def _text(raw: bytes) -> str | None:
    """Give the text of a line without its framing, None when it is none."""
    raw = raw.lstrip(LF)
    if raw.startswith(STX) and raw.endswith(ETX):
        raw = raw[1:-1]
    if len(raw) > MAX_LINE or any(not 0x20 <= byte <= 0x7E for byte in raw):
        return None
    return raw.decode("ascii")


def is_code(line: str) -> bool:
    """Tell whether a line is a code, not one of the reader's words."""
    if not 1 <= len(line) <= MAX_CODE or line in (NO_CODE, TRIGGER, STOP, RESET, STATUS, IDENTIFY):
        return False
    return line.split(",", 1)[0] not in ("OK", "ERR", "STAT", "VER") or "," not in line


def refused(line: str, command: str) -> bool:
    """Tell whether a line says that the reader does not know a command."""
    return line == f"ERR,{command},00"


@dataclasses.dataclass(frozen=True)
class Status:
    """What STAT answers."""

    ready: bool
    health: Health
    word: str


def status(line: str) -> Status | None:
    """Read `STAT,<ready>,<health>`; None when the line is none."""
    parts = line.split(",")
    if len(parts) != 3 or parts[0] != STATUS or parts[1] not in ("0", "1") or parts[2] not in HEALTH:
        return None
    return Status(parts[1] == "1", HEALTH[parts[2]], parts[2])


def identity(line: str) -> Identity | None:
    """Read `VER,<vendor>,<model>,<serial>,<firmware>`; None when the line is none."""
    parts = line.split(",")
    if len(parts) != 5 or parts[0] != IDENTIFY:
        return None
    return Identity(*parts[1:])
