"""Staged joints, targets and waypoints of one arm, and values computed from them."""

import math
from typing import Final

import numpy as np

from arcor2_fakes.abb_yumi.arm import Arm
from arcor2_fakes.abb_yumi.kinematics import LIMITS, Array, Target, pose_of, quaternion
from arcor2_fakes.abb_yumi.protocol import BAD_VALUE, Rejected, require

MAX_WAYPOINTS: Final = 50


class Staging:
    """Data set by commands 4, 5 and 20 to 24, stored until a motion uses it."""

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self.speed = (100.0, 50.0)
        """Speed of lines: mm/s, degrees/s."""
        self.clear()

    def clear(self) -> None:
        """Drop joints, target and waypoints."""
        self._joints: Array | None = None
        self._position: list[float] | None = None
        self._orientation: list[float] | None = None
        self.waypoints: list[Target] = []

    def stage(self, code: int, values: list[float]) -> None:
        """Execute a command 20 to 24."""
        if code == 20:
            q = np.radians(values)
            require(not ((q < LIMITS[:, 0] - 1e-4) | (q > LIMITS[:, 1] + 1e-4)).any())
            self._joints = np.clip(q, LIMITS[:, 0], LIMITS[:, 1])
        elif code == 21:
            require(all(abs(value) < 2000.0 for value in values[:3]))
            self._position = values
        elif code == 22:
            matrix([0.0, 0.0, 0.0], values[:4])
            self._orientation = values
        elif code == 23:
            self.waypoints = []
        else:
            require(len(self.waypoints) < MAX_WAYPOINTS)
            self.waypoints.append(self.target())

    @property
    def joints(self) -> Array:
        """Return the staged joints. Raise Rejected if there are none."""
        if self._joints is None:
            raise Rejected(BAD_VALUE)
        return self._joints

    def target(self) -> Target:
        """Return the staged robtarget, of the flange. Raise Rejected if there is none."""
        if self._position is None or self._orientation is None:
            raise Rejected(BAD_VALUE)
        tcp = matrix(self._position[:3], self._orientation[:4])
        cf1, cf4, cf6, cfx = (int(value) for value in self._orientation[4:])
        pose: Array = tcp @ np.linalg.inv(self.arm.tool)
        return Target(pose, (cf1, cf4, cf6, cfx), math.radians(self._position[3]))

    def compute(self, code: int) -> list[float]:
        """Return the answer to a command 40 to 42."""
        if code == 40:
            return self.describe(code, self.arm.kinematics.reach(self.target(), self.arm.q))
        return self.describe(code, self.joints)

    def describe(self, code: int, q: Array) -> list[float]:
        """Return joints, position or orientation for joint values, as answered to commands 10 to 12 and 40 to 42."""
        if code in (10, 40):
            return [float(value) for value in np.degrees(q)]
        target = self.arm.kinematics.describe(q)
        tcp = target.pose @ self.arm.tool
        if code in (11, 41):
            return [*(float(value) * 1e3 for value in tcp[:3, 3]), math.degrees(target.angle)]
        return [*quaternion(tcp[:3, :3]), *map(float, target.configuration)]

    def lines(self, targets: list[Target]) -> tuple[Array, float]:
        """Return the path through targets in straight lines, and its duration, s."""
        present, parts, duration = self.arm.q, [self.arm.q[None, :]], 0.0
        try:
            for target in targets:
                before = self.arm.kinematics.describe(self.arm.q)
                part = self.arm.line(target.pose, target.angle)
                distance = float(np.linalg.norm(target.pose[:3, 3] - before.pose[:3, 3])) * 1e3
                cos = float(np.trace(before.pose[:3, :3].T @ target.pose[:3, :3]) - 1.0) / 2.0
                turning = math.degrees(math.acos(min(max(cos, -1.0), 1.0)))
                duration += max(distance / self.speed[0], turning / self.speed[1], 0.02)
                parts.append(part[1:])
                self.arm.q = part[-1]
        finally:
            self.arm.q = present
        return np.vstack(parts), duration + 0.2


def matrix(millimetres: list[float], wxyz: list[float]) -> Array:
    """Return the pose of a position in mm and a quaternion. Raise Rejected for an invalid one."""
    x, y, z = (value / 1e3 for value in millimetres)
    w, i, j, k = wxyz
    try:
        return pose_of((x, y, z), (w, i, j, k))
    except ValueError:
        raise Rejected(BAD_VALUE) from None
