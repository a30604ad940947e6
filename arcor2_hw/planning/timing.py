"""Trajectories: point to point (ruckig) and along waypoints (toppra), within limits of velocity and acceleration."""

import bisect
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Trajectory as RuckigTrajectory

from arcor2_hw.exceptions import InvalidData
from arcor2_hw.kinematics.arm import Arm
from arcor2_hw.kinematics.shapes import Array

RAMP: Final = 0.4
"""Time in which a joint reaches its maximum velocity, s. A URDF states no accelerations."""
JERK_RAMP: Final = 0.1
"""Time in which a joint reaches its maximum acceleration, s."""
FASTEST: Final = 10.0
"""Velocity of a joint without a velocity limit, rad/s or m/s."""
_STANDS: Final = 1e-7


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Maxima of joints, each an array (n) of values above zero.

    Attributes:
        velocity: rad/s or m/s.
        acceleration: rad/s² or m/s².
        jerk: rad/s³ or m/s³.
    """

    velocity: Array
    acceleration: Array
    jerk: Array

    def __post_init__(self) -> None:
        for name, values in vars(self).items():
            if values.shape != self.velocity.shape or not (np.isfinite(values) & (values > 0.0)).all():
                raise InvalidData("The {name} of each joint must be above zero.", name=name)

    @classmethod
    def of(cls, arm: Arm, speed: float = 1.0, ramp: float = RAMP) -> "MotionLimits":
        """Return the limits of an arm.

        Args:
            arm: The arm.
            speed: Fraction of its maximum velocities, above 0, at most 1.
            ramp: Time from standstill to the maximum velocity, s.

        Raises:
            InvalidData: `speed` is out of range.
        """
        if not 0.0 < speed <= 1.0:
            raise InvalidData("speed must be above 0 and at most 1, not {speed!r}.", speed=speed)
        most = np.where(np.isfinite(arm.velocity) & (arm.velocity > 0.0), arm.velocity, FASTEST)
        return cls(most * speed, most / ramp, most / (ramp * JERK_RAMP))


class Trajectory:
    """Joint values over time, created by `point_to_point`, `with_stops` or `along_line`.

    Attributes:
        duration: Duration, s.
    """

    def __init__(self, pieces: Sequence[tuple[float, Callable[[float], tuple[Array, Array]]]]) -> None:
        self._pieces = [piece for _, piece in pieces]
        self._lengths = [length for length, _ in pieces]
        self._begins = [0.0, *itertools.accumulate(self._lengths)][: len(self._pieces)]
        self.duration = float(sum(self._lengths))

    def at(self, time: float) -> tuple[Array, Array]:
        """Return joint values and velocities at a time in s; outside the trajectory, those at standstill."""
        time = min(max(time, 0.0), self.duration)
        number = max(0, bisect.bisect_right(self._begins, time) - 1)
        return self._pieces[number](min(time - self._begins[number], self._lengths[number]))

    def sampled(self, period: float) -> list[tuple[float, Array, Array]]:
        """Return time, joint values and velocities every `period` s and at the end."""
        times = [*np.arange(0.0, self.duration, period), self.duration]
        return [(float(time), *self.at(float(time))) for time in times]


# ------------------------------------------------------------------------------------------------ point to point
def point_to_point(start: Array, goal: Array, limits: MotionLimits) -> Trajectory:
    """Return a trajectory from standstill to standstill, all joints in proportion, limited in jerk."""
    return Trajectory([_segment(start, goal, limits)])


def with_stops(path: Sequence[Array], limits: MotionLimits) -> Trajectory:
    """Return a trajectory that stops at each waypoint, so that it follows the path exactly."""
    return Trajectory([_segment(a, b, limits) for a, b in itertools.pairwise(path)])


def _segment(start: Array, goal: Array, limits: MotionLimits) -> tuple[float, Callable[[float], tuple[Array, Array]]]:
    way = goal - start
    size = np.abs(way)
    moving = size > _STANDS
    if not moving.any():
        return 0.0, lambda _: (goal, np.zeros_like(goal))
    # One parameter goes from 0 to 1 within the limits of the slowest joint, so that no joint leaves the straight line.
    given = InputParameter(1)
    given.current_position, given.target_position = [0.0], [1.0]
    given.max_velocity = [float(np.min(limits.velocity[moving] / size[moving]))]
    given.max_acceleration = [float(np.min(limits.acceleration[moving] / size[moving]))]
    given.max_jerk = [float(np.min(limits.jerk[moving] / size[moving]))]
    found = RuckigTrajectory(1)
    result = Ruckig(1).calculate(given, found)
    if result not in (Result.Working, Result.Finished):
        raise InvalidData("No motion within the limits was found: {result}.", result=result)

    def at(time: float) -> tuple[Array, Array]:
        position, velocity, _ = found.at_time(time)
        return start + position[0] * way, velocity[0] * way

    return float(found.duration), at


# ------------------------------------------------------------------------------------------------ waypoints
def along_line(
    path: Sequence[Array], limits: MotionLimits, lengths: Sequence[float], speed: float, acceleration: float
) -> Trajectory:
    """Return a trajectory along closely spaced waypoints of a line.

    Args:
        path: Waypoints.
        limits: Limits of the joints.
        lengths: Distance of the end effector along the line at each waypoint, m.
        speed: Maximum speed of the end effector along the line, m/s.
        acceleration: Maximum acceleration of the end effector along the line, m/s².

    Raises:
        InvalidData: The numbers of waypoints and lengths differ, or speed or acceleration is not above zero.
    """
    if len(lengths) != len(path) or not (speed > 0.0 and acceleration > 0.0):
        raise InvalidData("A line needs a length at each waypoint, and a speed and an acceleration above zero.")
    # The distance along the line is treated as one more joint with limits of its own.
    longer = [np.append(q, length) for q, length in zip(path, lengths, strict=True)]
    velocity, ramp = np.append(limits.velocity, speed), np.append(limits.acceleration, acceleration)
    duration, at = _along(longer, MotionLimits(velocity, ramp, ramp))

    def without(time: float) -> tuple[Array, Array]:
        q, rate = at(time)
        return q[:-1], rate[:-1]

    return Trajectory([(duration, without)])


def _along(way: Sequence[Array], limits: MotionLimits) -> tuple[float, Callable[[float], tuple[Array, Array]]]:
    """Return the fastest motion along a smooth path from standstill to standstill within the limits."""
    import toppra
    from toppra import algorithm, constraint

    points = [way[0]]
    for q in way[1:]:
        if float(np.abs(q - points[-1]).max()) > _STANDS:
            points.append(q)
    if len(points) < 3:
        return _segment(points[0], points[-1], limits)
    steps = [float(np.linalg.norm((b - a) / limits.velocity)) for a, b in itertools.pairwise(points)]
    at = np.concatenate(([0.0], np.cumsum(steps)))
    path: Any = toppra.SplineInterpolator(at, np.array(points), bc_type="natural")
    velocity = np.stack((-limits.velocity, limits.velocity), axis=1)
    acceleration = np.stack((-limits.acceleration, limits.acceleration), axis=1)
    solver = algorithm.TOPPRA(
        [constraint.JointVelocityConstraint(velocity), constraint.JointAccelerationConstraint(acceleration)],
        path,
        gridpoints=np.unique(np.concatenate([np.linspace(a, b, 6) for a, b in itertools.pairwise(at)])),
        parametrizer="ParametrizeConstAccel",
    )
    found: Any = solver.compute_trajectory(0.0, 0.0)
    if found is None:
        raise InvalidData("No motion within the limits was found along the path.")

    def where(time: float) -> tuple[Array, Array]:
        return np.asarray(found(time), dtype=np.float64), np.asarray(found(time, 1), dtype=np.float64)

    return float(found.duration), where
