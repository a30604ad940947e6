"""Jogging: limits the velocity that the driver gets to the speed allowed near people and to the joint limits."""

import contextlib
import math
import time
from typing import Any, Final, NamedTuple

from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Arcor2NotImplemented, InvalidData, OutOfRange, Refused
from arcor2_hw.objects import Robot
from arcor2_hw.runtime.messages import Lease

MOST_TCP_SPEED: Final = 0.25
"""m/s at the end effector (ISO 10218-1, reduced speed), also where the controller is in no manual mode."""
LOOK_AHEAD: Final = 0.05
"""Seconds over which the speed of the end effector is taken from the kinematics; its way there is all but straight."""
COMES_TO_REST: Final = 0.15
"""Seconds beyond the lease for which a joint must have room to its limit: those in which the arm slows down."""
AT_LIMIT: Final = 0.01
"""rad (m where prismatic) from its limit at which a joint counts as being there."""
NEAR_LIMIT: Final = 0.2
"""Distance from a limit, rad (m), within which a motion of unknown direction starts slowly."""
LEVERS_CHANGE: Final = 0.95
"""Fraction of the most speed that is given by joints: the levers are those at the begin of a lease."""
SAME_WAY: Final = 0.95
"""Cosine between two twists above which the joints go on as they did."""
SLOWEST_BEGIN: Final = 0.05
"""Of the velocity, at a limit."""
SOONEST_LOOK: Final = 0.02
"""Shortest time between two readings of joints from which their velocity is computed, s."""
STANDS: Final = 1e-3
"""rad/s (m/s)."""
LEAST_VALID: Final = 0.02
"""Shortest remaining time of a lease that is used for a motion, s."""

Twist = tuple[float, float, float, float, float, float]
NO_TWIST: Final[Twist] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class _Before(NamedTuple):
    """What a driver was told last: when, the joint values of that moment, the twist that was asked, its scale."""

    moment: float
    values: list[float]
    twist: Twist
    scale: float


class Jog:
    """One jog of one arm; `arm` is the argument that names it, where there is one. Used on the device's lane alone."""

    def __init__(self, robot: Robot, arm: dict[str, str]) -> None:
        self._robot = robot
        self._arm: dict[str, Any] = dict(arm)
        self._limits = self._ask_limits()
        self._before: _Before | None = None
        self._end_effectors = robot.get_end_effectors_ids(*arm.values())

    def _ask_limits(self) -> dict[str, tuple[float, float]]:
        try:
            return self._robot.joint_limits(**self._arm)
        except Arcor2NotImplemented:
            return {}

    def drive(self, lease: Lease) -> float:
        """Pass a lease to the driver; return the fraction of the velocity that was used.

        Raises OutOfRange at a joint's limit, InvalidData for names that the robot has not, what the driver raises.
        """
        joints = self._robot.robot_joints(False, *self._arm.values())
        self._check_end_effector(lease.end_effector_id)
        if lease.joints is not None:
            return self._drive_joints(lease, lease.joints, joints)
        return self._drive_twist(lease, lease.twist or NO_TWIST, joints)

    def _left(self, lease: Lease) -> float:
        """Return the remaining seconds of a lease; Refused when there are too few."""
        left = lease.until - time.monotonic()
        if left < LEAST_VALID:
            raise Refused("{name}: the lease had run out when the robot was ready for it", name=self._robot.name)
        return left

    def _check_end_effector(self, named: str | None) -> None:
        have = ", ".join(sorted(self._end_effectors))
        if named is not None and named not in self._end_effectors:
            raise InvalidData(
                "{name} has no end effector {named!r}; it has {have}", name=self._robot.name, named=named, have=have
            )
        if named is None and len(self._end_effectors) > 1:
            raise InvalidData("{name} has several end effectors: name one of {have}", name=self._robot.name, have=have)

    def _drive_joints(self, lease: Lease, asked: list[Joint], joints: list[Joint]) -> float:
        valid_for = self._left(lease)
        wanted = {joint.name: joint.value for joint in asked}
        names = [joint.name for joint in joints]
        if unknown := wanted.keys() - set(names):
            raise InvalidData(
                "{name} has no joint {unknown}; it has {names}",
                name=self._robot.name,
                unknown=", ".join(sorted(unknown)),
                names=", ".join(names),
            )
        velocities = [wanted.get(name, 0.0) for name in names]
        scale = min(1.0, *(self._room(joint, rate, valid_for) for joint, rate in zip(joints, velocities, strict=True)))
        speed = self._tcp_speed(lease, joints, [scale * velocity for velocity in velocities])
        if speed > LEVERS_CHANGE * MOST_TCP_SPEED:
            scale *= LEVERS_CHANGE * MOST_TCP_SPEED / speed
        told = [scale * velocity for velocity in velocities]
        self._robot.jog(joint_velocities=told, valid_for=self._left(lease), **self._names(lease))
        return scale

    def _drive_twist(self, lease: Lease, twist: Twist, joints: list[Joint]) -> float:
        valid_for = self._left(lease)
        speed = math.hypot(*twist[:3])
        scale = 1.0 if speed <= MOST_TCP_SPEED else MOST_TCP_SPEED / speed
        now, before = time.monotonic(), self._before
        if before is not None and now - before.moment < SOONEST_LOOK and _cosine(before.twist, twist) >= SAME_WAY:
            scale = min(scale, before.scale)
        else:
            scale = min(scale, self._room_of_twist(twist, joints, valid_for, scale))
            self._before = _Before(now, [joint.value for joint in joints], twist, scale)
        x, y, z, a, b, c = (scale * part for part in twist)
        self._robot.jog(twist=(x, y, z, a, b, c), frame=lease.frame, valid_for=self._left(lease), **self._names(lease))
        return scale

    def _names(self, lease: Lease) -> dict[str, Any]:
        return self._arm if lease.end_effector_id is None else {"end_effector_id": lease.end_effector_id} | self._arm

    # -------------------------------------------------------------------------------- limits of joints
    def _room(self, joint: Joint, rate: float, valid_for: float) -> float:
        """Return the fraction of a joint's velocity that keeps it within its limits; OutOfRange when it is at one."""
        limits = self._limits.get(joint.name)
        if limits is None or rate == 0.0:
            return 1.0
        left = limits[1] - joint.value if rate > 0.0 else joint.value - limits[0]
        if left <= AT_LIMIT:
            side = "upper" if rate > 0.0 else "lower"
            raise OutOfRange(
                "{name}: the joint {joint_name} is at its {side} limit",
                name=self._robot.name,
                joint_name=joint.name,
                side=side,
            )
        return min(1.0, left / (abs(rate) * (valid_for + COMES_TO_REST)))

    def _room_of_twist(self, twist: Twist, joints: list[Joint], valid_for: float, scale: float) -> float:
        """Return the scale that keeps joints within their limits, from their motion since the last lease."""
        now, before = time.monotonic(), self._before
        if before is None or _cosine(before.twist, twist) < SAME_WAY or before.scale <= 0.0:
            gaps = [self._gap(joint) for joint in joints]
            return scale * min(1.0, max(SLOWEST_BEGIN, min(gaps, default=math.inf) / NEAR_LIMIT))
        rates = [
            (joint, (joint.value - value) / (now - before.moment))
            for joint, value in zip(joints, before.values, strict=True)
        ]
        # The rates are those at the scale told last; the noise of an encoder that stands is none.
        most = [before.scale * self._most(joint, rate, valid_for) for joint, rate in rates if abs(rate) > STANDS]
        return min([scale, *most])

    def _gap(self, joint: Joint) -> float:
        limits = self._limits.get(joint.name)
        return math.inf if limits is None else min(limits[1] - joint.value, joint.value - limits[0])

    def _most(self, joint: Joint, rate: float, valid_for: float) -> float:
        """Return the factor by which a velocity may grow or has to shrink; as `_room`, but may exceed 1."""
        limits = self._limits.get(joint.name)
        if limits is None:
            return math.inf
        self._room(joint, rate, valid_for)
        left = limits[1] - joint.value if rate > 0.0 else joint.value - limits[0]
        return left / (abs(rate) * (valid_for + COMES_TO_REST))

    # -------------------------------------------------------------------------------- speed of the end effector
    def _tcp_speed(self, lease: Lease, joints: list[Joint], velocities: list[float]) -> float:
        """Return the end effector speed, m/s, for joint velocities; 0 for a type that limits it itself."""
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
