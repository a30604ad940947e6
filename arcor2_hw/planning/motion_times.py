"""Times of motions that robots execute by themselves, with checks of reach and collisions along their paths.

The times are those of an ideal controller: all joints arrive together, with the maxima that the settings of the robot
state and otherwise those of its model. Communication, settling and blending are not included.
"""

import itertools
import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from arcor2_hw.collision.sweep import Hit, Sweep
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint, RobotMaxima
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.kinematics.arm import Arm
from arcor2_hw.kinematics.errors import OutOfReach
from arcor2_hw.kinematics.inverse import InverseKinematics
from arcor2_hw.kinematics.shapes import Array
from arcor2_hw.messages import Message
from arcor2_hw.planning.paths import straight_line
from arcor2_hw.planning.planner import Planner
from arcor2_hw.planning.reachability import why_out_of_reach
from arcor2_hw.planning.timing import FASTEST, JERK_RAMP, RAMP, MotionLimits, with_stops

RESOLUTION: Final = 0.02
"""Maximum travel of any point of the robot between two checked configurations, m."""
FARTHEST: Final = 0.16
"""Maximum travel covered by one check with an enlarged margin, m. It is long, because most paths are free."""
TOLERANCE_FACTOR: Final = 4.0
"""Factor on the tolerances of `straight_line`: the waypoints are only checked, not followed."""
SUFFICIENT_CLEARANCE: Final = 0.3
"""Clearance above which configurations are equally good, m."""
_STANDS: Final = 1e-6


def trapezoid_time(distance: float, speed: float, acceleration: float) -> float:
    """Return the duration of a motion from standstill to standstill with a trapezoidal speed profile, s."""
    if distance <= _STANDS:
        return 0.0
    ramp = speed * speed / acceleration
    if distance >= ramp:
        return distance / speed + speed / acceleration
    return 2.0 * math.sqrt(distance / acceleration)


class Outcome(NamedTuple):
    """The result of a motion.

    Attributes:
        q: Joint values at the end; those at the start if the target is out of reach.
        seconds: Duration, None if there is no path.
        reason: Reason why the motion would fail, None if it succeeds.
        place: Pose of the end effector in the world where it would fail.
    """

    q: Array
    seconds: float | None
    reason: Message | None = None
    place: Pose | None = None


class MotionTimer:
    """Times and checks motions of one arm of a robot. Joint values are those of the arm. Not safe for threads.

    Args:
        sweep: Collision checks of the arm, of RESOLUTION.
        base: Root link in the world.
        name: Name of the robot in messages.
        maxima: Maxima at speed 1.
    """

    def __init__(self, sweep: Sweep, base: Array, name: str, maxima: RobotMaxima) -> None:
        self.sweep, self.arm, self._name, self._maxima = sweep, sweep.arm, name, maxima
        self._base, self._root_from_world = base, np.linalg.inv(base)
        self._inverse = InverseKinematics(self.arm)
        self._velocity = _velocities(self.arm, maxima)

    # -------------------------------------------------------------------------------- motions
    def starts(self, target: Pose | list[Joint]) -> list[Array]:
        """Return joint values at a target without a known start: all configurations.

        Those with the largest clearance come first, and those near a limit last.
        """
        if not isinstance(target, Pose):
            return [self.arm.values(target)]
        found = self._inverse.solutions(self._in_root(target))
        return sorted(found, key=lambda q: (bool(self.arm.near_limits(q)), -self._clearance(q)))

    def _clearance(self, q: Array) -> float:
        clearance = self.sweep.world.clearance(self.sweep.robot, self.sweep.whole(q), SUFFICIENT_CLEARANCE)
        return SUFFICIENT_CLEARANCE if clearance is None else clearance.distance

    def move(
        self,
        start: Array,
        target: Pose | list[Joint],
        *,
        linear: bool = False,
        speed: float = 1.0,
        acceleration: float = 1.0,
        safe: bool = False,
    ) -> Outcome:
        """Compute a motion.

        Args:
            start: Joint values at the start.
            target: Pose in the world, or joint values.
            linear: Whether the end effector moves in a straight line.
            speed: Fraction of the maxima.
            acceleration: Fraction of the maximum accelerations.
            safe: Whether the robot moves around obstacles.
        """
        pose = target if isinstance(target, Pose) else None
        try:
            path = self._path(start, target, linear, safe)
        except OutOfReach:
            assert pose is not None
            return Outcome(start, None, why_out_of_reach(self.arm, self._in_root(pose)), pose)
        except Arcor2Error as error:
            return Outcome(start, None, error.message, pose or Pose.from_matrix(self._base @ self.arm.forward(start)))
        seconds = self._line_time(path, speed, acceleration) if linear else self._joint_time(path, speed, acceleration)
        goal = path[-1]
        if not self.arm.within(goal, _STANDS):
            over = (goal < self.arm.lower - _STANDS) | (goal > self.arm.upper + _STANDS)
            names = ", ".join(name for name, is_over in zip(self.arm.joint_names, over, strict=True) if is_over)
            reason = Message.of("{name}: {joints} would be beyond the limits.", name=self._name, joints=names)
            return Outcome(goal, seconds, reason, Pose.from_matrix(self._base @ self.arm.forward(goal)))
        if safe or self._is_free(path) or (hit := self.sweep.first_hit(path)) is None:
            return Outcome(goal, seconds)
        at = self._at(path, hit)
        contacts = self.sweep.world.contacts(self.sweep.robot, self.sweep.whole(at))
        contact: object = contacts[0] if contacts else hit.what
        reason = Message.of("{name} would collide on its path: {contact}.", name=self._name, contact=contact)
        return Outcome(goal, seconds, reason, Pose.from_matrix(self._base @ self.arm.forward(at)))

    def _path(self, start: Array, target: Pose | list[Joint], linear: bool, safe: bool) -> list[Array]:
        if isinstance(target, Pose):
            matrix = self._in_root(target)
            if linear:
                return straight_line(
                    self.arm, start, matrix, self._name, coarse=TOLERANCE_FACTOR, inverse=self._inverse
                )
            goal = next(self._inverse.candidates(matrix, start), None)
            if goal is None:
                raise OutOfReach
        else:
            goal = self.arm.values(target)
        return Planner(self.sweep, self._name).to_joints(start, goal) if safe else [start, goal]

    def _in_root(self, pose: Pose) -> Array:
        return self._root_from_world @ pose.matrix()

    # -------------------------------------------------------------------------------- collisions
    def _is_free(self, path: Sequence[Array]) -> bool:
        return all(self.sweep.is_free_at_full_resolution(a, b) for a, b in itertools.pairwise(path))

    def _at(self, path: Sequence[Array], hit: Hit) -> Array:
        """Return the joint values at a hit."""
        lengths = [self.sweep.travel(a, b) for a, b in itertools.pairwise(path)]
        left = hit.share * sum(lengths)
        for (a, b), length in zip(itertools.pairwise(path), lengths, strict=True):
            if left <= length:
                return a + (left / length if length > 0.0 else 0.0) * (b - a)
            left -= length
        return path[-1]

    # -------------------------------------------------------------------------------- times
    def _limits(self, speed: float) -> Array:
        """Return the maximum joint velocities of a motion; the model limits the speed that the settings state."""
        stated = self._maxima.joint_speed
        if stated <= 0.0:
            return self._velocity * speed
        return np.where(self.arm.prismatic, self._velocity * speed, np.minimum(stated * speed, self._velocity))

    def _joint_time(self, path: Sequence[Array], speed: float, acceleration: float) -> float:
        velocity, stated = self._limits(speed), self._maxima.joint_acceleration
        if stated > 0.0:
            ramp = np.where(self.arm.prismatic, self._velocity / RAMP, stated * acceleration)
            return sum(
                max(map(trapezoid_time, np.abs(b - a).tolist(), velocity.tolist(), ramp.tolist()))
                for a, b in itertools.pairwise(path)
            )
        most = self._velocity
        return with_stops(path, MotionLimits(velocity, most / RAMP, most / (RAMP * JERK_RAMP))).duration

    def _line_time(self, path: Sequence[Array], speed: float, acceleration: float) -> float:
        """Return the duration of a line: the end effector keeps its maxima, and each joint its maximum velocity."""
        steps = np.abs(np.diff(np.array(path), axis=0)) / self._velocity
        slowest = steps.max(axis=1) if len(steps) else np.zeros(0)
        tcp_speed, ramp = self._maxima.tcp_speed * speed, self._maxima.tcp_acceleration * acceleration
        if tcp_speed <= 0.0:
            return float(slowest.sum() / speed) + RAMP * speed
        if ramp <= 0.0:
            ramp = tcp_speed / RAMP
        poses = [self.arm.forward(q).copy() for q in path]
        done = np.array([math.dist(poses[0][:3, 3], pose[:3, 3]) for pose in poses])
        if done[-1] <= _STANDS:  # only a rotation: controllers apply the same numbers to the angle
            done = np.linspace(
                0.0, Pose.from_matrix(poses[0]).orientation.angle_to(Pose.from_matrix(poses[-1]).orientation), len(path)
            )
        times = np.array([_time_at(float(s), float(done[-1]), tcp_speed, ramp) for s in done])
        return float(np.maximum(np.diff(times), slowest).sum())


def _time_at(done: float, whole: float, speed: float, acceleration: float) -> float:
    """Return the time at which a trapezoidal motion over `whole` has covered the distance `done`, s."""
    if whole <= _STANDS:
        return 0.0
    peak = min(speed, math.sqrt(whole * acceleration))
    ramp = 0.5 * peak * peak / acceleration
    done = min(max(done, 0.0), whole)
    if done <= ramp:
        return math.sqrt(2.0 * done / acceleration)
    if done <= whole - ramp:
        return peak / acceleration + (done - ramp) / peak
    return trapezoid_time(whole, speed, acceleration) - math.sqrt(2.0 * (whole - done) / acceleration)


def _velocities(arm: Arm, maxima: RobotMaxima) -> Array:
    """Return the maximum velocity of each joint: that of the model, otherwise that of the settings."""
    known = np.isfinite(arm.velocity) & (arm.velocity > 0.0)
    return np.where(known, arm.velocity, maxima.joint_speed or FASTEST)
