"""The Dobot Magician as an object type: what it offers to programs."""

import time
from typing import ClassVar, Final

from arcor2_hw.actions import StrEnum, action
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.exceptions import DeviceFault
from arcor2_hw.objects import HoldsParts

from .dobot_arm import JOINT_TO_POSE, JUMP, LINE_TO_POSE, DobotArm
from .frames import Command
from .settings import DobotMagicianSettings

LONGEST_HOMING: Final = 320.0
"""s: the longest that home_timeout allows, and the margin for questions and the stop."""
POLL: Final = 0.01


class DobotMoveType(StrEnum):
    """How the tool gets to its target."""

    LINEAR = "linear"
    JOINT = "joint"
    JUMP = "jump"


_MODES: Final = {DobotMoveType.LINEAR: LINE_TO_POSE, DobotMoveType.JOINT: JOINT_TO_POSE, DobotMoveType.JUMP: JUMP}


def behind(pose: Pose, distance: float) -> Pose:
    """Give the pose `distance` m behind another along the tool's axis: above it, as the tool points down."""
    return pose * Pose(Position(0.0, 0.0, -distance))


class DobotMagician(HoldsParts, DobotArm):
    """Dobot Magician: four axes, 0.5 kg, 320 mm, with suction cup or gripper."""

    _ABSTRACT = False
    urdf_package_name = "dobot_magician.zip"
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {
        "home": "stop",
        "move": "stop",
        "move_to": "stop",
        "pick": "stop",
        "place": "stop",
    }

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: DobotMagicianSettings) -> None:
        super().__init__(obj_id, name, pose, settings)

    @action(deadline=LONGEST_HOMING)
    def home(self, *, an: str | None = None) -> None:
        """Reference the axes: the arm runs to its switches and back. Keep clear of it."""
        super().home()

    @action
    def move(
        self, pose: Pose, move_type: DobotMoveType = DobotMoveType.LINEAR, speed: float = 0.25, *, an: str | None = None
    ) -> None:
        """Move the tool to a pose.

        :param pose: where to; the tool points down
        :param move_type: in a line, all joints together, or up, across and down
        :param speed: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        self._move_pose(pose, _MODES[move_type], speed, self._stops)

    @action
    def move_to(self, joints: ProjectRobotJoints, speed: float = 0.25, *, an: str | None = None) -> None:
        """Move to stored joint values, all joints arriving together.

        :param joints: where to
        :param speed: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        self._move_joints(self._checked_joints(joints.joints), speed, self._stops)

    @action
    def pick(
        self, pose: Pose, approach: float = 0.05, speed: float = 0.5, slow_speed: float = 0.1, *, an: str | None = None
    ) -> None:
        """Pick a part with the suction cup: approach from above, suck, retreat. Nothing tells whether it is held.

        :param pose: where the cup touches the part
        :param approach: height from which it is approached, m
        :param speed: fraction of the maximum on the way there
        :param slow_speed: fraction of the maximum at the part
        """
        assert 0.0 <= approach <= 0.2
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= slow_speed <= 1.0
        self._at_part("pick", pose, approach, speed, slow_speed, suck=True)

    @action
    def place(
        self, pose: Pose, approach: float = 0.05, speed: float = 0.5, slow_speed: float = 0.1, *, an: str | None = None
    ) -> None:
        """Place the part that the suction cup holds: approach from above, let go, retreat.

        :param pose: where the part is let go
        :param approach: height from which it is approached, m
        :param speed: fraction of the maximum on the way there
        :param slow_speed: fraction of the maximum at the place
        """
        assert 0.0 <= approach <= 0.2
        assert 0.01 <= speed <= 1.0
        assert 0.01 <= slow_speed <= 1.0
        self._at_part("place", pose, approach, speed, slow_speed, suck=False)

    @action
    def suck(self, on: bool, *, an: str | None = None) -> None:
        """Switch the suction on or off, and wait until it holds or lets go; it stays when the hub is lost.

        :param on: whether to suck
        """
        self._switch("suck", Command.SUCTION_CUP, on, self._dobot.suction_time, self._stops)
        self._part_switched(on, hanging=True)

    @action
    def gripper(self, closed: bool, *, an: str | None = None) -> None:
        """Close or open the gripper, and wait until it has; it stays when the hub is lost.

        :param closed: whether to close it
        """
        self._switch("gripper", Command.GRIPPER, closed, self._dobot.gripper_time, self._stops)
        self._part_switched(closed, hanging=False)

    @action
    def conveyor(self, speed: float, *, an: str | None = None) -> None:
        """Drive the conveyor belt; it runs on when the hub is lost, as the arm has no watchdog.

        :param speed: m/s, negative backwards, 0 stops it
        """
        assert -0.2 <= speed <= 0.2
        stops = self._stops
        with self._orders:
            self._check_not_stopped("conveyor", stops)
            self._require_control()
            self._drive_belt(speed)

    def _at_part(self, what: str, pose: Pose, approach: float, speed: float, slow_speed: float, *, suck: bool) -> None:
        stops, above = self._stops, behind(pose, approach)
        self._solve(pose)  # before anything moves
        self._move_pose(above, JOINT_TO_POSE, speed, stops)
        self._move_pose(pose, LINE_TO_POSE, slow_speed, stops)
        self._switch(what, Command.SUCTION_CUP, suck, self._dobot.suction_time, stops)
        self._part_switched(suck, hanging=True)
        self._move_pose(above, LINE_TO_POSE, slow_speed, stops)

    def _part_switched(self, held: bool, *, hanging: bool) -> None:
        if held:
            self.attach_part(hanging=hanging)
        else:
            self.detach_part()

    def _switch(self, what: str, command: Command, on: bool, seconds: float, stops: int) -> None:
        """Switch the pump's valve, see it switched, and give it its time. Raises DeviceFault when it does not."""
        wanted = (1, int(on))
        with self._orders:
            self._check_not_stopped(what, stops)
            self._require_control()
            self._observer.set(command, "2B", *wanted)
            kept = self._observer.get(command, "2B")
        if kept != wanted:
            raise DeviceFault(f"{what} of {self._who} did not switch", f"told {wanted}, has {kept}")
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self._check_not_stopped(what, stops)
            time.sleep(POLL)
