"""What stands around a robot, as whoever brings the scene up tells it: for ways that lead into nothing."""

from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from arcor2_hw.collision.description import Attachment, Obstacle
from arcor2_hw.data.base import Data
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.data.robot import Joint, KinematicCalibration

if TYPE_CHECKING:
    from arcor2_hw.objects.robot import Robot

__all__ = ["Attachment", "HeldPart", "Nothing", "Obstacle", "Surroundings"]


class HeldPart(Data, frozen=True):
    """A part that a robot holds and moves with it.

    Attributes:
        name: Unique in the scene.
        link: Link of the robot's model, such as its end effector.
        in_link: Pose in the frame of that link.
        model: Collision model; None for a collision object of the scene, which brings its own.
    """

    name: str
    link: str
    in_link: Pose
    model: Models | None = None


class Surroundings(Protocol):
    """Asked anew for every motion, on the thread on which the robot is called."""

    def obstacles(self) -> list[Obstacle]:
        """Give what robots must not run into."""

    def robots(self) -> "list[tuple[Robot, list[Joint]]]":
        """Give the other robots with their joints as they are now.

        Raises Refused naming one whose joints nobody knows.
        """

    def asset(self, asset_id: str) -> Path | None:
        """Give the file of a mesh or robot model that was uploaded, None when it is not known here."""

    def calibration(self, robot_id: str) -> KinematicCalibration | None:
        """Give what the controller of a robot told of its very arm; None: its kinematics are nominal."""


class Nothing:
    """The surroundings of a robot that nobody told of any."""

    def obstacles(self) -> list[Obstacle]:
        """Give none."""
        return []

    def robots(self) -> "list[tuple[Robot, list[Joint]]]":
        """Give none."""
        return []

    def asset(self, asset_id: str) -> Path | None:
        """Give none."""
        return None

    def calibration(self, robot_id: str) -> KinematicCalibration | None:
        """Give none."""
        return None
