"""All configurations of an arm whose second, third and fourth axis are parallel and whose last two meet: the UR's kind.

Which arms are of that kind is read off their axes, not their names. The decomposition is that of A. J. Elias and
J. T. Wen, "IK-Geo" (2022), section on three parallel axes: joint 1 follows from the height of the wrist above the plane
of the arm, joint 5 from the direction of the last axis, joint 6 from that of the parallel ones, and a triangle is left.
For an arm that is calibrated the axes are not quite parallel: what comes out is then near a solution, not one.
"""

import math
from collections.abc import Iterator
from typing import Final, Self

import numpy as np

from arcor2_hw.kinematics.shapes import Array

NEARLY: Final = 0.02
"""How far the axes may be off, rad and m: calibrations are off by less."""
_TINY: Final = 1e-9
_SINGULAR: Final = 1e-10
_BEYOND: Final = 0.02
"""By how much a cosine may be beyond 1 and still count as 1, for what is then refined."""

Vector = tuple[float, float, float]
Rows = tuple[Vector, Vector, Vector]
Six = tuple[float, float, float, float, float, float]


class ThreeParallel:
    """Geometry of one arm: unit axes h, and points p of each axis relative to the one before, all at zero angles.

    Made by `of`; `solve` gives up to eight configurations.
    """

    def __init__(self, axes: Array, points: Array, tip: Array) -> None:
        self._h1, self._h2, _, _, self._h5, self._h6 = (_vector(axis) for axis in axes)
        # The axes are moved along themselves so that 1 and 2, and 5 and 6, share an origin where they can.
        self._origin = _vector(points[0])
        self._p12, self._p23, self._p34, self._p45 = (_vector(points[i + 1] - points[i]) for i in range(4))
        self._tip = np.array(tip)
        self._p6t = points[5] - tip[:3, 3]
        self._beside = _dot(self._h2, _sum(self._p12, self._p23, self._p34, self._p45))
        self._offset = _vector(tip[:3, :3].T @ self._p6t)
        self._tip_turn = _rows(tip[:3, :3])

    @classmethod
    def of(cls, axes: Array, points: Array, tip: Array) -> Self | None:
        """Read the geometry off axes (6, 3), points on them (6, 3) and the tip (4, 4), all for zero angles.

        None when the arm is not of this kind.
        """
        if len(axes) != 6:
            return None
        second = axes[1]
        parallel = all(np.linalg.norm(np.cross(second, axes[i])) < NEARLY and axes[i] @ second > 0.0 for i in (2, 3))
        across = all(abs(axes[i] @ axes[j]) < 1.0 - NEARLY for i, j in ((0, 1), (3, 4), (4, 5)))
        if not parallel or not across:
            return None
        moved = np.array(points, dtype=np.float64)
        gap, moved[4], _ = _nearest(points[4], axes[4], points[5], axes[5])
        if gap > NEARLY:
            return None
        moved[5] = moved[4]
        return cls(axes, moved, tip)

    def solve(self, target: Array, q1_if_free: float = 0.0, q6_if_free: float = 0.0) -> list[Six]:
        """Give the configurations, angles within -pi and pi, that bring the tip to a pose (4, 4).

        Where one joint of two is free, as at singularities, `q1_if_free` and `q6_if_free` are what it is set to.
        """
        turn = _product(_rows(target[:3, :3]), _transposed(self._tip_turn))
        position = (float(target[0, 3]), float(target[1, 3]), float(target[2, 3]))
        wrist = _sub(_sum(position, _turned(_rows(target[:3, :3]), self._offset)), self._origin)
        return list(self._all(turn, wrist, q1_if_free, q6_if_free))

    def _all(self, turn: Rows, wrist: Vector, q1_if_free: float, q6_if_free: float) -> Iterator[Six]:
        h1, h2, h5, h6 = self._h1, self._h2, self._h5, self._h6
        for q1 in _level(h1, wrist, h2, self._beside, q1_if_free, backwards=True):
            rest_of_turn = _product(_about(h1, -q1), turn)  # of joints 2 to 6
            back = _turned(_transposed(rest_of_turn), h2)
            shoulder = _sub(_spun(h1, -q1, wrist), self._p12)
            for q5 in _level(h5, h6, h2, _dot(h2, _turned(rest_of_turn, h6)), 0.0):
                for q6 in self._last(q5, back, q6_if_free, rest_of_turn, shoulder):
                    q14 = _between(h2, h5, _turned(rest_of_turn, _spun(h6, -q6, h5)), 0.0)
                    rest = _sub(shoulder, _spun(h2, q14, self._p45))
                    for q3 in _folded(h2, self._p34, self._p23, rest):
                        bent = _sum(self._p23, _spun(h2, q3, self._p34))
                        q2 = _between(h2, bent, rest, 0.0)
                        yield q1, q2, q3, math.remainder(q14 - q2 - q3, math.tau), q5, q6

    def _last(self, q5: float, back: Vector, if_free: float, rest_of_turn: Rows, shoulder: Vector) -> list[float]:
        """Give the angles of joint 6. Where it turns about the axis of joints 2 to 4 it is free, as far as these reach.

        Then it is `if_free`, and also what lets the links just reach, since they may not with the former.
        """
        h2, h5, h6 = self._h2, self._h5, self._h6
        v = _spun(h5, -q5, h2)
        across = _cross(h6, v)
        sine, cosine = _dot(across, back), _dot(_cross(across, h6), back)
        if math.hypot(sine, cosine) >= _SINGULAR:
            return [-math.atan2(sine, cosine)]
        q14 = _between(h2, h5, _turned(rest_of_turn, _spun(h6, -if_free, h5)), 0.0)
        to, tail = (_sub(each, _scaled(h2, _dot(h2, each))) for each in (shoulder, self._p45))
        far, short = math.hypot(*to), math.hypot(*tail)
        longest = math.hypot(*self._p23) + math.hypot(*self._p34)
        found = [if_free]
        if min(far, short) > _TINY:
            share = (far * far + short * short - longest * longest) / (2.0 * far * short)
            middle, half = _between(h2, tail, to, 0.0), math.acos(max(-1.0, min(1.0, share)))
            sign = math.copysign(1.0, _dot(h2, _spun(h5, q5, h6)))
            # Joints 2 to 4 together, and joint 6, make one turn.
            found += [math.remainder(if_free + sign * (q14 - middle - part * half), math.tau) for part in (-1, 0, 1)]
        return found


# ------------------------------------------------------------------------------------------------ subproblems
def _level(
    axis: Vector, turned: Vector, along: Vector, height: float, if_free: float, *, backwards: bool = False
) -> list[float]:
    """Give the angles about `axis` by which `turned` comes to a height along `along`; backwards: by minus these."""
    across = _cross(axis, turned)
    a = _dot(along, _cross(across, axis))
    b = _dot(along, across)
    constant = _dot(along, axis) * _dot(axis, turned)
    size = math.hypot(a, b)
    if size < _TINY:
        return [if_free] if abs(height - constant) < _BEYOND else []
    share = (height - constant) / size
    if abs(share) > 1.0 + _BEYOND:
        return []
    middle, half = math.atan2(b, a), math.acos(max(-1.0, min(1.0, share)))
    sign = -1.0 if backwards else 1.0
    angles = (middle + half, middle - half) if half > _TINY else (middle,)
    return [math.remainder(sign * angle, math.tau) for angle in angles]


def _between(axis: Vector, one: Vector, other: Vector, if_free: float) -> float:
    """Give the angle about `axis` that turns `one` nearest to `other`."""
    across = _cross(axis, one)
    sine, cosine = _dot(across, other), _dot(_cross(across, axis), other)
    if math.hypot(sine, cosine) < _SINGULAR:
        return if_free
    return math.atan2(sine, cosine)


def _folded(axis: Vector, outer: Vector, inner: Vector, to: Vector) -> list[float]:
    """Give the angles about `axis` of the outer of two links, so that both together are as long as `to`, across it."""
    outer, inner, to = (_sub(each, _scaled(axis, _dot(axis, each))) for each in (outer, inner, to))
    a, b = _dot(inner, outer), _dot(inner, _cross(axis, outer))
    size = math.hypot(a, b)
    share = (_dot(to, to) - _dot(inner, inner) - _dot(outer, outer)) / (2.0 * size)
    if abs(share) > 1.0 + _BEYOND:
        return []
    middle, half = math.atan2(b, a), math.acos(max(-1.0, min(1.0, share)))
    angles = (middle + half, middle - half) if half > _TINY else (middle,)
    return [math.remainder(angle, math.tau) for angle in angles]


def _nearest(one: Array, along: Array, other: Array, other_along: Array) -> tuple[float, Array, Array]:
    """Give the distance of two lines that are not parallel, and the points of both that are nearest."""
    across = np.cross(along, other_along)
    matrix = np.column_stack((along, -other_along, across))
    s, t, gap = np.linalg.solve(matrix, other - one)
    return abs(float(gap)) * float(np.linalg.norm(across)), one + s * along, other + t * other_along


# ------------------------------------------------------------------------------------------------ vectors of three
def _vector(array: Array) -> Vector:
    return float(array[0]), float(array[1]), float(array[2])


def _rows(matrix: Array) -> Rows:
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    return (a, b, c), (d, e, f), (g, h, i)


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _sum(*vectors: Vector) -> Vector:
    return sum(v[0] for v in vectors), sum(v[1] for v in vectors), sum(v[2] for v in vectors)


def _sub(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _scaled(a: Vector, by: float) -> Vector:
    return a[0] * by, a[1] * by, a[2] * by


def _turned(m: Rows, v: Vector) -> Vector:
    return _dot(m[0], v), _dot(m[1], v), _dot(m[2], v)


def _transposed(m: Rows) -> Rows:
    (a, b, c), (d, e, f), (g, h, i) = m
    return (a, d, g), (b, e, h), (c, f, i)


def _product(m: Rows, n: Rows) -> Rows:
    x, y, z = _transposed(n)
    return (
        (_dot(m[0], x), _dot(m[0], y), _dot(m[0], z)),
        (_dot(m[1], x), _dot(m[1], y), _dot(m[1], z)),
        (_dot(m[2], x), _dot(m[2], y), _dot(m[2], z)),
    )


def _about(axis: Vector, angle: float) -> Rows:
    """Give the rotation about a unit axis (Rodrigues' formula)."""
    (x, y, z), c, s = axis, math.cos(angle), math.sin(angle)
    t = 1.0 - c
    return (
        (c + x * x * t, x * y * t - z * s, x * z * t + y * s),
        (x * y * t + z * s, c + y * y * t, y * z * t - x * s),
        (x * z * t - y * s, y * z * t + x * s, c + z * z * t),
    )


def _spun(axis: Vector, angle: float, v: Vector) -> Vector:
    """Give a vector turned about a unit axis."""
    (x, y, z), (a, b, d), c, s = axis, v, math.cos(angle), math.sin(angle)
    along = (1.0 - c) * (x * a + y * b + z * d)
    return (
        c * a + s * (y * d - z * b) + along * x,
        c * b + s * (z * a - x * d) + along * y,
        c * d + s * (x * b - y * a) + along * z,
    )
