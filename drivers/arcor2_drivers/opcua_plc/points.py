"""The lists of points and of the handshake in the settings. Pure functions.

`part=DI ns=2;s=Cell.PartPresent | lamp=DO ns=2;s=Cell.Lamp on_loss=off | level=AI ns=2;i=7 scale=0.001 unit=m`
"""

import re
from typing import Final

from arcor2_hw.data.base import Data
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects.point_list import OPTIONS, entries, io_point
from arcor2_hw.objects.small import IOPoint, OnLoss, PointDirection, PointKind

_NODE: Final = re.compile(r"(ns=\d{1,5};)?(i=\d{1,10}|s=\S{1,200}|g=[0-9a-fA-F-]{36}|b=[A-Za-z0-9+/=]{1,200})")
HANDSHAKE: Final = ("owner", "host_life", "plc_life", "number", "request", "busy", "done", "error", "code")
"""The variables of a handshake; see docs/devices/opcua-plc.md."""


class Point(Data, frozen=True):
    """A point of the PLC: how programs see it, and its node."""

    io: IOPoint
    node: str

    @property
    def digital(self) -> bool:
        """Return whether it is digital."""
        return self.io.kind is PointKind.DIGITAL

    @property
    def output(self) -> bool:
        """Return whether it may be written."""
        return self.io.direction is PointDirection.OUTPUT


def _node(text: str, name: str, parameter: str) -> str:
    if not _NODE.fullmatch(text):
        raise OutOfRange(
            "{parameter} must give {name} a node id such as ns=2;s=Cell.Lamp, not {text!r}",
            parameter=parameter,
            name=name,
            text=text,
        )
    return text


def parse_points(text: str, parameter: str = "points") -> dict[str, Point]:
    """Return the points by name. Raises OutOfRange naming the parameter and the entry."""
    points = {name: _point(name, words, parameter) for name, words in entries(text, "|", parameter).items()}
    if not points:
        raise OutOfRange(
            "{parameter} must name at least one point, as in part=DI ns=2;s=Cell.PartPresent", parameter=parameter
        )
    return points


def _point(name: str, words: list[str], parameter: str) -> Point:
    kind = words[0]
    if kind not in OPTIONS or len(words) < 2:
        raise OutOfRange(
            "{parameter} must give {name} as DI, DO, AI or AO and a node id, not {words!r}",
            parameter=parameter,
            name=name,
            words=" ".join(words),
        )
    node = _node(words[1], name, parameter)
    return Point(io_point(name, kind, words[2:], parameter, debounce=False, default_on_loss=OnLoss.HOLD), node)


def parse_handshake(text: str, parameter: str = "handshake") -> dict[str, str]:
    """Return the node ids of the handshake by variable; empty for none. Raises OutOfRange."""
    found: dict[str, str] = {}
    for name, words in entries(text, "|", parameter).items():
        if name not in HANDSHAKE or len(words) != 1:
            raise OutOfRange(
                "{parameter} must give {handshake}, a node id each, not {name!r}",
                parameter=parameter,
                handshake=", ".join(HANDSHAKE),
                name=name,
            )
        found[name] = _node(words[0], name, parameter)
    if missing := [name for name in HANDSHAKE if found and name not in found]:
        raise OutOfRange("{parameter} must give {missing} too", parameter=parameter, missing=", ".join(missing))
    return found
