"""What stands around a robot, as whoever brings the scene up tells it: for ways that lead into nothing."""

from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from arcor2_hw.data.base import Data
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.data.robot import Joint

if TYPE_CHECKING:
    from arcor2_hw.objects.robot import Robot


class Obstacle(Data, frozen=True):
    """A collision model that counts now, and where it stands in the world. name: of its object."""

    name: str
    model: Models
    pose: Pose


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
