"""What stands in the way, as the compute worker is told of it. Imports no numerics."""

from typing import Any, Final

from msgspec import Struct, field

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Box, Cylinder, Sphere
from arcor2_hw.data.robot import Joint

MAX_BODIES: Final = 100_000
"""Bodies of one world."""


class KeptFile(Struct, frozen=True):
    """A file that never changes, at a path that its content's hash names; name: as a person knows it."""

    path: str
    name: str


class MeshShape(Struct, frozen=True, tag="mesh"):
    """A mesh from a file, each axis scaled."""

    file: KeptFile
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


class BoxShape(Struct, frozen=True, tag="box"):
    """A box around its origin, edges in m."""

    size: tuple[float, float, float]


class SphereShape(Struct, frozen=True, tag="sphere"):
    """A sphere around its origin, m."""

    radius: float


class CylinderShape(Struct, frozen=True, tag="cylinder"):
    """A cylinder around its origin along z, m."""

    radius: float
    height: float


Shape = BoxShape | SphereShape | CylinderShape | MeshShape


class Body(Struct, frozen=True):
    """Something of a shape at a pose in the world. name: as a person knows it."""

    id: str
    name: str
    shape: Shape
    pose: Pose


class RobotModel(Struct, frozen=True):
    """A robot's model: its URDF, or a package of it, and where its root link stands in the world.

    settings: those of its object, by name, which the description may follow.
    """

    urdf: KeptFile
    base: Pose = field(default_factory=Pose)
    settings: dict[str, Any] = field(default_factory=dict)


class StandingRobot(Struct, frozen=True):
    """A robot that stands in the way with its joints as they are."""

    id: str
    model: RobotModel
    joints: list[Joint]


def shape_of(model: Box | Sphere | Cylinder) -> Shape:
    """Give the shape of a collision model that is no mesh."""
    match model:
        case Box():
            return BoxShape((model.size_x, model.size_y, model.size_z))
        case Sphere():
            return SphereShape(model.radius)
        case Cylinder():
            return CylinderShape(model.radius, model.height)
