"""Between the poses of our world and those of the controller.

The controller states poses in its frame "base", which is base_link turned by 180 degrees about z, with the orientation
as a rotation vector. An object's pose in the scene is its base_link.
"""

from arcor2_hw.data.geometry import Orientation, Pose, Position

BASE_LINK_FROM_BASE = Pose(orientation=Orientation(0.0, 0.0, 1.0, 0.0))

Vector6 = tuple[float, float, float, float, float, float]


def to_vector(pose: Pose) -> list[float]:
    """Give position and rotation vector as the controller takes them."""
    return [*pose.position, *pose.orientation.rotation_vector()]


def from_vector(vector: list[float] | tuple[float, ...]) -> Pose:
    """Give the pose of six numbers of the controller."""
    x, y, z, rx, ry, rz = vector
    return Pose(Position(x, y, z), Orientation.from_rotation_vector(rx, ry, rz))


def world_from_base(world_from_base_link: Pose) -> Pose:
    """Give the controller's base in the world, for an arm whose base_link stands there."""
    return world_from_base_link * BASE_LINK_FROM_BASE


def turned(vector: tuple[float, float, float], by: Orientation) -> tuple[float, float, float]:
    """Give a free vector turned by an orientation."""
    x, y, z = Position(*vector).rotated(by)
    return x, y, z
