"""Intersections of straight lines with primitive shapes and obstacles. Imports no numerics."""

import math
from collections.abc import Iterable, Sequence
from typing import Final

from arcor2_hw.collision.description import Obstacle
from arcor2_hw.data import object_type
from arcor2_hw.data.base import Data
from arcor2_hw.data.geometry import Position
from arcor2_hw.kinematics.primitives import Box, Capsule, Cylinder, Sphere, primitive_of

_TINY: Final = 1e-12
_Span = tuple[float, float]


class Hit(Data, frozen=True):
    """The first obstacle that a line meets, and the position along the line (0 to 1)."""

    id: str
    share: float


def first_hit(
    start: Position, end: Position, obstacles: Iterable[tuple[str, Obstacle]], inflation: float
) -> Hit | None:
    """Return the first obstacle that a straight line meets, or None if the line is free.

    Only fixed primitives are checked; other obstacles are skipped.

    Args:
        start: Start of the line.
        end: End of the line.
        obstacles: Obstacles by id.
        inflation: Length added to edges, lengths and radii, m.
    """
    nearest, hit = math.inf, None
    way = end - start
    for key, one in obstacles:
        if not one.is_fixed_primitive or not _near(one, start, way, 2 * inflation):
            continue
        frame = one.pose.inverted()
        a, b = (frame.position + point.rotated(frame.orientation) for point in (start, end))
        if isinstance(one.model, object_type.Mesh):
            continue
        at = entry(primitive_of(one.model), (a.x, a.y, a.z), tuple(b - a), inflation)
        if at is not None and at < nearest:
            nearest, hit = at, key
    return None if hit is None else Hit(hit, nearest)


def _near(obstacle: Obstacle, a: Position, d: Position, within: float) -> bool:
    """Return whether the bounding sphere of an obstacle is within `within` m of a line; few of many are."""
    model, at = obstacle.model, obstacle.pose.position
    match model:
        case object_type.Box():
            radius = math.hypot(model.size_x, model.size_y, model.size_z) / 2
        case object_type.Sphere():
            radius = model.radius
        case object_type.Cylinder():
            radius = math.hypot(model.radius, model.height / 2)
        case _:
            return False
    x, y, z, reach = at.x - a.x, at.y - a.y, at.z - a.z, radius + within
    square = d.x * d.x + d.y * d.y + d.z * d.z
    if square > 0.0:
        share = min(max((x * d.x + y * d.y + z * d.z) / square, 0.0), 1.0)
        x, y, z = x - share * d.x, y - share * d.y, z - share * d.z
    return x * x + y * y + z * z <= reach * reach


def entry(
    shape: Box | Cylinder | Capsule | Sphere, start: Sequence[float], direction: Sequence[float], inflation: float = 0.0
) -> float | None:
    """Return the position along a line, 0 to 1, at which it enters a shape, or None if it does not.

    The position is 0 for a line that starts inside. Edges, lengths and radii are enlarged by `inflation`, as the
    protocol demands.

    Args:
        shape: The shape.
        start: Start of the line, (3).
        direction: Vector from start to end, (3).
        inflation: Length added to sizes, m.
    """
    half = inflation / 2.0
    match shape:
        case Box():
            sizes = (shape.x, shape.y, shape.z)
            return _common([_slab(start[i], direction[i], size / 2.0 + half) for i, size in enumerate(sizes)])
        case Sphere():
            return _common([_round(start, direction, shape.radius + inflation)])
        case Cylinder():
            around = _round(start[:2], direction[:2], shape.radius + inflation)
            return _common([around, _slab(start[2], direction[2], shape.length / 2.0 + half)])
        case Capsule():
            return _capsule(start, direction, shape.radius + inflation, shape.length / 2.0)


def _common(spans: list[_Span | None]) -> float | None:
    """Return the beginning of the intersection of all spans with the line, or None if it is empty."""
    low, high = 0.0, 1.0
    for span in spans:
        if span is None:
            return None
        low, high = max(low, span[0]), min(high, span[1])
    return low if low <= high else None


def _slab(a: float, d: float, half: float) -> _Span | None:
    if abs(d) < _TINY:
        return (-math.inf, math.inf) if abs(a) <= half else None
    one, other = (-half - a) / d, (half - a) / d
    return min(one, other), max(one, other)


def _round(a: Sequence[float], d: Sequence[float], radius: float) -> _Span | None:
    square = math.fsum(x * x for x in d)
    beyond = math.fsum(x * x for x in a) - radius * radius
    if square < _TINY * _TINY:
        return (-math.inf, math.inf) if beyond <= 0.0 else None
    middle = math.fsum(x * y for x, y in zip(a, d, strict=True))
    discriminant = middle * middle - square * beyond
    if discriminant < 0.0:
        return None
    root = math.sqrt(discriminant)
    return (-middle - root) / square, (-middle + root) / square


def _capsule(a: Sequence[float], d: Sequence[float], radius: float, half: float) -> float | None:
    found = [_common([_round(a[:2], d[:2], radius), _slab(a[2], d[2], half)])]
    found += [_common([_round([a[0], a[1], a[2] - end], d, radius)]) for end in (-half, half)]
    return min((each for each in found if each is not None), default=None)
