"""Jogging: limits the commanded velocity to the speed allowed near people and by the joint limits."""

import contextlib
import math
import time
from typing import Any, Final, NamedTuple

from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Arcor2NotImplemented, InvalidData, OutOfRange, Refused
from arcor2_hw.objects import Robot
from arcor2_hw.runtime.messages import Lease

MAX_TCP_SPEED: Final = 0.25
"""Maximum speed of the end effector, m/s (ISO 10218-1, reduced speed). It applies in every operating mode."""
LOOK_AHEAD: Final = 0.05
"""Time step for the speed of the end effector, s; so short that its path is nearly straight."""
STOPPING_TIME: Final = 0.15
"""Time in which the arm slows down after a lease, s. A joint must not reach its limit before it has stopped."""
AT_LIMIT: Final = 0.01
"""Distance at which a joint counts as being at its limit, rad (prismatic: m)."""
NEAR_LIMIT: Final = 0.2
"""Distance to a joint limit below which a motion of unknown direction starts slowly, rad (m)."""
SPEED_MARGIN: Final = 0.95
"""Fraction of MAX_TCP_SPEED for joint jogging, since the speed is computed only for the start of a lease."""
SAME_DIRECTION: Final = 0.95
"""Cosine of the angle between two twists above which the joint velocities are expected to remain."""
MIN_START_SCALE: Final = 0.05
"""Fraction of the velocity with which a motion of unknown direction starts at a joint limit."""
MIN_SAMPLE_INTERVAL: Final = 0.02
"""Shortest time between two joint readings from which velocities are computed, s."""
STANDSTILL_SPEED: Final = 1e-3
"""Joint velocity below which a joint counts as stopped, rad/s (m/s)."""
MIN_LEASE: Final = 0.02
"""Shortest remaining time of a lease for which the robot moves, s."""

Twist = tuple[float, float, float, float, float, float]
NO_TWIST: Final[Twist] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class _Command(NamedTuple):
    """The last twist command: time, joint values at that time, requested twist, scale."""

    moment: float
    values: list[float]
    twist: Twist
    scale: float


class Jog:
    """One jog of one arm. Used only on the lane of the device.

    arm: the keyword argument that names the arm; empty for a robot with one arm.
    """

    def __init__(self, robot: Robot, arm: dict[str, str]) -> None:
        self._robot = robot
        self._arm: dict[str, Any] = dict(arm)
        self._limits = self._read_limits()
        self._last: _Command | None = None
        self._end_effectors = robot.get_end_effectors_ids(*arm.values())

    def _read_limits(self) -> dict[str, tuple[float, float]]:
        try:
            return self._robot.joint_limits(**self._arm)
        except Arcor2NotImplemented:
            return {}

    def drive(self, lease: Lease) -> float:
        """Pass a lease to the driver and return the fraction of the velocity that was commanded.

        Raises:
            OutOfRange: A joint is at its limit.
            InvalidData: The robot has no such joint or end effector.
            Refused: The lease has expired.
            Arcor2Error: The driver failed.
        """
        joints = self._robot.robot_joints(False, *self._arm.values())
        self._check_end_effector(lease.end_effector_id)
        if lease.joints is not None:
            return self._drive_joints(lease, lease.joints, joints)
        return self._drive_twist(lease, lease.twist or NO_TWIST, joints)

    def _time_left(self, lease: Lease) -> float:
        """Return the remaining time of a lease, s. Raises Refused if it is shorter than MIN_LEASE."""
        left = lease.until - time.monotonic()
        if left < MIN_LEASE:
            raise Refused("{name}: the lease had expired when the robot was ready", name=self._robot.name)
        return left

    def _check_end_effector(self, named: str | None) -> None:
        have = ", ".join(sorted(self._end_effectors))
        if named is not None and named not in self._end_effectors:
            raise InvalidData(
                "{name} has no end effector {named!r}. Available: {have}", name=self._robot.name, named=named, have=have
            )
        if named is None and len(self._end_effectors) > 1:
            raise InvalidData(
                "{name} has several end effectors. Select one of {have}.", name=self._robot.name, have=have
            )

    def _drive_joints(self, lease: Lease, requested: list[Joint], joints: list[Joint]) -> float:
        valid_for = self._time_left(lease)
        wanted = {joint.name: joint.value for joint in requested}
        names = [joint.name for joint in joints]
        if unknown := wanted.keys() - set(names):
            raise InvalidData(
                "{name} has no joint {unknown}. Available: {names}",
                name=self._robot.name,
                unknown=", ".join(sorted(unknown)),
                names=", ".join(names),
            )
        velocities = [wanted.get(name, 0.0) for name in names]
        scale = min(
            1.0, *(self._joint_scale(joint, rate, valid_for) for joint, rate in zip(joints, velocities, strict=True))
        )
        speed = self._tcp_speed(lease, joints, [scale * velocity for velocity in velocities])
        if speed > SPEED_MARGIN * MAX_TCP_SPEED:
            scale *= SPEED_MARGIN * MAX_TCP_SPEED / speed
        limited = [scale * velocity for velocity in velocities]
        self._robot.jog(joint_velocities=limited, valid_for=self._time_left(lease), **self._names(lease))
        return scale

    def _drive_twist(self, lease: Lease, twist: Twist, joints: list[Joint]) -> float:
        valid_for = self._time_left(lease)
        speed = math.hypot(*twist[:3])
        scale = 1.0 if speed <= MAX_TCP_SPEED else MAX_TCP_SPEED / speed
        now, before = time.monotonic(), self._last
        if (
            before is not None
            and now - before.moment < MIN_SAMPLE_INTERVAL
            and _cosine(before.twist, twist) >= SAME_DIRECTION
        ):
            scale = min(scale, before.scale)
        else:
            scale = min(scale, self._twist_scale(twist, joints, valid_for, scale))
            self._last = _Command(now, [joint.value for joint in joints], twist, scale)
        x, y, z, a, b, c = (scale * part for part in twist)
        self._robot.jog(
            twist=(x, y, z, a, b, c), frame=lease.frame, valid_for=self._time_left(lease), **self._names(lease)
        )
        return scale

    def _names(self, lease: Lease) -> dict[str, Any]:
        return self._arm if lease.end_effector_id is None else {"end_effector_id": lease.end_effector_id} | self._arm

    # -------------------------------------------------------------------------------- limits of joints
    def _joint_scale(self, joint: Joint, rate: float, valid_for: float) -> float:
        """Return the fraction of a velocity that keeps a joint within its limits. Raises OutOfRange at a limit."""
        return 1.0 if rate == 0.0 else min(1.0, self._largest_scale(joint, rate, valid_for))

    def _twist_scale(self, twist: Twist, joints: list[Joint], valid_for: float, scale: float) -> float:
        """Return the scale that keeps all joints within their limits, from their motion since the last lease."""
        now, before = time.monotonic(), self._last
        if before is None or _cosine(before.twist, twist) < SAME_DIRECTION or before.scale <= 0.0:
            gaps = [self._distance_to_limit(joint) for joint in joints]
            return scale * min(1.0, max(MIN_START_SCALE, min(gaps, default=math.inf) / NEAR_LIMIT))
        rates = [
            (joint, (joint.value - value) / (now - before.moment))
            for joint, value in zip(joints, before.values, strict=True)
        ]
        # The joints moved at the last scale. Smaller velocities are encoder noise.
        most = [
            before.scale * self._largest_scale(joint, rate, valid_for)
            for joint, rate in rates
            if abs(rate) > STANDSTILL_SPEED
        ]
        return min([scale, *most])

    def _distance_to_limit(self, joint: Joint) -> float:
        limits = self._limits.get(joint.name)
        return math.inf if limits is None else min(limits[1] - joint.value, joint.value - limits[0])

    def _largest_scale(self, joint: Joint, rate: float, valid_for: float) -> float:
        """Return the largest scale of a velocity that keeps a joint within its limits. Raises OutOfRange at a limit."""
        limits = self._limits.get(joint.name)
        if limits is None:
            return math.inf
        left = limits[1] - joint.value if rate > 0.0 else joint.value - limits[0]
        if left <= AT_LIMIT:
            raise OutOfRange(
                "{robot}: the joint {joint} is at its upper limit"
                if rate > 0.0
                else "{robot}: the joint {joint} is at its lower limit",
                robot=self._robot.name,
                joint=joint.name,
            )
        return left / (abs(rate) * (valid_for + STOPPING_TIME))

    # -------------------------------------------------------------------------------- speed of the end effector
    def _tcp_speed(self, lease: Lease, joints: list[Joint], velocities: list[float]) -> float:
        """Return the speed of the end effector for joint velocities, m/s; 0 if the driver limits the speed itself."""
        if not any(velocities):
            return 0.0
        end_effector = lease.end_effector_id or min(self._end_effectors, default="")
        with contextlib.suppress(Arcor2NotImplemented):
            return self._robot.tcp_speed(velocities, end_effector, **self._arm)
        there = [
            Joint(joint.name, joint.value + LOOK_AHEAD * rate) for joint, rate in zip(joints, velocities, strict=True)
        ]
        try:
            begin = self._robot.forward_kinematics(end_effector, joints, **self._arm)
            end = self._robot.forward_kinematics(end_effector, there, **self._arm)
        except Arcor2NotImplemented:
            return 0.0
        return begin.position.distance_to(end.position) / LOOK_AHEAD


def _cosine(one: Twist, other: Twist) -> float:
    lengths = math.hypot(*one) * math.hypot(*other)
    return sum(a * b for a, b in zip(one, other, strict=True)) / lengths if lengths > 0.0 else 0.0
