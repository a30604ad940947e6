"""Closed-form inverse kinematics of two kinds of arm with six revolute joints.

`ThreeParallel`: axes 2, 3 and 4 are parallel and axes 5 and 6 meet, as in the UR. `SphericalWrist`: axes 2 and 3 are
parallel and the last three meet, as in most industrial arms. The kind is recognized by the axes.

The decomposition follows A. J. Elias and J. T. Wen, "IK-Geo" (2022). Joint 1 follows from the height of the wrist
above the plane of the arm. For the first kind, joint 5 follows from the direction of the last axis, joint 6 from that
of the parallel axes, and a triangle remains; for the second kind, the triangle comes first and the three angles of
the wrist remain. The axes of a calibrated arm are not exactly parallel: results are then approximate.
"""

import math
from collections.abc import Iterator
from typing import Final, Self

import numpy as np

from arcor2_hw.kinematics.shapes import Array
from arcor2_hw.kinematics.subproblems import (
    SINGULAR,
    TINY,
    Rows,
    Six,
    Vector,
    add,
    between,
    cross,
    dot,
    folded,
    level,
    nearest_points,
    product,
    rotation,
    rows_of,
    scaled,
    spun,
    subtract,
    transposed,
    turned,
    vector,
)

NEARLY: Final = 0.02
"""Maximum deviation of the axes from the ideal geometry, rad and m; calibrations deviate less."""


class ThreeParallel:
    """Geometry of an arm with three parallel axes. Created by `of`; `solve` returns up to eight configurations.

    It consists of unit axes h, and points p on each axis relative to the previous one, at zero angles.
    """

    def __init__(self, axes: Array, points: Array, tip: Array) -> None:
        self._h1, self._h2, _, _, self._h5, self._h6 = (vector(axis) for axis in axes)
        # Points are moved along the axes so that 1 and 2, and 5 and 6, share an origin where they can. An axis in the
        # opposite direction changes the sign of the angle.
        self._sign3, self._sign4 = (1.0 if axes[1] @ axes[i] > 0.0 else -1.0 for i in (2, 3))
        self._origin = vector(points[0])
        self._p12, self._p23, self._p34, self._p45 = (vector(points[i + 1] - points[i]) for i in range(4))
        self._tip = np.array(tip)
        self._p6t = points[5] - tip[:3, 3]
        self._beside = dot(self._h2, add(self._p12, self._p23, self._p34, self._p45))
        self._offset = vector(tip[:3, :3].T @ self._p6t)
        self._tip_turn = rows_of(tip[:3, :3])

    @classmethod
    def of(cls, axes: Array, points: Array, tip: Array) -> Self | None:
        """Read the geometry from axes (6, 3), points on them (6, 3) and the tip (4, 4), all at zero angles.

        Returns:
            None when the arm is not of this kind.
        """
        if len(axes) != 6:
            return None
        parallel = all(np.linalg.norm(np.cross(axes[1], axes[i])) < NEARLY for i in (2, 3))
        across = all(abs(axes[i] @ axes[j]) < 1.0 - NEARLY for i, j in ((0, 1), (3, 4), (4, 5)))
        if not parallel or not across:
            return None
        moved = np.array(points, dtype=np.float64)
        gap, moved[4], _ = nearest_points(points[4], axes[4], points[5], axes[5])
        if gap > NEARLY:
            return None
        moved[5] = moved[4]
        return cls(axes, moved, tip)

    def solve(self, target: Array, seed: Array) -> list[Six]:
        """Return the configurations, angles from -pi to pi, that move the tip to a pose (4, 4).

        At a singularity, where only the sum of two joints is determined, one of them is taken from the seed.
        """
        turn = product(rows_of(target[:3, :3]), transposed(self._tip_turn))
        position = (float(target[0, 3]), float(target[1, 3]), float(target[2, 3]))
        wrist = subtract(add(position, turned(rows_of(target[:3, :3]), self._offset)), self._origin)
        return list(self._all(turn, wrist, float(seed[0]), float(seed[5])))

    def _all(self, turn: Rows, wrist: Vector, q1_if_free: float, q6_if_free: float) -> Iterator[Six]:
        h1, h2, h5, h6 = self._h1, self._h2, self._h5, self._h6
        for q1 in level(h1, wrist, h2, self._beside, q1_if_free, backwards=True):
            rest_of_turn = product(rotation(h1, -q1), turn)  # of joints 2 to 6
            back = turned(transposed(rest_of_turn), h2)
            shoulder = subtract(spun(h1, -q1, wrist), self._p12)
            for q5 in level(h5, h6, h2, dot(h2, turned(rest_of_turn, h6)), 0.0):
                for q6 in self._last(q5, back, q6_if_free, rest_of_turn, shoulder):
                    q14 = between(h2, h5, turned(rest_of_turn, spun(h6, -q6, h5)), 0.0)
                    rest = subtract(shoulder, spun(h2, q14, self._p45))
                    for q3 in folded(h2, self._p34, self._p23, rest):
                        bent = add(self._p23, spun(h2, q3, self._p34))
                        q2 = between(h2, bent, rest, 0.0)
                        q4 = math.remainder(q14 - q2 - q3, math.tau)
                        yield q1, q2, self._sign3 * q3, self._sign4 * q4, q5, q6

    def _last(self, q5: float, back: Vector, if_free: float, rest_of_turn: Rows, shoulder: Vector) -> list[float]:
        """Return the angles of joint 6. It is undetermined where its axis is parallel to those of joints 2 to 4.

        Then the result is `if_free`, and the angles at which the links just reach, since they may not with the former.
        """
        h2, h5, h6 = self._h2, self._h5, self._h6
        v = spun(h5, -q5, h2)
        across = cross(h6, v)
        sine, cosine = dot(across, back), dot(cross(across, h6), back)
        if math.hypot(sine, cosine) >= SINGULAR:
            return [-math.atan2(sine, cosine)]
        q14 = between(h2, h5, turned(rest_of_turn, spun(h6, -if_free, h5)), 0.0)
        to, tail = (subtract(each, scaled(h2, dot(h2, each))) for each in (shoulder, self._p45))
        far, short = math.hypot(*to), math.hypot(*tail)
        longest = math.hypot(*self._p23) + math.hypot(*self._p34)
        found = [if_free]
        if min(far, short) > TINY:
            share = (far * far + short * short - longest * longest) / (2.0 * far * short)
            middle, half = between(h2, tail, to, 0.0), math.acos(max(-1.0, min(1.0, share)))
            sign = math.copysign(1.0, dot(h2, spun(h5, q5, h6)))
            # Joints 2 to 4 and joint 6 rotate about parallel axes, so that their angles add up.
            found += [math.remainder(if_free + sign * (q14 - middle - part * half), math.tau) for part in (-1, 0, 1)]
        return found


class SphericalWrist:
    """Geometry of an arm with a spherical wrist. Created by `of`; `solve` returns up to eight configurations."""

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
        """Read the geometry from axes (6, 3), points on them (6, 3) and the tip (4, 4), all at zero angles.

        Returns:
            None when the arm is not of this kind.
        """
        if len(axes) != 6 or np.linalg.norm(np.cross(axes[1], axes[2])) > NEARLY:
            return None
        if any(abs(axes[i] @ axes[j]) > 1.0 - NEARLY for i, j in ((0, 1), (3, 4), (4, 5))):
            return None
        gap, wrist, _ = nearest_points(points[3], axes[3], points[4], axes[4])
        other_gap, other, _ = nearest_points(points[4], axes[4], points[5], axes[5])
        if max(gap, other_gap, float(np.linalg.norm(other - wrist))) > NEARLY:
            return None
        return cls(axes, points, wrist, tip)

    def solve(self, target: Array, seed: Array) -> list[Six]:
        """Return the configurations, angles from -pi to pi, that move the tip to a pose (4, 4).

        At a singularity, where only the sum of two joints is determined, one of them is taken from the seed.
        """
        turn = product(rows_of(target[:3, :3]), transposed(self._tip_turn))
        wrist = subtract(add(vector(target[:3, 3]), turned(rows_of(target[:3, :3]), self._offset)), self._origin)
        return list(self._all(turn, wrist, float(seed[0]), float(seed[3])))

    def _all(self, turn: Rows, wrist: Vector, q1_if_free: float, q4_if_free: float) -> Iterator[Six]:
        h1, h2 = self._h1, self._h2
        for q1 in level(h1, wrist, h2, self._beside, q1_if_free, backwards=True):
            shoulder = subtract(spun(h1, -q1, wrist), self._p12)
            for q3 in folded(h2, self._p34, self._p23, shoulder):
                q2 = between(h2, add(self._p23, spun(h2, q3, self._p34)), shoulder, 0.0)
                of_wrist = product(rotation(h2, -q2 - q3), product(rotation(h1, -q1), turn))
                for angles in self._wrist(of_wrist, q4_if_free):
                    yield q1, q2, self._sign3 * q3, *angles

    def _wrist(self, turn: Rows, q4_if_free: float) -> Iterator[Vector]:
        h4, h5, h6 = self._h4, self._h5, self._h6
        last = turned(turn, h6)
        for q5 in level(h5, h6, h4, dot(h4, last), 0.0):
            q4 = between(h4, spun(h5, q5, h6), last, q4_if_free)
            aside = spun(h5, -q5, spun(h4, -q4, turned(turn, self._across_last)))
            yield q4, q5, between(h6, self._across_last, aside, 0.0)


def closed_form(axes: Array, points: Array, tip: Array) -> ThreeParallel | SphericalWrist | None:
    """Recognize the kind of an arm by axes (6, 3), points on them (6, 3) and the tip (4, 4); None for others."""
    return ThreeParallel.of(axes, points, tip) or SphericalWrist.of(axes, points, tip)
