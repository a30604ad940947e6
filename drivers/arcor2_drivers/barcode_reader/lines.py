"""Parser of the reader's lines (docs/devices/barcode-reader.md). Pure functions."""

import dataclasses
from typing import Final

from arcor2_hw.data.device import Health, Identity

MAX_LINE: Final = 512
"""Longest line, bytes: a code has at most 128; a longer line is noise."""
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
    """Splits bytes into lines, which end in CR; LF after it and a frame of STX and ETX are optional."""

    def __init__(self) -> None:
        self._rest = b""
        self._skipping = False
        self.garbage = 0
        """Number of lines dropped: too long, or with bytes that no answer contains."""

    def feed(self, data: bytes) -> list[str]:
        """Return the lines that `data` completes."""
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
    """Return the text of a line without its frame, None when it is invalid."""
    raw = raw.lstrip(LF)
    if raw.startswith(STX) and raw.endswith(ETX):
        raw = raw[1:-1]
    if len(raw) > MAX_LINE or any(not 0x20 <= byte <= 0x7E for byte in raw):
        return None
    return raw.decode("ascii")


def is_code(line: str) -> bool:
    """Return whether a line is a code and not a word of the protocol."""
    if not 1 <= len(line) <= MAX_CODE or line in (NO_CODE, TRIGGER, STOP, RESET, STATUS, IDENTIFY):
        return False
    return line.split(",", 1)[0] not in ("OK", "ERR", "STAT", "VER") or "," not in line


def refused(line: str, command: str) -> bool:
    """Return whether a line reports an unknown command."""
    return line == f"ERR,{command},00"


@dataclasses.dataclass(frozen=True)
class Status:
    """The answer to STAT."""

    ready: bool
    health: Health
    word: str


def status(line: str) -> Status | None:
    """Parse `STAT,<ready>,<health>`; None for another line."""
    parts = line.split(",")
    if len(parts) != 3 or parts[0] != STATUS or parts[1] not in ("0", "1") or parts[2] not in HEALTH:
        return None
    return Status(parts[1] == "1", HEALTH[parts[2]], parts[2])


def identity(line: str) -> Identity | None:
    """Parse `VER,<vendor>,<model>,<serial>,<firmware>`; None for another line."""
    parts = line.split(",")
    if len(parts) != 5 or parts[0] != IDENTIFY:
        return None
    return Identity(*parts[1:])
