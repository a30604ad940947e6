"""Between our units and the controller's: m and mm, rad and degrees, quaternions x, y, z, w and q1 (= w) to q4.

Poses on the wire are in the controller's world frame (wobj0), which is taken as the frame of the object in the scene:
its origin is where the robot's foot stands on the table, x forward, z up.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from arcor2_hw.data.geometry import Orientation, Pose, Position


class Configuration(NamedTuple):
    """The quarter turns of axes 1, 4 and 6, and the rest as the controller numbers it."""

    cf1: int
    cf4: int
    cf6: int
    cfx: int


class RobTarget(NamedTuple):
    """A pose with what makes the joints unambiguous: configuration and arm angle (rad)."""

    pose: Pose
    configuration: Configuration
    arm_angle: float


def to_degrees(joints: Iterable[float]) -> list[float]:
    """Give rad as degrees."""
    return [math.degrees(value) for value in joints]


def to_radians(values: Iterable[float]) -> list[float]:
    """Give degrees as rad."""
    return [math.radians(value) for value in values]


def position_values(pose: Pose) -> list[float]:
    """Give x, y, z in mm."""
    return [value * 1e3 for value in pose.position]


def orientation_values(pose: Pose) -> list[float]:
    """Give q1 to q4."""
    return [*pose.orientation.wxyz()]


def pose_from(millimetres: Sequence[float], q1_to_q4: Sequence[float]) -> Pose:
    """Give the pose of x, y, z in mm and q1 to q4. Raises ValueError for numbers that are no pose."""
    x, y, z = (value / 1e3 for value in millimetres)
    w, i, j, k = q1_to_q4
    return Pose(Position(x, y, z), Orientation(i, j, k, w))


def quarters(joints: Sequence[float]) -> tuple[int, int, int]:
    """Give cf1, cf4, cf6 of joints (axes 1 to 7, rad)."""
    cf1, cf4, cf6 = (math.floor(joints[axis] / (math.pi / 2.0)) for axis in (0, 3, 5))
    return cf1, cf4, cf6
