"""Subproblems of inverse kinematics: angles that rotate a vector to a height, onto another one, or to a length.

The canonical subproblems of B. Paden and W. Kahan, on plain floats, which are faster than arrays of length 3.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from arcor2_hw.kinematics.shapes import Array

TINY: Final = 1e-9
SINGULAR: Final = 1e-10
"""Product of two sines below which an angle is undetermined."""
COSINE_TOLERANCE: Final = 0.02
"""Maximum excess of a cosine over 1. The result is refined later."""

Vector = tuple[float, float, float]
Rows = tuple[Vector, Vector, Vector]
Values = Sequence[float]


# ------------------------------------------------------------------------------------------------ angles
def nearest_turn(angle: float, seed: float, lower: float, upper: float) -> float:
    """Shift an angle by whole turns as near to the seed as the limits allow; beyond a limit if no turn is within."""
    if not -math.pi <= angle - seed <= math.pi:
        angle += math.tau * round((seed - angle) / math.tau)
    if angle > upper:
        angle -= math.tau * math.ceil((angle - upper) / math.tau)
    elif angle < lower:
        angle += math.tau * math.ceil((lower - angle) / math.tau)
    return angle


def around(middle: float, cosine: float) -> Values:
    """Return the two angles on both sides of `middle` whose distance from it has the given cosine."""
    if not abs(cosine) <= 1.0 + COSINE_TOLERANCE:
        return ()
    half = math.acos(max(-1.0, min(1.0, cosine)))
    return (middle + half, middle - half) if half > TINY else (middle,)


def solved(cosine: float, sine: float, height: float, if_free: float) -> Values:
    """Return the angles x with `cosine * cos(x) + sine * sin(x) = height`."""
    size = math.hypot(cosine, sine)
    if size < TINY:
        return (if_free,) if abs(height) < COSINE_TOLERANCE else ()
    return around(math.atan2(sine, cosine), height / size)


def level(
    axis: Vector, turned: Vector, along: Vector, height: float, if_free: float, *, backwards: bool = False
) -> Values:
    """Return the angles about `axis` that rotate `turned` to a height along `along`, negated with `backwards`."""
    across = cross(axis, turned)
    sine = dot(along, across)
    height -= dot(along, axis) * dot(axis, turned)
    return solved(dot(along, cross(across, axis)), -sine if backwards else sine, height, if_free)


def between(axis: Vector, start: Vector, target: Vector, if_free: float) -> float:
    """Return the angle about `axis` that rotates `start` nearest to `target`."""
    across = cross(axis, start)
    sine, cosine = dot(across, target), dot(cross(across, axis), target)
    if math.hypot(sine, cosine) < SINGULAR:
        return if_free
    return math.atan2(sine, cosine)


def folded(axis: Vector, outer: Vector, inner: Vector, to: Vector) -> Values:
    """Return the angles about `axis` between two links at which their ends are the length of `to` apart."""
    outer, inner, to = (subtract(each, scaled(axis, dot(axis, each))) for each in (outer, inner, to))
    height = (dot(to, to) - dot(inner, inner) - dot(outer, outer)) / 2.0
    return solved(dot(inner, outer), dot(inner, cross(axis, outer)), height, 0.0)


def nearest_points(one: Array, along: Array, other: Array, other_along: Array) -> tuple[float, Array, Array]:
    """Return the distance of two lines that are not parallel, and the nearest points on them."""
    across = np.cross(along, other_along)
    matrix = np.column_stack((along, -other_along, across))
    s, t, gap = np.linalg.solve(matrix, other - one)
    return abs(float(gap)) * float(np.linalg.norm(across)), one + s * along, other + t * other_along


# ------------------------------------------------------------------------------------------------ vectors of three
def vector(array: Array) -> Vector:
    """Return the three floats of an array."""
    return float(array[0]), float(array[1]), float(array[2])


def rows_of(matrix: Array) -> Rows:
    """Return the rows of a matrix (3, 3)."""
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    return (a, b, c), (d, e, f), (g, h, i)


def dot(a: Vector, b: Vector) -> float:
    """Return the dot product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def add(*vectors: Vector) -> Vector:
    """Return the sum."""
    return sum(v[0] for v in vectors), sum(v[1] for v in vectors), sum(v[2] for v in vectors)


def subtract(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scaled(a: Vector, by: float) -> Vector:
    """Return a multiple."""
    return a[0] * by, a[1] * by, a[2] * by


def turned(m: Rows, v: Vector) -> Vector:
    """Return a matrix times a vector."""
    return dot(m[0], v), dot(m[1], v), dot(m[2], v)


def transposed(m: Rows) -> Rows:
    """Return the transposed matrix."""
    (a, b, c), (d, e, f), (g, h, i) = m
    return (a, d, g), (b, e, h), (c, f, i)


def product(m: Rows, n: Rows) -> Rows:
    """Return m times n."""
    x, y, z = transposed(n)
    return (
        (dot(m[0], x), dot(m[0], y), dot(m[0], z)),
        (dot(m[1], x), dot(m[1], y), dot(m[1], z)),
        (dot(m[2], x), dot(m[2], y), dot(m[2], z)),
    )


def rotation(axis: Vector, angle: float) -> Rows:
    """Return the rotation matrix about a unit axis (Rodrigues' formula)."""
    (x, y, z), c, s = axis, math.cos(angle), math.sin(angle)
    t = 1.0 - c
    return (
        (c + x * x * t, x * y * t - z * s, x * z * t + y * s),
        (x * y * t + z * s, c + y * y * t, y * z * t - x * s),
        (x * z * t - y * s, y * z * t + x * s, c + z * z * t),
    )


def rotated_about(axis: Vector, angle: float, v: Vector) -> Vector:
    """Return a vector rotated about a unit axis."""
    (x, y, z), (a, b, d), c, s = axis, v, math.cos(angle), math.sin(angle)
    along = (1.0 - c) * (x * a + y * b + z * d)
    return (
        c * a + s * (y * d - z * b) + along * x,
        c * b + s * (z * a - x * d) + along * y,
        c * d + s * (x * b - y * a) + along * z,
    )
