"""Named points on node ids: the compact lists in the settings, taken apart and checked. Pure functions.

`part=DI ns=2;s=Cell.PartPresent | lamp=DO ns=2;s=Cell.Lamp on_loss=off | level=AI ns=2;i=7 scale=0.001 unit=m`
"""

import math
import re
from typing import Final

from arcor2_hw.data.base import UNSET, Data
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects.small import IOPoint, OnLoss, PointDirection, PointKind

_NODE: Final = re.compile(r"(ns=\d{1,5};)?(i=\d{1,10}|s=\S{1,200}|g=[0-9a-fA-F-]{36}|b=[A-Za-z0-9+/=]{1,200})")
_ALLOWED: Final = {"DI": (), "DO": ("on_loss",), "AI": ("scale", "unit"), "AO": ("scale", "unit", "on_loss")}
HANDSHAKE: Final = ("owner", "host_life", "plc_life", "number", "request", "busy", "done", "error", "code")
"""What a handshake consists of; docs/devices/opcua-plc.md says what each means."""


class Point(Data, frozen=True):
    """A point of the PLC: what a program sees of it, and its node."""

    io: IOPoint
    node: str

    @property
    def digital(self) -> bool:
        """Tell whether it is on or off."""
        return self.io.kind is PointKind.DIGITAL

    @property
    def output(self) -> bool:
        """Tell whether it may be written."""
        return self.io.direction is PointDirection.OUTPUT


def _entries(text: str, parameter: str) -> dict[str, list[str]]:
    """Take `name=word word ... | ...` apart. Raises OutOfRange naming the parameter."""
    found: dict[str, list[str]] = {}
    for entry in filter(None, (part.strip() for part in text.split("|"))):
        name, sign, rest = entry.partition("=")
        if not sign or not name.isidentifier() or not rest.strip():
            raise OutOfRange(f"{parameter} must be a list of name=..., parted by |, not {entry!r}")
        if name in found:
            raise OutOfRange(f"{parameter} must have each name once: {name!r} is there twice")
        found[name] = rest.split()
    return found


def _node(text: str, name: str, parameter: str) -> str:
    if not _NODE.fullmatch(text):
        raise OutOfRange(f"{parameter} must give {name} a node id such as ns=2;s=Cell.Lamp, not {text!r}")
    return text


def parse_points(text: str, parameter: str = "points") -> dict[str, Point]:
    """Give the points by name. Raises OutOfRange naming the parameter and the entry."""
    points = {name: _point(name, words, parameter) for name, words in _entries(text, parameter).items()}
    if not points:
        raise OutOfRange(f"{parameter} must name at least one point, as in part=DI ns=2;s=Cell.PartPresent")
    return points


def _point(name: str, words: list[str], parameter: str) -> Point:
    kind = words[0]
    if kind not in _ALLOWED or len(words) < 2:
        raise OutOfRange(f"{parameter} must give {name} as DI, DO, AI or AO and a node id, not {' '.join(words)!r}")
    node = _node(words[1], name, parameter)
    options: dict[str, str] = {}
    for word in words[2:]:
        key, sign, value = word.partition("=")
        if not sign or not value or key not in _ALLOWED[kind] or key in options:
            known = ", ".join(_ALLOWED[kind]) or "no options"
            raise OutOfRange(f"{parameter} must give {name} ({kind}) only {known}, each once, not {word!r}")
        options[key] = value
    return Point(
        io=IOPoint(
            name=name,
            direction=PointDirection.INPUT if kind in ("DI", "AI") else PointDirection.OUTPUT,
            kind=PointKind.DIGITAL if kind in ("DI", "DO") else PointKind.ANALOG,
            unit=options.get("unit", ""),
            scale=_scale(options.get("scale", "1"), name, parameter),
            on_loss=_on_loss(options.get("on_loss", "hold"), name, parameter) if kind in ("DO", "AO") else UNSET,
        ),
        node=node,
    )


def _scale(text: str, name: str, parameter: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value == 0.0:
        raise OutOfRange(f"{parameter} must give {name} a scale other than 0, not {text!r}")
    return value


def _on_loss(text: str, name: str, parameter: str) -> OnLoss:
    if text not in list(OnLoss):
        raise OutOfRange(f"{parameter} must give {name} an on_loss of hold, off or on, not {text!r}")
    return OnLoss(text)


def parse_handshake(text: str, parameter: str = "handshake") -> dict[str, str]:
    """Give the node ids of the handshake by what they are; empty for none. Raises OutOfRange naming what is wrong."""
    found: dict[str, str] = {}
    for name, words in _entries(text, parameter).items():
        if name not in HANDSHAKE or len(words) != 1:
            raise OutOfRange(f"{parameter} must give {', '.join(HANDSHAKE)}, a node id each, not {name!r}")
        found[name] = _node(words[0], name, parameter)
    if missing := [name for name in HANDSHAKE if found and name not in found]:
        raise OutOfRange(f"{parameter} must give {', '.join(missing)} too")
    return found
