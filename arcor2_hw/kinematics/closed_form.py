"""Closed-form inverse kinematics of two kinds of arm with six revolute joints.

`ThreeParallel`: axes 2, 3 and 4 are parallel and axes 5 and 6 meet, as in the UR. `SphericalWrist`: axes 2 and 3 are
parallel and the last three meet, as in most industrial arms. The kind is recognized by the axes.

The decomposition follows A. J. Elias and J. T. Wen, "IK-Geo" (2022). Joint 1 follows from the height of the wrist
above the plane of the arm. For the first kind, joint 5 follows from the direction of the last axis, joint 6 from that
of the parallel axes, and a triangle remains; for the second kind, the triangle comes first and the three angles of
the wrist remain. The axes of a calibrated arm are not exactly parallel: results are then approximate.
"""

import cmath
import math
from collections.abc import Iterator
from operator import itemgetter
from typing import Final, Self

import numpy as np

from arcor2_hw.kinematics.shapes import Array
from arcor2_hw.kinematics.subproblems import (
    SINGULAR,
    TINY,
    Rows,
    Values,
    Vector,
    add,
    around,
    between,
    dot,
    folded,
    level,
    nearest_points,
    nearest_turn,
    product,
    rotated_about,
    rotation,
    rows_of,
    solved,
    subtract,
    transposed,
    turned,
    vector,
)

NEARLY: Final = 0.02
"""Maximum deviation of the axes from the ideal geometry, rad and m; calibrations deviate less."""

_Started = tuple[float, float, float, float, float, complex]
"""Squared distance of joints 1, 5 and 6 from the seed; these joints; the sum of joints 2 to 4; joint 4 seen from joint
2."""


class ThreeParallel:
    """Geometry of an arm with three parallel axes. Created by `of`; `nearest` yields up to eight configurations.

    It is computed from unit axes h, and points p on each axis, at zero angles. Joints 2 to 4 rotate in a plane, about
    the z axis of a frame in which the x axis is in the plane of h2 and h5; joint 6 rotates about the z axis of the last
    link, of which the x axis is in the plane of h5 and h6. Vectors across such an axis are complex numbers.
    """

    def __init__(self, axes: Array, points: Array, tip: Array) -> None:
        h1, h2, _, _, h5, h6 = axes
        # An axis in the opposite direction changes the sign of the angle.
        self._sign3, self._sign4 = (1.0 if axes[1] @ axes[i] > 0.0 else -1.0 for i in (2, 3))
        plane, last = _frame(h2, h5), _frame(h6, h5)
        links = np.diff(points[:5], axis=0) @ plane
        # Rotated back by joint 1, the target is linear in itself and in the cosine and sine of joint 1. The rows are
        # the columns of its rotation and its position in the plane, and their heights above the plane.
        along = np.outer(h1, h1)
        before = np.zeros((3, 3, 4))
        before[:, :, :3] = plane.T @ (np.eye(3) - along), plane.T @ np.cross(h1, np.eye(3)), plane.T @ along
        before[:, :, 3] = -before[:, :, :3] @ points[0]
        # The position is relative to joint 2. Its height must equal that of joint 5, which no other joint changes.
        before[2, :, 3] -= *links[0, :2], links[:, 2].sum()
        after = np.eye(4)
        after[:3, :3] = tip[:3, :3].T @ last
        after[:3, 3] = tip[:3, :3].T @ (points[5] - tip[:3, 3])
        linear = np.einsum("nik,lj->nijkl", before, after).reshape(3, 3, 4, 16)
        columns, heights = linear[:, :2].swapaxes(1, 2), linear[:, 2].reshape(3, 2, 2, 16)
        self._linear = np.concatenate((columns, heights), axis=1).reshape(36, 16)
        # Joint 5 is determined by the height of the last axis.
        across = np.cross(h5, h6)
        self._height5 = float((h2 @ h5) * (h5 @ h6))
        height = complex(h2 @ np.cross(across, h5), h2 @ across)
        self._middle5, self._size5 = cmath.phase(height), abs(height)
        # Joint 6 is determined by the axes of joints 2 to 4 in the last link.
        back = h2 - h5 * (h2 @ h5), np.cross(h2, h5), h5 * (h2 @ h5)
        self._cosine6, self._sine6, self._constant6 = (complex(*(last.T @ each)[:2]) for each in back)
        self._across5, _, self._along5 = (last.T @ h5).tolist()
        # Joints 2 to 4 form a triangle.
        self._inner, self._outer, self._tail = (complex(*link[:2]) for link in links[1:])
        self._middle3 = cmath.phase(self._inner * self._outer.conjugate())
        self._product = 2.0 * abs(self._inner) * abs(self._outer)
        self._squares = abs(self._inner) ** 2 + abs(self._outer) ** 2

    @classmethod
    def of(cls, axes: Array, points: Array, tip: Array) -> Self | None:
        """Read the geometry; see `closed_form`. Return None when the arm is not of this kind."""
        if len(axes) != 6 or any(abs(axes[i] @ axes[j]) > 1.0 - NEARLY for i, j in ((0, 1), (3, 4), (4, 5))):
            return None
        moved = np.array(points, dtype=np.float64)
        gap, moved[4], _ = nearest_points(points[4], axes[4], points[5], axes[5])
        moved[5] = moved[4]
        deviation = max(gap, *(float(np.linalg.norm(np.cross(axes[1], axes[i]))) for i in (2, 3)))
        return cls(axes, moved, tip) if deviation < NEARLY else None

    def nearest(self, target: Array, seed: Values, lower: Values, upper: Values) -> Iterator[Values]:
        """Yield the configurations that move the tip to a pose (4, 4), nearest to the seed first.

        Each angle is shifted by whole turns, as `nearest_turn` does. At a singularity, where only the sum of two joints
        is determined, one of them is taken from the seed. The distance of joints 1, 5 and 6 from the seed
        determines for which of them the other joints are computed first.
        """
        started = sorted(self._started(target, seed, lower, upper), key=itemgetter(0))
        ready: list[tuple[float, Values]] = []
        for number, (distance, q1, q5, q6, q14, to) in enumerate(started, 1):
            for q3 in around(self._middle3, (abs(to) ** 2 - self._squares) / self._product):
                q2 = cmath.phase(to * (self._inner + self._outer * cmath.rect(1.0, q3)).conjugate())
                q4 = nearest_turn(self._sign4 * (q14 - q2 - q3), seed[3], lower[3], upper[3])
                q3 = nearest_turn(self._sign3 * q3, seed[2], lower[2], upper[2])
                q2 = nearest_turn(q2, seed[1], lower[1], upper[1])
                more = (q2 - seed[1]) ** 2 + (q3 - seed[2]) ** 2 + (q4 - seed[3]) ** 2
                ready.append((distance + more, (q1, q2, q3, q4, q5, q6)))
            ready.sort(reverse=True)
            enough = started[number][0] if number < len(started) else math.inf
            while ready and ready[-1][0] <= enough:
                yield ready.pop()[1]

    def _started(self, target: Array, seed: Values, lower: Values, upper: Values) -> Iterator[_Started]:
        """Yield joints 1, 5 and 6, and the remaining target of joints 2 to 4."""
        numbers = self._linear.dot(target.reshape(16)).view(np.complex128).tolist()
        cosine, sine, constant = numbers[:6], numbers[6:12], numbers[12:]
        for q1 in solved(cosine[5].imag, sine[5].imag, -constant[5].imag, seed[0]):
            c, s = math.cos(q1), math.sin(q1)
            x, y, z, shoulder, across, last = [
                c * a + s * b + d for a, b, d in zip(cosine, sine, constant, strict=True)
            ]
            q1 = nearest_turn(q1, seed[0], lower[0], upper[0])
            for q5 in around(self._middle5, (last.real - self._height5) / self._size5):
                axis = self._cosine6 * math.cos(q5) + self._sine6 * math.sin(q5) + self._constant6
                q5 = nearest_turn(q5, seed[4], lower[4], upper[4])
                apart = axis * across.conjugate()
                if abs(apart) >= SINGULAR:
                    sixth: Values = (cmath.phase(apart),)
                else:
                    sixth = self._free(x, y, z, shoulder, last.real, seed[5])
                for q6 in sixth:
                    q14 = self._sum(x, y, z, q6)
                    to = shoulder - self._tail * cmath.rect(1.0, q14)
                    q6 = nearest_turn(q6, seed[5], lower[5], upper[5])
                    distance = (q1 - seed[0]) ** 2 + (q5 - seed[4]) ** 2 + (q6 - seed[5]) ** 2
                    yield distance, q1, q5, q6, q14, to

    def _sum(self, x: complex, y: complex, z: complex, q6: float) -> float:
        """Return the angle by which joints 2 to 4 rotate together, for one of joint 6."""
        out = cmath.rect(self._across5, -q6)
        return cmath.phase(x * out.real + y * out.imag + z * self._along5)

    def _free(self, x: complex, y: complex, z: complex, shoulder: complex, height: float, if_free: float) -> Values:
        """Return angles of joint 6 where its axis is parallel to those of joints 2 to 4, and only their sum counts.

        These are `if_free`, and the angles at which the links just reach the target, because they may not reach it with
        `if_free`.
        """
        far, short = abs(shoulder), abs(self._tail)
        if min(far, short) < TINY:
            return (if_free,)
        longest = abs(self._inner) + abs(self._outer)
        half = math.acos(max(-1.0, min(1.0, (far * far + short * short - longest * longest) / (2.0 * far * short))))
        more = self._sum(x, y, z, if_free) - cmath.phase(shoulder * self._tail.conjugate())
        return (if_free, *(if_free + math.copysign(1.0, height) * (more - part * half) for part in (-1, 0, 1)))


class SphericalWrist:
    """Geometry of an arm with a spherical wrist. Created by `of`; `nearest` yields up to eight configurations."""

    def __init__(self, axes: Array, points: Array, wrist: Array, tip: Array) -> None:
        self._h1, self._h2, _, self._h4, self._h5, self._h6 = (vector(axis) for axis in axes)
        self._sign3 = 1.0 if axes[1] @ axes[2] > 0.0 else -1.0
        self._origin = vector(points[0])
        self._p12, self._p23 = vector(points[1] - points[0]), vector(points[2] - points[1])
        self._p34 = vector(wrist - points[2])
        self._beside = dot(self._h2, add(self._p12, self._p23, self._p34))
        self._offset = vector(tip[:3, :3].T @ (wrist - tip[:3, 3]))
        self._tip_turn = rows_of(tip[:3, :3])
        across = np.cross(axes[5], axes[4])
        self._across_last = vector(across / np.linalg.norm(across))

    @classmethod
    def of(cls, axes: Array, points: Array, tip: Array) -> Self | None:
        """Read the geometry; see `closed_form`. Return None when the arm is not of this kind."""
        if len(axes) != 6 or any(abs(axes[i] @ axes[j]) > 1.0 - NEARLY for i, j in ((0, 1), (3, 4), (4, 5))):
            return None
        gap, wrist, _ = nearest_points(points[3], axes[3], points[4], axes[4])
        other_gap, other, _ = nearest_points(points[4], axes[4], points[5], axes[5])
        parallel = float(np.linalg.norm(np.cross(axes[1], axes[2])))
        deviation = max(gap, other_gap, float(np.linalg.norm(other - wrist)), parallel)
        return cls(axes, points, wrist, tip) if deviation < NEARLY else None

    def nearest(self, target: Array, seed: Values, lower: Values, upper: Values) -> Iterator[Values]:
        """Yield the configurations that move the tip to a pose (4, 4), nearest to the seed first.

        Each angle is shifted by whole turns, as `nearest_turn` does. At a singularity, where only the sum of two joints
        is determined, one of them is taken from the seed.
        """
        turn = product(rows_of(target[:3, :3]), transposed(self._tip_turn))
        wrist = subtract(add(vector(target[:3, 3]), turned(rows_of(target[:3, :3]), self._offset)), self._origin)
        found = [
            tuple(map(nearest_turn, angles, seed, lower, upper)) for angles in self._all(turn, wrist, seed[0], seed[3])
        ]
        yield from sorted(found, key=lambda q: math.dist(q, seed))

    def _all(self, turn: Rows, wrist: Vector, q1_if_free: float, q4_if_free: float) -> Iterator[Values]:
        h1, h2 = self._h1, self._h2
        for q1 in level(h1, wrist, h2, self._beside, q1_if_free, backwards=True):
            shoulder = subtract(rotated_about(h1, -q1, wrist), self._p12)
            for q3 in folded(h2, self._p34, self._p23, shoulder):
                q2 = between(h2, add(self._p23, rotated_about(h2, q3, self._p34)), shoulder, 0.0)
                of_wrist = product(rotation(h2, -q2 - q3), product(rotation(h1, -q1), turn))
                for angles in self._wrist(of_wrist, q4_if_free):
                    yield q1, q2, self._sign3 * q3, *angles

    def _wrist(self, turn: Rows, q4_if_free: float) -> Iterator[Vector]:
        h4, h5, h6 = self._h4, self._h5, self._h6
        last = turned(turn, h6)
        for q5 in level(h5, h6, h4, dot(h4, last), 0.0):
            q4 = between(h4, rotated_about(h5, q5, h6), last, q4_if_free)
            aside = rotated_about(h5, -q5, rotated_about(h4, -q4, turned(turn, self._across_last)))
            yield q4, q5, between(h6, self._across_last, aside, 0.0)


def closed_form(axes: Array, points: Array, tip: Array) -> ThreeParallel | SphericalWrist | None:
    """Recognize the kind of an arm.

    Args:
        axes: Unit axes of its joints at zero angles, (6, 3).
        points: Points on the axes at zero angles, (6, 3), m.
        tip: Pose of its tip at zero angles, (4, 4).

    Returns:
        None for other kinds.
    """
    return ThreeParallel.of(axes, points, tip) or SphericalWrist.of(axes, points, tip)


def _frame(z: Array, towards: Array) -> Array:
    """Return a frame (3, 3) with a z axis and another vector in the plane of its x and z axes."""
    x = towards - z * (z @ towards)
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(z, x), z))
