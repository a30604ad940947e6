"""The list of points in the settings: `part=DI0 debounce=0.02; lamp=DO4 on_loss=off; level=AI0 scale=0.001 unit=m`."""

import math
import re
from collections.abc import Collection
from typing import Final

from arcor2_hw.data.base import Data
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects.point_list import entries, io_point
from arcor2_hw.objects.small import IOPoint, OnLoss

from .registers import CHANNELS, RAW_MAX

_ADDRESS: Final = re.compile(r"(DI|DO|AI|AO)(\d{1,3})")


class Point(Data, frozen=True):
    """A point of the block: how programs see it, and its terminal (`kind` is DI, DO, AI or AO)."""

    io: IOPoint
    kind: str
    channel: int

    @property
    def address(self) -> str:
        """Return the terminal, as DO4."""
        return f"{self.kind}{self.channel}"

    def raw(self, value: float) -> int:
        """Return the raw value of a physical value. Raises ValueError with the range if it is outside of it."""
        limit = RAW_MAX * abs(self.io.scale)
        if not (math.isfinite(value) and abs(value) <= limit):
            raise ValueError(f"must be {-limit:g} to {limit:g}")
        return max(-RAW_MAX, min(RAW_MAX, round(value / self.io.scale)))


def parse_points(text: str) -> dict[str, Point]:
    """Return the points of the setting `points` by name. Raises OutOfRange naming the entry."""
    points: dict[str, Point] = {}
    names: dict[str, str] = {}
    for name, (terminal, *words) in entries(text, ";", "points").items():
        kind, channel = parse_address(terminal, "points")
        safe_states = tuple(OnLoss) if kind == "DO" else (OnLoss.HOLD, OnLoss.OFF)
        point = points[name] = Point(io_point(name, kind, words, "points", safe_states=safe_states), kind, channel)
        first = names.setdefault(point.address, name)
        if first != name:
            raise OutOfRange(
                "points must use each terminal once: {terminal} is {first!r} and {name!r}",
                terminal=terminal,
                first=first,
                name=name,
            )
    if not points:
        raise OutOfRange("points must name at least one point, as in part_present=DI0; lamp=DO4 on_loss=off")
    return points


def parse_address(text: str, parameter: str) -> tuple[str, int]:
    """Return kind and channel of a terminal such as DO4. Raises OutOfRange naming the parameter."""
    match = _ADDRESS.fullmatch(text)
    if match is None:
        raise OutOfRange(
            "{parameter} must use a terminal such as DI0, DO4, AI1 or AO0, not {text!r}", parameter=parameter, text=text
        )
    kind, channel = match[1], int(match[2])
    if channel >= CHANNELS[kind]:
        last = f"{kind}{CHANNELS[kind] - 1}"
        raise OutOfRange(
            "{parameter} must use {kind}0 to {last}, not {text}", parameter=parameter, kind=kind, last=last, text=text
        )
    return kind, channel


def arming(points: Collection[Point], time_ms: int, number: int) -> list[int]:
    """Return the ten registers that start a watchdog which guards the outputs among the points."""

    def outputs(kind: str, *on_loss: OnLoss) -> int:
        return sum(1 << point.channel for point in points if point.kind == kind and point.io.on_loss in on_loss)

    switched = (OnLoss.OFF, OnLoss.ON)
    digital = (outputs("DO", *OnLoss), outputs("DO", *switched), outputs("DO", OnLoss.ON))
    return [time_ms, number, 0, *digital, outputs("AO", *OnLoss), outputs("AO", *switched), 0, 0]
