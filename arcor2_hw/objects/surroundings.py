"""The surroundings of a robot: obstacles and other robots, for safe moves."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from arcor2_hw.collision.description import Attachment, Obstacle
from arcor2_hw.data.base import Data
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.data.robot import Joint, KinematicCalibration
from arcor2_hw.objects.generic import GenericWithPose

__all__ = ["Attachment", "EmptySurroundings", "HeldPart", "Nothing", "Obstacle", "Surroundings"]


class HeldPart(Data, frozen=True):
    """A part that a robot holds.

    Attributes:
        name: Unique in the scene.
        link: Link of the robot's model, such as its end effector.
        in_link: Pose in the frame of that link.
        model: Collision model; None for a collision object of the scene, which has its own.
    """

    name: str
    link: str
    in_link: Pose
    model: Models | None = None


class Surroundings(Protocol):
    """Interface of the surroundings of a robot. The thread of the robot queries them for every motion."""

    def obstacles(self) -> list[Obstacle]:
        """Return the obstacles."""

    def robots(self) -> Sequence[tuple[GenericWithPose, list[Joint]]]:
        """Return the other robots with their present joint values.

        Raises:
            Refused: The joints of a robot are unknown; the message names it.
        """

    def asset(self, asset_id: str) -> Path | None:
        """Return the file of an uploaded mesh or robot model, or None if it is not available."""

    def calibration(self, robot_id: str) -> KinematicCalibration | None:
        """Return the calibrated kinematics of a robot, read from its controller; None: nominal kinematics."""


class EmptySurroundings:
    """Empty surroundings."""

    def obstacles(self) -> list[Obstacle]:
        """Return an empty list."""
        return []

    def robots(self) -> Sequence[tuple[GenericWithPose, list[Joint]]]:
        """Return an empty list."""
        return []

    def asset(self, asset_id: str) -> Path | None:
        """Return None."""
        return None

    def calibration(self, robot_id: str) -> KinematicCalibration | None:
        """Return None."""
        return None


Nothing = EmptySurroundings  # object types written before this name existed import it
