"""Collision models that clients add over REST, and line checks against simple bodies."""

import math
from collections.abc import Callable, Iterable
from typing import Final

from arcor2_hw.collision.description import Attachment
from arcor2_hw.data.base import Data
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box, Cylinder, Mesh, Models, Sphere
from arcor2_hw.exceptions import NotFound

INFLATION: Final = 0.01
"""Inflation of body sizes for safe line checks, m (protocol, section 14)."""
_TINY: Final = 1e-12


class Placed(Data, frozen=True):
    """A collision model with its pose in the world, or in the frame of the link that holds it. scale: of a mesh."""

    model: Models
    pose: Pose
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    attachment: Attachment | None = None

    @property
    def simple(self) -> bool:
        """Return whether lines are checked against it in this process: it is neither a mesh nor attached to a robot."""
        return self.attachment is None and not isinstance(self.model, Mesh)


class CollisionWorld:
    """The collision models added over REST. They stay until they are deleted or the scene is stopped over REST."""

    def __init__(self, inflation: float = INFLATION) -> None:
        self.started = False
        self.inflation = inflation
        self._put: dict[str, Placed] = {}
        self.on_change: list[Callable[[], None]] = []
        """Called when the models changed."""
        self.on_put: list[Callable[[Placed], None]] = []
        """Called with an added, moved, attached or detached model."""
        self.on_remove: list[Callable[[list[str]], None]] = []
        """Called with the ids of removed models."""

    @property
    def put_in(self) -> dict[str, Placed]:
        """Return the models by id."""
        return dict(self._put)

    def put(self, placed: Placed) -> None:
        """Add a model, or replace the one with its id."""
        self._put[placed.model.id] = placed
        for notify in self.on_put:
            notify(placed)
        self._changed()

    def given(self, key: str) -> Placed:
        """Return a model. Raise NotFound if there is none."""
        if (placed := self._put.get(key)) is None:
            raise NotFound(f"There is no collision model {key!r}.")
        return placed

    def remove(self, key: str) -> None:
        """Remove a model. Raise NotFound if there is none."""
        if self._put.pop(key, None) is None:
            raise NotFound(f"There is no collision model {key!r}.")
        self._removed([key])

    def stop(self) -> None:
        """Stop and remove all models."""
        self.started = False
        gone = list(self._put)
        self._put.clear()
        self._removed(gone)

    def _removed(self, keys: list[str]) -> None:
        for notify in self.on_remove:
            notify(keys)
        self._changed()

    def _changed(self) -> None:
        for notify in self.on_change:
            notify()


# ------------------------------------------------------------------------------------------------ lines
class Hit(Data, frozen=True):
    """The first body that a line hits, and the fraction of the line at which it does."""

    id: str
    share: float


def first_hit(start: Position, end: Position, placed: Iterable[tuple[str, Placed]], inflation: float) -> Hit | None:
    """Return the first body that a straight line from `start` to `end` hits, None if it is free.

    Boxes, spheres and cylinders (along their z) with sizes increased by `inflation`, m: edges of a box, radius and
    height. Meshes, and what is held, are not looked at: that is no business of this process.
    """
    nearest, hit = math.inf, None
    way = end - start
    for key, one in placed:
        if not one.simple or not _near(one, start, way, 2 * inflation):
            continue
        frame = one.pose.inverted()
        a, b = (frame.position + point.rotated(frame.orientation) for point in (start, end))
        at = _entry(a, b - a, one.model, inflation)
        if at is not None and at < nearest:
            nearest, hit = at, key
    return None if hit is None else Hit(hit, nearest)


def _near(placed: Placed, a: Position, d: Position, within: float) -> bool:
    """Return whether the ball around a body comes within so much of a line: most of many do not."""
    model, at = placed.model, placed.pose.position
    match model:
        case Box():
            radius = math.hypot(model.size_x, model.size_y, model.size_z) / 2
        case Sphere():
            radius = model.radius
        case Cylinder():
            radius = math.hypot(model.radius, model.height / 2)
        case _:
            return False
    x, y, z, reach = at.x - a.x, at.y - a.y, at.z - a.z, radius + within
    square = d.x * d.x + d.y * d.y + d.z * d.z
    if square > 0.0:
        share = min(max((x * d.x + y * d.y + z * d.z) / square, 0.0), 1.0)
        x, y, z = x - share * d.x, y - share * d.y, z - share * d.z
    return x * x + y * y + z * z <= reach * reach


def _entry(a: Position, d: Position, model: Models, inflation: float) -> float | None:
    """Return at which share of the way from `a` along `d` a model around the origin is entered, None if it is not."""
    match model:
        case Box():
            sizes = (model.size_x, model.size_y, model.size_z)
            spans = [_slab(a[i], d[i], (size + inflation) / 2) for i, size in enumerate(sizes)]
        case Sphere():
            spans = [_round((a.x, a.y, a.z), (d.x, d.y, d.z), model.radius + inflation)]
        case Cylinder():
            radius = model.radius + inflation
            spans = [_round((a.x, a.y), (d.x, d.y), radius), _slab(a.z, d.z, (model.height + inflation) / 2)]
        case _:
            return None
    low, high = 0.0, 1.0
    for span in spans:
        if span is None:
            return None
        low, high = max(low, span[0]), min(high, span[1])
    return low if low <= high else None


def _slab(a: float, d: float, half: float) -> tuple[float, float] | None:
    """Return between which shares of the way the line is within +-half of one axis."""
    if abs(d) < _TINY:
        return (-math.inf, math.inf) if abs(a) <= half else None
    one, other = (-half - a) / d, (half - a) / d
    return min(one, other), max(one, other)


def _round(a: tuple[float, ...], d: tuple[float, ...], radius: float) -> tuple[float, float] | None:
    """Return between which shares of the way the line is within `radius` of the origin (of a plane, or of space)."""
    square = math.fsum(x * x for x in d)
    constant = math.fsum(x * x for x in a) - radius * radius
    if square < _TINY * _TINY:
        return (-math.inf, math.inf) if constant <= 0 else None
    half = math.fsum(x * y for x, y in zip(a, d, strict=True))
    discriminant = half * half - square * constant
    if discriminant < 0:
        return None
    root = math.sqrt(discriminant)
    return (-half - root) / square, (-half + root) / square
