"""Recognition of units in docstrings.

A unit may be in brackets (`speed [m/s]`), after a comma at the end of a clause (`speed, m/s`), at the beginning
(`seconds to wait`, `m/s, negative backwards`), or alone (`kg`). Only known units are recognized.
"""

import re
from typing import Final

_BASE: Final = (
    r"(?:[kcmµun]?m|[mµun]?s|min|h|m?rad|deg|°C?|[mk]?N|Nm|[km]?g|[hkM]?Pa|m?bar|[mk]?V|m?A|[mk]?W|J"
    r"|[kM]?Hz|K|%|px|m?l|lx|dB|rpm)"
)
_POWER: Final = r"(?:[²³]|\^-?\d)?"
_ONE: Final = rf"{_BASE}{_POWER}"
_UNIT: Final = rf"(?:1/)?{_ONE}(?:[ ·*/]{_ONE})*"
_IN_BRACKETS: Final = re.compile(rf"(?:^|\s)[\[(]({_UNIT})[\])]")
_ALONE: Final = re.compile(_UNIT)
_AT_THE_END: Final = re.compile(rf",\s+({_UNIT})$")
_COMPOUND_FIRST: Final = re.compile(rf"({_ONE}(?:/{_ONE})+)(?=[,;:]|$)")
_SYMBOL_FIRST: Final = re.compile(r"(m|mm|s|ms|rad|deg|kg|g)(?=,\s|\s(?:above|below|between|from|of|until)\s)")
_CLAUSES: Final = re.compile(r"[;:]\s|\.(?:\s|$)|\n")
_FIRST_WORD: Final = re.compile(r"\w+")
_WORDS: Final = {
    "amperes": "A",
    "bar": "bar",
    "degrees": "deg",
    "hertz": "Hz",
    "kilograms": "kg",
    "metres": "m",
    "millimetres": "mm",
    "milliseconds": "ms",
    "minutes": "min",
    "mm": "mm",
    "ms": "ms",
    "newtons": "N",
    "pascals": "Pa",
    "percent": "%",
    "pixels": "px",
    "radians": "rad",
    "seconds": "s",
    "volts": "V",
    "watts": "W",
}


def unit_in(description: str) -> str | None:
    """Return the unit in a description, or None if there is none."""
    text = description.strip()
    if (found := _IN_BRACKETS.search(text)) is not None:
        return found[1]
    clauses = [clause.strip() for clause in _CLAUSES.split(text)]
    if _ALONE.fullmatch(clauses[0]):
        return clauses[0]
    for clause in clauses:
        if (found := _AT_THE_END.search(clause)) is not None:
            return found[1]
    if (found := _COMPOUND_FIRST.match(text) or _SYMBOL_FIRST.match(text)) is not None:
        return found[1]
    first = _FIRST_WORD.match(text)
    if first is None or text[first.end() :].startswith(" per "):
        return None
    return _WORDS.get(first[0].lower())
