"""Motions along a path: movej and movel with trapezoidal speed, and the blends between two of a kind."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from arcor2_fakes.ur.kinematics import Transform, compose, difference, from_pose, invert

if TYPE_CHECKING:
    from arcor2_fakes.ur.motion import Arm

Joints = Sequence[float]


class MotionRefused(Exception):
    """The controller refuses to continue, with a protective stop."""


class Profile:
    """A trapezoidal (or triangular) velocity profile over `length`, with standstill at both ends."""

    def __init__(self, length: float, velocity: float, acceleration: float) -> None:
        self.length = length
        self.acceleration = acceleration
        self.peak = min(velocity, math.sqrt(length * acceleration)) if length > 0.0 else 0.0
        self.ramp = self.peak / acceleration
        cruise = (length - self.peak * self.ramp) / self.peak if self.peak > 0.0 else 0.0
        self.duration = 2.0 * self.ramp + cruise

    def position(self, t: float) -> float:
        """Return distance covered after `t` seconds."""
        if t >= self.duration:
            return self.length
        if t < self.ramp:
            return 0.5 * self.acceleration * t * t
        left = self.duration - t
        if left < self.ramp:
            return self.length - 0.5 * self.acceleration * left * left
        return self.peak * (t - 0.5 * self.ramp)


class JointMove:
    """movej: all joints start and end together; the one with the longest distance keeps the limits."""

    along_path = True

    def __init__(self, start: Joints, goal: Joints, velocity: float, acceleration: float) -> None:
        self._start, self.goal = tuple(start), tuple(goal)
        self._way = tuple(g - s for s, g in zip(start, goal, strict=True))
        self.profile = Profile(max(map(abs, self._way)), velocity, acceleration)
        self._t = 0.0
        self.done = self.profile.length == 0.0

    def step(self, _: "Arm", dt: float) -> Joints:
        """Return positions after `dt` seconds."""
        self.done = self.done or self._t >= self.profile.duration  # one cycle at the goal: the velocity is then zero
        self._t += dt
        if self._t >= self.profile.duration:
            return self.goal
        f = self.profile.position(self._t) / self.profile.length
        return [s + f * w for s, w in zip(self._start, self._way, strict=True)]

    @property
    def braking(self) -> bool:
        """Return whether the motion decelerates towards its end."""
        return self._t >= self.profile.duration - self.profile.ramp


class JointBlend:
    """The end of one movej overlaid with the start of the next, so that the arm rounds the corner."""

    along_path = True

    def __init__(self, leaving: "JointMove | JointBlend", entering: JointMove) -> None:
        self._leaving, self._entering = leaving, entering
        self._corner: tuple[float, ...] = leaving.goal
        self.goal: tuple[float, ...] = entering.goal
        self.done = False

    def step(self, arm: "Arm", dt: float) -> Joints:
        """Return positions after `dt` seconds."""
        parts = zip(self._leaving.step(arm, dt), self._entering.step(arm, dt), self._corner, strict=True)
        q = [a + b - corner for a, b, corner in parts]
        self.done = self._leaving.done and self._entering.done
        return q

    @property
    def braking(self) -> bool:
        """Return whether the motion decelerates towards its end."""
        return self._leaving.done and self._entering.braking


class LinearMove:
    """movel: the TCP moves in a straight line at the given speed, rotating evenly."""

    along_path = True

    def __init__(self, start: Transform, goal: Transform, velocity: float, acceleration: float) -> None:
        self._start, self.goal = start, goal
        self._shift, self._turn = difference(self._start, goal)
        length = math.dist((0.0, 0.0, 0.0), self._shift)
        if length < 1e-6:  # rotation only: the limits are in rad
            length = math.dist((0.0, 0.0, 0.0), self._turn)
        self.profile = Profile(length, velocity, acceleration)
        self._t = 0.0
        self.done = length < 1e-9

    def pose(self, dt: float) -> Transform:
        """Return set point of the TCP after `dt` seconds."""
        if self.done:
            return self.goal
        self.done = self._t >= self.profile.duration  # one cycle at the goal: the velocity is then zero
        self._t += dt
        f = self.profile.position(self._t) / self.profile.length
        x, y, z, origin = self._start
        turned = compose(from_pose((0.0, 0.0, 0.0, *(f * r for r in self._turn))), (x, y, z, (0.0, 0.0, 0.0)))
        there = (origin[0] + f * self._shift[0], origin[1] + f * self._shift[1], origin[2] + f * self._shift[2])
        return (turned[0], turned[1], turned[2], there)

    def step(self, arm: "Arm", dt: float) -> Joints:
        """Return positions after `dt` seconds. Raise `MotionRefused` in a singularity or out of reach."""
        if self.done or dt == 0.0:
            return arm.q
        return _follow(arm, self.pose(dt))

    @property
    def braking(self) -> bool:
        """Return whether the motion decelerates towards its end."""
        return self._t >= self.profile.duration - self.profile.ramp


class LinearBlend:
    """The end of one movel overlaid with the start of the next, in position and orientation."""

    along_path = True

    def __init__(self, leaving: "LinearMove | LinearBlend", entering: LinearMove) -> None:
        self._leaving, self._entering = leaving, entering
        self._corner: Transform = leaving.goal
        self.goal: Transform = entering.goal
        self.done = False

    def pose(self, dt: float) -> Transform:
        """Return set point of the TCP after `dt` seconds."""
        a, b, corner = self._leaving.pose(dt), self._entering.pose(dt), self._corner
        back = invert((corner[0], corner[1], corner[2], (0.0, 0.0, 0.0)))
        x, y, z, _ = compose(compose((b[0], b[1], b[2], (0.0, 0.0, 0.0)), back), (a[0], a[1], a[2], (0.0, 0.0, 0.0)))
        self.done = self._leaving.done and self._entering.done
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = a[3], b[3], corner[3]
        return (x, y, z, (ax + bx - cx, ay + by - cy, az + bz - cz))

    def step(self, arm: "Arm", dt: float) -> Joints:
        """Return positions after `dt` seconds. Raise `MotionRefused` in a singularity or out of reach."""
        return arm.q if self.done or dt == 0.0 else _follow(arm, self.pose(dt))

    @property
    def braking(self) -> bool:
        """Return whether the motion decelerates towards its end."""
        return self._leaving.done and self._entering.braking


def _follow(arm: "Arm", there: Transform) -> Joints:
    guess = [a + v * arm.period for a, v in zip(arm.q, arm.qd, strict=True)]
    q = arm.chain.follow(there, guess)
    if q is None:
        raise MotionRefused("the line leaves the reach of the arm")
    return q
