"""What stands in the way, as the compute worker is told of it. Imports no numerics."""

from collections.abc import Mapping
from typing import Any, Final

from msgspec import Struct, field

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Box, Cylinder, Sphere
from arcor2_hw.data.robot import Joint, KinematicCalibration

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


class Holder(Struct, frozen=True):
    """The link of a robot that holds a body. touching: links that it may touch besides."""

    robot: str
    link: str
    touching: list[str] = field(default_factory=list)


class Body(Struct, frozen=True, tag="body"):
    """Something of a shape at a pose in the world; where something holds it, in the frame of that link."""

    id: str
    shape: Shape
    pose: Pose
    holder: Holder | None = None


class RobotModel(Struct, frozen=True):
    """A robot's model: its URDF, or a package of it, and where its root link stands in the world.

    settings: those of its object, by name, which the description may follow. called: as people know this one.
    calibration: what its controller told of the very arm, which takes the place of nominal kinematics.
    """

    urdf: KeptFile
    base: Pose = field(default_factory=Pose)
    settings: dict[str, Any] = field(default_factory=dict)
    called: str = ""
    calibration: KinematicCalibration | None = None


class StandingRobot(Struct, frozen=True, tag="robot"):
    """A robot with its joints as they are; without: in its middle position."""

    id: str
    model: RobotModel
    joints: list[Joint] = field(default_factory=list)


Thing = Body | StandingRobot
World = Mapping[str, Thing]
"""Everything that stands in the way, by id."""


def shape_of(model: Box | Sphere | Cylinder) -> Shape:
    """Give the shape of a collision model that is no mesh."""
    match model:
        case Box():
            return BoxShape((model.size_x, model.size_y, model.size_z))
        case Sphere():
            return SphereShape(model.radius)
        case Cylinder():
            return CylinderShape(model.radius, model.height)
