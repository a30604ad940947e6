"""Motions along a path: movej and movel with trapezoidal speed, and blends between two motions of the same kind."""

import math
from collections.abc import Sequence
from typing import Protocol

from arcor2_fakes.trapezoid import Trapezoid
from arcor2_fakes.ur.kinematics import Chain, Transform, compose, difference, from_pose, invert

Joints = Sequence[float]


class MovingArm(Protocol):
    """The properties of the arm that a path uses."""

    q: tuple[float, ...]
    """Joint positions, rad."""
    qd: tuple[float, ...]
    """Joint velocities, rad/s."""
    period: float
    """Time between two set points, s."""
    chain: Chain


class MotionRefused(Exception):
    """The controller refuses to continue, with a protective stop."""


class _Move:
    """A motion from standstill to standstill."""

    along_path = True

    def __init__(self, profile: Trapezoid) -> None:
        self._profile = profile
        self._t = 0.0
        self.done = profile.distance < 1e-9

    def _advance(self, dt: float) -> float:
        """Return the fraction of the path covered after `dt` seconds."""
        self.done = self.done or self._t >= self._profile.duration  # one cycle at the goal: the velocity is then zero
        self._t += dt
        return self._profile.share(self._t)

    @property
    def braking(self) -> bool:
        """Return whether the motion decelerates towards its end."""
        return self._t >= self._profile.duration - self._profile.ramp


class _Blend:
    """The end of one motion overlaid with the start of the next."""

    along_path = True

    def __init__(self, leaving: "_Move | _Blend", entering: _Move) -> None:
        self._both = leaving, entering

    @property
    def done(self) -> bool:
        """Return whether both motions have ended."""
        return self._both[0].done and self._both[1].done

    @property
    def braking(self) -> bool:
        """Return whether the motion decelerates towards its end."""
        return self._both[0].done and self._both[1].braking


class JointMove(_Move):
    """movej: all joints start and end together; the one with the longest distance keeps the limits."""

    def __init__(self, start: Joints, goal: Joints, velocity: float, acceleration: float) -> None:
        self._start, self.goal = tuple(start), tuple(goal)
        self._way = tuple(g - s for s, g in zip(start, goal, strict=True))
        super().__init__(Trapezoid(max(map(abs, self._way)), velocity, acceleration))

    def step(self, _: MovingArm, dt: float) -> Joints:
        """Return positions after `dt` seconds."""
        f = self._advance(dt)
        return self.goal if f == 1.0 else [s + f * w for s, w in zip(self._start, self._way, strict=True)]


class JointBlend(_Blend):
    """The end of one movej overlaid with the start of the next, so that the arm rounds the corner."""

    def __init__(self, leaving: "JointMove | JointBlend", entering: JointMove) -> None:
        super().__init__(leaving, entering)
        self._leaving, self._entering = leaving, entering
        self.goal: tuple[float, ...] = entering.goal

    def step(self, arm: MovingArm, dt: float) -> Joints:
        """Return positions after `dt` seconds."""
        corner: tuple[float, ...] = self._leaving.goal
        parts = zip(self._leaving.step(arm, dt), self._entering.step(arm, dt), corner, strict=True)
        return [a + b - c for a, b, c in parts]


class LinearMove(_Move):
    """movel: the TCP moves in a straight line at the given speed, rotating evenly."""

    def __init__(self, start: Transform, goal: Transform, velocity: float, acceleration: float) -> None:
        self._start, self.goal = start, goal
        self._shift, self._turn = difference(start, goal)
        length = math.hypot(*self._shift)
        if length < 1e-6:  # rotation only: the limits are in rad
            length = math.hypot(*self._turn)
        super().__init__(Trapezoid(length, velocity, acceleration))

    def pose(self, dt: float) -> Transform:
        """Return the set point of the TCP after `dt` seconds."""
        if self.done:
            return self.goal
        f = self._advance(dt)
        x, y, z, origin = self._start
        turned = compose(from_pose((0.0, 0.0, 0.0, *(f * r for r in self._turn))), (x, y, z, (0.0, 0.0, 0.0)))
        there = (origin[0] + f * self._shift[0], origin[1] + f * self._shift[1], origin[2] + f * self._shift[2])
        return (turned[0], turned[1], turned[2], there)

    def step(self, arm: MovingArm, dt: float) -> Joints:
        """Return positions after `dt` seconds. Raise `MotionRefused` in a singularity or out of reach."""
        return _follow(arm, self, dt)


class LinearBlend(_Blend):
    """The end of one movel overlaid with the start of the next, in position and orientation."""

    def __init__(self, leaving: "LinearMove | LinearBlend", entering: LinearMove) -> None:
        super().__init__(leaving, entering)
        self._leaving, self._entering = leaving, entering
        self.goal: Transform = entering.goal

    def pose(self, dt: float) -> Transform:
        """Return the set point of the TCP after `dt` seconds."""
        corner: Transform = self._leaving.goal
        a, b = self._leaving.pose(dt), self._entering.pose(dt)
        back = invert((corner[0], corner[1], corner[2], (0.0, 0.0, 0.0)))
        x, y, z, _ = compose(compose((b[0], b[1], b[2], (0.0, 0.0, 0.0)), back), (a[0], a[1], a[2], (0.0, 0.0, 0.0)))
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = a[3], b[3], corner[3]
        return (x, y, z, (ax + bx - cx, ay + by - cy, az + bz - cz))

    def step(self, arm: MovingArm, dt: float) -> Joints:
        """Return positions after `dt` seconds. Raise `MotionRefused` in a singularity or out of reach."""
        return _follow(arm, self, dt)


def _follow(arm: MovingArm, motion: LinearMove | LinearBlend, dt: float) -> Joints:
    if motion.done or dt == 0.0:
        return arm.q
    guess = [a + v * arm.period for a, v in zip(arm.q, arm.qd, strict=True)]
    q = arm.chain.follow(motion.pose(dt), guess)
    if q is None:
        raise MotionRefused("the line leaves the reach of the arm")
    return q
