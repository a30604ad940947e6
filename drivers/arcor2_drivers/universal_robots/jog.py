"""Jogging a UR arm: motions by speed that expire."""

import math
from collections.abc import Sequence

from arcor2_hw.data.geometry import Orientation
from arcor2_hw.objects.arm import check_jog, jog_axes

from .arm import Arm
from .control import Control
from .geometry import JOINTS, Vector3, rotated
from .motion import Motion
from .observer import Observer


class Jog:
    """Moves the arm with a velocity until it expires."""

    def __init__(self, arm: Arm, observer: Observer, control: Control, motion: Motion) -> None:
        self._arm, self._observer, self._control, self._motion = arm, observer, control, motion

    def move(
        self, twist: Sequence[float] | None, velocities: Sequence[float] | None, frame: str, valid_for: float
    ) -> None:
        """Move with a twist of the TCP, or with joint velocities, for `valid_for` s. Raise OutOfRange or Refused."""
        arm, settings, guard = self._arm, self._arm.settings, self._control.stops.guard()
        check_jog(arm.name, twist, velocities, JOINTS, valid_for)
        with self._motion.exclusive():
            session = self._control.current()
            if twist is not None:
                linear, angular = self._in_base(twist, frame)
                arm.within("speed of the twist", math.hypot(*linear), 0.0, self._motion.tcp_speed(1.0))
                arm.within("angular speed of the twist", math.hypot(*angular), 0.0, settings.max_joint_speed)
                command, values, ramp = "speedL", [*linear, *angular], settings.tcp_acceleration
            else:
                command, values, ramp = "speedJ", list(velocities or ()), settings.joint_acceleration
                limit = self._motion.joint_speed(1.0)
                for name, value in zip(JOINTS, values, strict=True):
                    arm.within(f"velocity of {name}", value, -limit, limit)
            session.speed(command, values, ramp, valid_for, guard.stopped)

    def _in_base(self, twist: Sequence[float], frame: str) -> tuple[Vector3, Vector3]:
        """Return linear and angular velocity in the controller's base."""
        base = self._arm.base.orientation.inverted()
        axes = {
            "world": base,
            "base": base * self._arm.pose.orientation,
            "tool": Orientation.from_rotation_vector(*self._observer.sample().tcp[3:]),
        }
        orientation = jog_axes(self._arm.name, frame, axes)
        x, y, z, rx, ry, rz = twist
        return rotated((x, y, z), orientation), rotated((rx, ry, rz), orientation)
