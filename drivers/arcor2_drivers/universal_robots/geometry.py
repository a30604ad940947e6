"""Arm models with their nominal kinematics, and conversion of poses for the controller.

The controller states poses in its frame "base", which is base_link rotated by 180 degrees about z, with the orientation
as a rotation vector. The pose of an object in the scene is that of its base_link.

The Denavit-Hartenberg parameters are those published by Universal Robots. A real arm differs by some millimetres. The
controller uses its calibration. The nominal values serve only for limiting a speed and comparing tools.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from arcor2_hw.data.geometry import Orientation, Pose, Position

JOINTS: Final = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
JOINT_LIMITS: Final = dict.fromkeys(JOINTS, (-2.0 * math.pi, 2.0 * math.pi))
"""Limits of an arm as delivered, rad."""
BASE_LINK_FROM_BASE: Final = Pose(orientation=Orientation(0.0, 0.0, 1.0, 0.0))
TIME_STEP: Final = 1e-3
"""Time between the two positions from which a speed is computed, s."""

Vector3 = tuple[float, float, float]


class ArmModel(NamedTuple):
    """Lengths of the links, m; greatest payload, kg; reach, m."""

    d1: float
    a2: float
    a3: float
    d4: float
    d5: float
    d6: float
    max_payload: float
    reach: float


UR3E: Final = ArmModel(0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921, 3.0, 0.5)
UR5E: Final = ArmModel(0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996, 5.0, 0.85)
UR10E: Final = ArmModel(0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655, 12.5, 1.3)


def to_vector(pose: Pose) -> list[float]:
    """Return position and rotation vector, as the controller expects them."""
    return [*pose.position, *pose.orientation.rotation_vector()]


def from_vector(vector: Sequence[float]) -> Pose:
    """Return the pose of a position and a rotation vector."""
    x, y, z, rx, ry, rz = vector
    return Pose(Position(x, y, z), Orientation.from_rotation_vector(rx, ry, rz))


def world_from_base(world_from_base_link: Pose) -> Pose:
    """Return the controller's base in the world."""
    return world_from_base_link * BASE_LINK_FROM_BASE


def rotated(vector: Vector3, by: Orientation) -> Vector3:
    """Return a free vector, rotated."""
    x, y, z = Position(*vector).rotated(by)
    return x, y, z


def flange(arm: ArmModel, q: Sequence[float]) -> Pose:
    """Return the flange in the controller's base for six joint values, rad."""
    quarter = math.pi / 2.0
    links = (
        (0.0, arm.d1, quarter),
        (arm.a2, 0.0, 0.0),
        (arm.a3, 0.0, 0.0),
        (0.0, arm.d4, quarter),
        (0.0, arm.d5, -quarter),
        (0.0, arm.d6, 0.0),
    )
    pose = Pose()
    for (a, d, twist), angle in zip(links, q, strict=True):
        turn = Orientation.from_rotation_vector(0.0, 0.0, angle) * Orientation.from_rotation_vector(twist, 0.0, 0.0)
        pose = pose * Pose(Position(a * math.cos(angle), a * math.sin(angle), d), turn)
    return pose


def tcp_speed(arm: ArmModel, q: Sequence[float], rates: Sequence[float], tcp: Pose) -> float:
    """Return the speed of a TCP (pose in the flange), m/s, at joint values (rad) and joint rates (rad/s)."""
    later = [value + TIME_STEP * rate for value, rate in zip(q, rates, strict=True)]
    return (flange(arm, q) * tcp).position.distance_to((flange(arm, later) * tcp).position) / TIME_STEP
