"""Named points: the compact list in the settings, taken apart and checked. Pure functions.

`part_present=DI0 debounce=0.02; lamp_red=DO4 on_loss=off; level=AI0 scale=0.001 unit=m`
"""

import math
import re
from typing import Final

from arcor2_hw.data.base import UNSET, Data
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects.small import IOPoint, OnLoss, PointDirection, PointKind

from .registers import CHANNELS, RAW_MAX

_ADDRESS: Final = re.compile(r"(DI|DO|AI|AO)(\d{1,3})")
_LONGEST_DEBOUNCE: Final = 10.0
_ALLOWED: Final = {"DI": {"debounce"}, "DO": {"on_loss"}, "AI": {"scale", "unit"}, "AO": {"scale", "unit", "on_loss"}}


class Point(Data, frozen=True):
    """A point of the block: what a program sees of it, and where it is wired."""

    io: IOPoint
    kind: str
    """DI, DO, AI or AO."""
    channel: int

    @property
    def address(self) -> str:
        """Give the terminal, as DO4."""
        return f"{self.kind}{self.channel}"

    def physical(self, raw: int) -> float:
        """Give the value of a raw one."""
        return raw * self.io.scale

    def raw(self, value: float) -> int:
        """Give the raw value of a physical one. Raises ValueError with the range when there is none."""
        limit = RAW_MAX * abs(self.io.scale)
        if not (math.isfinite(value) and abs(value) <= limit):
            raise ValueError(f"must be {-limit:g} to {limit:g} {self.io.unit}".rstrip())
        return max(-RAW_MAX, min(RAW_MAX, round(value / self.io.scale)))


def parse_points(text: str, parameter: str = "points") -> dict[str, Point]:
    """Give the points by name. Raises OutOfRange naming the parameter and the entry."""
    points: dict[str, Point] = {}
    wired: dict[str, str] = {}
    for entry in filter(None, (part.strip() for part in text.split(";"))):
        point = _point(entry, parameter)
        name = point.io.name
        if name in points:
            raise OutOfRange(f"{parameter} must name each point once: {name!r} is there twice")
        if point.address in wired:
            raise OutOfRange(
                f"{parameter} must use each terminal once: {point.address} is {wired[point.address]!r} and {name!r}"
            )
        points[name], wired[point.address] = point, name
    if not points:
        raise OutOfRange(f"{parameter} must name at least one point, as in part_present=DI0; lamp=DO4 on_loss=off")
    return points


def parse_address(text: str, parameter: str) -> tuple[str, int]:
    """Give kind and channel of a terminal such as DO4. Raises OutOfRange naming the parameter."""
    match = _ADDRESS.fullmatch(text)
    if match is None:
        raise OutOfRange(f"{parameter} must use a terminal such as DI0, DO4, AI1 or AO0, not {text!r}")
    kind, channel = match[1], int(match[2])
    if channel >= CHANNELS[kind]:
        raise OutOfRange(f"{parameter} must use {kind}0 to {kind}{CHANNELS[kind] - 1}, not {text}")
    return kind, channel


def _point(entry: str, parameter: str) -> Point:
    head, *words = entry.split()
    name, sign, terminal = head.partition("=")
    if not sign or not name.isidentifier():
        raise OutOfRange(f"{parameter} must be a list of name=terminal, parted by semicolons, not {entry!r}")
    kind, channel = parse_address(terminal, parameter)
    options: dict[str, str] = {}
    for word in words:
        key, sign, value = word.partition("=")
        if not sign or not value or key not in _ALLOWED[kind] or key in options:
            known = ", ".join(sorted(_ALLOWED[kind]))
            raise OutOfRange(f"{parameter} must give {name} ({terminal}) only {known}, each once, not {word!r}")
        options[key] = value
    on_loss = _on_loss(options.get("on_loss", "off"), kind, name, parameter)
    io = IOPoint(
        name=name,
        direction=PointDirection.INPUT if kind in ("DI", "AI") else PointDirection.OUTPUT,
        kind=PointKind.DIGITAL if kind in ("DI", "DO") else PointKind.ANALOG,
        unit=options.get("unit", ""),
        scale=_number(options.get("scale", "1"), "scale", name, parameter),
        debounce=_number(options.get("debounce", "0"), "debounce", name, parameter),
        on_loss=on_loss if kind in ("DO", "AO") else UNSET,
    )
    if io.scale == 0.0:
        raise OutOfRange(f"{parameter} must give {name} a scale other than 0")
    if not 0.0 <= io.debounce <= _LONGEST_DEBOUNCE:
        raise OutOfRange(f"{parameter} must give {name} a debounce of 0 to {_LONGEST_DEBOUNCE:g} s")
    return Point(io=io, kind=kind, channel=channel)


def _on_loss(text: str, kind: str, name: str, parameter: str) -> OnLoss:
    allowed = ["hold", "off", "on"] if kind == "DO" else ["hold", "off"]
    if text not in allowed:
        raise OutOfRange(f"{parameter} must give {name} an on_loss of {', '.join(allowed)}, not {text!r}")
    return OnLoss(text)


def _number(text: str, key: str, name: str, parameter: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise OutOfRange(f"{parameter} must give {name} a number as {key}, not {text!r}")
    return value
