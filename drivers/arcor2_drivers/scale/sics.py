"""Parser of MT-SICS answers (docs/devices/scale.md). Pure functions."""

import dataclasses
import re
from decimal import Decimal
from typing import Final

KILOGRAMS: Final = {"kg": Decimal(1), "g": Decimal("1e-3"), "mg": Decimal("1e-6")}
ERRORS: Final = {"ES": "does not know the command", "ET": "received a damaged command", "EL": "refuses its parameter"}
MAX_LINE: Final = 80
_VALUE: Final = re.compile(r"-?\d{1,9}(\.\d{1,6})?")
PARAMETERS: Final = {
    "M01": "weighing mode (M01)",
    "M02": "environment (M02)",
    "M03": "automatic zero (M03)",
    "M31": "mode after restart (M31)",
    "M35": "zeroing at restart (M35)",
}
"""Settings by the command of level 2 that reads and writes them. A scale keeps them when it is switched off."""
_PARAMETER: Final = re.compile(r"(M\d\d) A (\d{1,3})")
_TEXT: Final = re.compile(r'(I[0-4]) A "([^"]*)"')


@dataclasses.dataclass(frozen=True)
class Answer:
    """A line: the answered command (or ES, ET, EL), its mark, and optionally a value in kg or a text.

    mark: S stable, D dynamic, A done, I not executable now, L wrong parameter, + above and - below the range. unit: as
    sent. number: value of a setting.
    """

    command: str
    mark: str = ""
    value: float | None = None
    unit: str = ""
    text: str = ""
    number: int | None = None


def answers(data: bytes) -> list[Answer]:
    """Return the valid lines among those that are complete, in order."""
    lines = (raw.decode("ascii", "replace") for raw in data.split(b"\r\n")[:-1] if len(raw) <= MAX_LINE)
    return [found for line in lines if (found := answer(line)) is not None]


def answer(line: str) -> Answer | None:
    """Parse one line without its CR LF; None when it is invalid. The value field may be padded."""
    if line in ERRORS:
        return Answer(line)
    if match := _TEXT.fullmatch(line):
        return Answer(match[1], "A", text=match[2])
    if match := _PARAMETER.fullmatch(line):
        return Answer(match[1], "A", number=int(match[2]))
    parts = line.split()
    if (
        len(parts) == 2
        and parts[0] in ("S", "T", "Z", "TA", "ZI", "TI", *PARAMETERS)
        and parts[1] in ("A", "I", "+", "-", "L")
    ):
        return Answer(parts[0], parts[1])
    if len(parts) == 4 and parts[0] in ("S", "T", "TI", "TA") and parts[1] in ("S", "D", "A"):
        if not _VALUE.fullmatch(parts[2]) or not parts[3].isalpha():
            return None
        factor = KILOGRAMS.get(parts[3])
        value = None if factor is None else float(Decimal(parts[2]) * factor)
        return Answer(parts[0], parts[1], value, parts[3])
    return None
