"""Object aiming: users touch the focus points of an object with a robot (protocol, 7.3)."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import RobotArg
from arcor2_server.errors import RequestRefused

if TYPE_CHECKING:
    from arcor2_server.documents.document import Document


@dataclass(slots=True)
class ObjectAiming:
    """The aiming of one user.

    Attributes:
        object_id: The aimed object.
        robot: The robot with which the user touches the points.
        points: Focus points in the frame of the object's mesh.
        document: The open document.
        poses: Touched poses of the end effector, by index of the point.
    """

    object_id: str
    robot: RobotArg
    points: list[Pose]
    document: "Document"
    poses: dict[int, Pose] = field(default_factory=dict)


class ObjectAimings:
    """The aimings by user. An aiming ends when its scene is closed."""

    def __init__(self) -> None:
        self._aimings: dict[str, ObjectAiming] = {}

    def of(self, user: str, document: "Document") -> ObjectAiming | None:
        """Return the aiming of a user in the open scene, None if there is none."""
        aiming = self._aimings.get(user)
        if aiming is not None and aiming.document is not document:
            del self._aimings[user]
            return None
        return aiming

    def require(self, user: str, document: "Document") -> ObjectAiming:
        """Return the aiming of a user in the open scene. Raise RequestRefused if there is none."""
        if (aiming := self.of(user, document)) is None:
            raise RequestRefused("You are not aiming: send ObjectAimingStart first.")
        return aiming

    def begin(self, user: str, aiming: ObjectAiming) -> None:
        """Start the aiming of a user."""
        self._aimings[user] = aiming

    def end(self, user: str) -> None:
        """End the aiming of a user."""
        self._aimings.pop(user, None)
