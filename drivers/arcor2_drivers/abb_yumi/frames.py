"""Conversion to units of the controller: m to mm, rad to degrees, quaternions from x, y, z, w to q1 (= w), ..., q4.

Poses on the wire are in the controller's world frame (wobj0), which is also the frame of the object in the scene: its
origin is at the foot of the robot, on the table; x points forward, z up.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from arcor2_hw.data.geometry import Orientation, Pose, Position


class Configuration(NamedTuple):
    """Quarter turns of axes 1, 4 and 6, and cfx as the controller numbers it."""

    cf1: int
    cf4: int
    cf6: int
    cfx: int


class RobTarget(NamedTuple):
    """A pose with configuration and arm angle (rad), which determine the joints uniquely."""

    pose: Pose
    configuration: Configuration
    arm_angle: float


def to_degrees(joints: Iterable[float]) -> list[float]:
    """Convert rad to degrees."""
    return [math.degrees(value) for value in joints]


def to_radians(values: Iterable[float]) -> list[float]:
    """Convert degrees to rad."""
    return [math.radians(value) for value in values]


def position_values(pose: Pose) -> list[float]:
    """Return x, y, z in mm."""
    return [value * 1e3 for value in pose.position]


def orientation_values(pose: Pose) -> list[float]:
    """Return q1 to q4."""
    return [*pose.orientation.wxyz()]


def pose_from(millimetres: Sequence[float], q1_to_q4: Sequence[float]) -> Pose:
    """Return the pose of x, y, z in mm and q1 to q4. Raise ValueError for invalid numbers."""
    x, y, z = (value / 1e3 for value in millimetres)
    w, i, j, k = q1_to_q4
    return Pose(Position(x, y, z), Orientation(i, j, k, w))
