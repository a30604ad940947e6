"""Actions that move a UR arm."""

from arcor2_hw.actions import StrEnum, action
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.project import ProjectRobotJoints

from .arm import Arm
from .control import Control
from .motion import Motion
from .observer import Observer
from .paths import Paths


class MoveType(StrEnum):
    """Path of the TCP to its target."""

    LINEAR = "linear"
    JOINT = "joint"


class MoveActions:
    """Mixin with the actions that move the arm."""

    _arm: Arm
    _observer: Observer
    _control: Control
    _motion: Motion
    _paths: Paths

    @action
    def move(
        self,
        pose: Pose,
        move_type: MoveType = MoveType.LINEAR,
        speed: float = 0.25,
        acceleration: float = 0.5,
        *,
        an: str | None = None,
    ) -> None:
        """Move the TCP to a pose.

        :param pose: target
        :param move_type: in a line, or all joints together
        :param speed: fraction of the configured maximum
        :param acceleration: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= acceleration <= 1.0
        self._motion.to_pose(pose, move_type is MoveType.LINEAR, speed, acceleration, self._control.stops.guard())

    @action
    def move_to(
        self, joints: ProjectRobotJoints, speed: float = 0.25, acceleration: float = 0.5, *, an: str | None = None
    ) -> None:
        """Move to stored joint values; all joints arrive together.

        :param joints: target
        :param speed: fraction of the configured maximum
        :param acceleration: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= acceleration <= 1.0
        q = self._arm.joint_values(joints.joints)
        self._motion.to_joints(q, speed, acceleration, self._control.stops.guard())

    @action
    def move_through(
        self,
        via: Pose,
        pose: Pose,
        blend: float = 0.05,
        move_type: MoveType = MoveType.LINEAR,
        speed: float = 0.25,
        *,
        an: str | None = None,
    ) -> None:
        """Move the TCP to a pose, passing another one without stopping.

        :param via: pose to pass
        :param pose: target
        :param blend: greatest distance from the passed pose, m; 0: stop there
        :param move_type: in lines, or all joints together
        :param speed: fraction of the configured maximum
        """
        assert 0.0 <= blend <= 0.5
        assert 0.01 <= speed <= 1.0
        self._paths.follow([via, pose], blend, move_type is MoveType.LINEAR, speed)

    @action
    def move_to_contact(
        self, force: float = 10.0, max_distance: float = 0.1, speed: float = 0.02, *, an: str | None = None
    ) -> None:
        """Move along the axis of the tool until it touches something; fail without contact.

        :param force: force at which the arm stops, N
        :param max_distance: greatest distance, m
        :param speed: fraction of the configured maximum
        """
        assert 1.0 <= force <= 100.0
        assert 0.001 <= max_distance <= 1.0
        assert 0.001 <= speed <= 0.25
        here = self._arm.tcp(self._observer.sample())
        axis = Position(0.0, 0.0, 1.0).rotated(here.orientation)
        self._paths.until_contact((axis.x, axis.y, axis.z), force, max_distance, speed)

    @action
    def move_carefully(self, pose: Pose, force: float = 20.0, speed: float = 0.1, *, an: str | None = None) -> None:
        """Move the TCP in a line to a pose; stop and fail when a force acts on it.

        :param pose: target
        :param force: force at which the arm stops, N
        :param speed: fraction of the configured maximum
        """
        assert 1.0 <= force <= 100.0
        assert 0.01 <= speed <= 1.0
        self._paths.force_limited(pose, force, speed)
