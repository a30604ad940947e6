"""Who points a robot at the focus points of an object, and which of them are done (protocol, 7.3)."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import RobotArg
from arcor2_server.errors import RequestRefused

if TYPE_CHECKING:
    from arcor2_server.documents.document import Document


@dataclass(slots=True)
class Aim:
    """One user's aiming. points: in the frame of the object's mesh. poses: of the end effector, by index of point."""

    object_id: str
    robot: RobotArg
    points: list[Pose]
    document: "Document"
    poses: dict[int, Pose] = field(default_factory=dict)


class Aiming:
    """The aimings by user. One ends with the scene that it began in."""

    def __init__(self) -> None:
        self._aims: dict[str, Aim] = {}

    def of(self, user: str, document: "Document") -> Aim | None:
        """Give the aiming of a user in the open scene, None when he is not aiming."""
        aim = self._aims.get(user)
        if aim is not None and aim.document is not document:
            del self._aims[user]
            return None
        return aim

    def require(self, user: str, document: "Document") -> Aim:
        """Give the aiming of a user in the open scene; RequestRefused."""
        if (aim := self.of(user, document)) is None:
            raise RequestRefused("You are not aiming: send ObjectAimingStart first.")
        return aim

    def begin(self, user: str, aim: Aim) -> None:
        """Let a user aim."""
        self._aims[user] = aim

    def end(self, user: str) -> None:
        """Forget a user's aiming."""
        self._aims.pop(user, None)
