"""The collision world as plain data, for the messages between server, cell host and compute worker.

Imports no numerics.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct, field

from arcor2_hw.data.base import Data
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Mesh, Models
from arcor2_hw.data.robot import Joint, KinematicCalibration
from arcor2_hw.kinematics.primitives import Box, Cylinder, Sphere


class StoredFile(Struct, frozen=True):
    """A file whose content never changes.

    Attributes:
        path: Path, which contains the hash of the content.
        name: Name in messages.
    """

    path: str
    name: str


class MeshShape(Struct, frozen=True, tag="mesh"):
    """A mesh read from a file, scaled along each axis."""

    file: StoredFile
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


Shape = Box | Sphere | Cylinder | MeshShape


class Attachment(Data, frozen=True):
    """The robot link that a body is attached to.

    Attributes:
        robot: Id or name of the robot.
        link: Link of its model.
        touching: Further links that the body may touch.
    """

    robot: str
    link: str
    touching: tuple[str, ...] = ()


class Obstacle(Data, frozen=True):
    """A body of the scene with its collision model of the protocol.

    Attributes:
        name: Name or id of the object.
        model: Collision model.
        pose: Pose in the world; for an attached body, pose in the frame of the link.
        attachment: The link that it is attached to, if any.
        scale: Scale of a mesh.
        file: File of a mesh that is not an asset.
    """

    name: str
    model: Models
    pose: Pose
    attachment: Attachment | None = None
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    file: Path | None = None

    @classmethod
    def of(
        cls,
        model: Models,
        pose: Pose,
        scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
        attachment: Attachment | None = None,
    ) -> "Obstacle":
        """Return an obstacle with the name of its collision model."""
        return cls(model.id, model, pose, attachment, scale)

    @property
    def is_fixed_primitive(self) -> bool:
        """Return whether it is a primitive shape that is not attached to a robot, so that `lines` can check it."""
        return self.attachment is None and not isinstance(self.model, Mesh)


class WorldBody(Struct, frozen=True, tag="body"):
    """A body of a world description.

    Attributes:
        id: Unique in the world.
        shape: Shape.
        pose: Pose in the world; for an attached body, pose in the frame of the link.
        attachment: The link that it is attached to, if any.
    """

    id: str
    shape: Shape
    pose: Pose
    attachment: Attachment | None = None


class RobotSource(Struct, frozen=True):
    """The file of a robot model and the pose of its root link.

    Attributes:
        urdf: URDF file, or archive with a URDF and its meshes.
        base: Pose of the root link in the world.
        settings: Settings of the robot's object by name; the URDF may depend on them.
        called: Name of the robot in messages.
        calibration: Calibrated kinematics of this robot, read from its controller.
    """

    urdf: StoredFile
    base: Pose = field(default_factory=Pose)
    settings: dict[str, Any] = field(default_factory=dict)
    called: str = ""
    calibration: KinematicCalibration | None = None


class WorldRobot(Struct, frozen=True, tag="robot"):
    """A robot of a world description.

    Attributes:
        id: Unique in the world.
        model: Source of its model.
        joints: Present joint values; without them the robot is in its neutral configuration.
    """

    id: str
    model: RobotSource
    joints: list[Joint] = field(default_factory=list)


WorldItem = WorldBody | WorldRobot
WorldDescription = Mapping[str, WorldItem]
"""Bodies and robots by id."""
