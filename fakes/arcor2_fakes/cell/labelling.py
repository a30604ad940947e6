"""The place under the label printer: a label lands on a board, and an arm presses it on."""

from __future__ import annotations

import math

import numpy as np

from arcor2_fakes.cell.layout import Labelling, Matrix
from arcor2_fakes.cell.world_data import Label, Printed, Thing

Point = tuple[float, float, float]
"""A position in the world, m."""


class LabelNest:
    """The place for one board. `spilled` counts the labels without a bare board below."""

    def __init__(self, layout: Labelling) -> None:
        self.layout = layout
        self.thing: Thing | None = None
        self.spilled: list[str] = []
        self._last: int | None = None
        self._began = False
        self.roller: Point | None = None

    def holds(self, world_from_board: Matrix) -> bool:
        """Return whether a board at a pose is in the nest."""
        return self.layout.place.holds(world_from_board)

    def printed(self, labels: list[Printed]) -> list[tuple[Thing, str]]:
        """Update from all labels of the printer; return the boards that received one now, and events."""
        if self._last is None:  # labels printed before the world started do not count
            self._last = max((label.number for label in labels), default=0)
        happened = []
        for label in labels:
            if label.number <= self._last:
                continue
            self._last = label.number
            if self.thing is None or self.thing.label is not None:
                self.spilled.append(label.code)
                continue
            self.thing.label, self._began = Label(label.code), False
            happened.append((self.thing, f"label {label.code} came down on it"))
        return happened

    def wiped(self, angles: tuple[float, float]) -> Thing | None:
        """Update the position of the roller; return the board whose label was pressed on now.

        A label is pressed on when the roller has moved over it from one end to the other. Between two updates, which
        are far apart on a busy computer, it has moved straight.
        """
        wipe = self.layout.press
        here = self._roller(angles)
        before, self.roller = self.roller or here, here
        label = None if self.thing is None else self.thing.label
        if label is None or label.pressed:
            self._began = False
            return None
        begins, began_at = _passes(before, here, wipe.begin, wipe.tolerance)
        ends, ended_at = _passes(before, here, wipe.end, wipe.tolerance)
        if ends and ((begins and began_at <= ended_at) or (self._began and not begins)):
            label.pressed, self._began = True, False
            return self.thing
        if begins:
            self._began = True
        elif self._began:
            _, along = _nearest(wipe.begin, wipe.end, here)
            self._began = math.dist(here, along) <= wipe.tolerance
        return None

    def taken(self) -> str:
        """Take the board out; return an event if it loses a label that was not pressed on."""
        thing, self.thing = self.thing, None
        assert thing is not None, "there is a board to be taken"
        if thing.label is not None and not thing.label.pressed:
            self.spilled.append(thing.label.code)
            thing.label = None
            return "taken from the label printer; the label, not pressed on, fell off"
        return "taken from the label printer"

    def _roller(self, angles: tuple[float, float]) -> Point:
        first, second = self.layout.arm.links
        x = first * math.cos(angles[0]) + second * math.cos(angles[0] + angles[1])
        y = first * math.sin(angles[0]) + second * math.sin(angles[0] + angles[1])
        world = self.layout.arm.base.matrix() @ np.array([x, y, 0.0, 1.0])
        return float(world[0]), float(world[1]), float(world[2])


def _nearest(start: Point, end: Point, point: Point) -> tuple[float, Point]:
    """Return the point of a line that is nearest to another point, and its position as a fraction of the line."""
    first, way = np.asarray(start), np.subtract(end, start)
    length = float(way @ way)
    share = 0.0 if length == 0.0 else float(np.clip((np.asarray(point) - first) @ way / length, 0.0, 1.0))
    x, y, z = first + share * way
    return share, (float(x), float(y), float(z))


def _passes(start: Point, end: Point, point: Point, tolerance: float) -> tuple[bool, float]:
    """Return whether a straight motion passes a point, and at which fraction of its length."""
    share, nearest = _nearest(start, end, point)
    return math.dist(nearest, point) <= tolerance, share
