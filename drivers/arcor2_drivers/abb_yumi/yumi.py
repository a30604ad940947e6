"""YuMi: the actions that ABB's two-arm robot offers to programs."""

from typing import ClassVar, Final

from arcor2_hw.actions import StrEnum, action
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.exceptions import DeviceFault, Refused

from .motion_lines import Code
from .settings import YumiSettings
from .yumi_motion import YumiMotion

HAND_WITHIN: Final = 6.0
"""Seconds the fingers may take; their whole stroke takes one or two."""
HELD: Final = 0.001
"""m of width from which on the closed fingers hold something."""
NOTHING_HELD: Final = "nothing_held"


class ArmId(StrEnum):
    """Which arm, as seen by the robot."""

    LEFT = "left"
    RIGHT = "right"


class MoveType(StrEnum):
    """How the TCP gets to its target."""

    LINEAR = "linear"
    JOINT = "joint"


class YuMi(YumiMotion):
    """ABB YuMi (IRB 14000): two arms of seven axes, 0.5 kg each, 559 mm."""

    _ABSTRACT = False
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {
        "move": "stop",
        "move_to": "stop",
        "move_both": "stop",
    }

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: YumiSettings) -> None:
        super().__init__(obj_id, name, pose, settings)

    @action
    def move(
        self,
        pose: Pose,
        arm: ArmId = ArmId.LEFT,
        move_type: MoveType = MoveType.LINEAR,
        speed: float = 0.25,
        *,
        an: str | None = None,
    ) -> None:
        """Move the TCP of an arm to a pose; it keeps clear of the other arm.

        :param pose: where to
        :param arm: which arm
        :param move_type: in a line, or all axes together
        :param speed: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        self._move_pose(arm.value, pose, move_type is MoveType.LINEAR, speed, self._stops[arm.value])

    @action
    def move_to(
        self, joints: ProjectRobotJoints, arm: ArmId = ArmId.LEFT, speed: float = 0.25, *, an: str | None = None
    ) -> None:
        """Move an arm to stored joint values, all axes arriving together; it keeps clear of the other arm.

        :param joints: where to
        :param arm: which arm the joints are of
        :param speed: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        stops = self._stops[arm.value]
        self._move_joints(arm.value, self._checked_joints(joints.joints, arm.value), speed, stops)

    @action
    def move_both(
        self, left: ProjectRobotJoints, right: ProjectRobotJoints, speed: float = 0.25, *, an: str | None = None
    ) -> None:
        """Move both arms to stored joint values; they start and arrive together.

        :param left: where the left arm goes to
        :param right: where the right arm goes to
        :param speed: fraction of the configured maximum
        """
        assert 0.01 <= speed <= 1.0
        self.move_synchronously({"left": left.joints, "right": right.joints}, speed)

    @action
    def grip(self, arm: ArmId = ArmId.LEFT, force: float = 10.0, *, an: str | None = None) -> float:
        """Close the fingers; give the width at which they stand, m. Fails with nothing_held when they meet.

        :param arm: which arm
        :param force: N
        """
        assert 1.0 <= force <= 20.0
        width = self._hand(arm, Code.HAND_GRIP, force)
        if width < HELD:
            raise DeviceFault(f"the {arm.value} hand of {self.name} gripped nothing", fault_code=NOTHING_HELD)
        return width

    @action
    def open_gripper(self, arm: ArmId = ArmId.LEFT, width: float = 0.02, *, an: str | None = None) -> float:
        """Open the fingers to a width; give the width at which they stand, m.

        :param arm: which arm
        :param width: m between the fingers
        """
        assert 0.0 <= width <= 0.025
        return self._hand(arm, Code.HAND_MOVE, width * 1e3)

    @action
    def calibrate_gripper(self, arm: ArmId = ArmId.LEFT, *, an: str | None = None) -> None:
        """Close the empty fingers to find their zero; needed once after the controller was started.

        :param arm: which arm
        """
        self._hand(arm, Code.HAND_CALIBRATE)

    @action
    def gripper_width(self, arm: ArmId = ArmId.LEFT, *, an: str | None = None) -> float:
        """Read the width between the fingers, m.

        :param arm: which arm
        """
        return self._hand(arm, Code.HAND_STATE)

    @action
    def set_suction(self, arm: ArmId = ArmId.LEFT, on: bool = True, *, an: str | None = None) -> None:
        """Switch the vacuum; it keeps its state when the robot loses the hub.

        :param arm: which arm
        :param on: on or off
        """
        self._sucks(arm)
        self._controlled().lines[arm.value].ask(Code.HAND_VACUUM, float(on), within=HAND_WITHIN)

    @action
    def set_blow_off(self, arm: ArmId = ArmId.LEFT, on: bool = True, *, an: str | None = None) -> None:
        """Switch the air that blows a part off the cup.

        :param arm: which arm
        :param on: on or off
        """
        self._sucks(arm)
        self._controlled().lines[arm.value].ask(Code.HAND_BLOW, float(on), within=HAND_WITHIN)

    def _hand(self, arm: ArmId, code: Code, *values: float) -> float:
        """Have the fingers do something; give their width, m."""
        if not getattr(self._yumi, f"{arm.value}_gripper"):
            raise Refused(f"the {arm.value} hand of {self.name} has no fingers: {arm.value}_gripper is not set")
        told = self._controlled().lines[arm.value].ask(code, *values, within=HAND_WITHIN)
        return told[0] / 1e3

    def _sucks(self, arm: ArmId) -> None:
        if not getattr(self._yumi, f"{arm.value}_suction"):
            raise Refused(f"the {arm.value} hand of {self.name} has no cup: {arm.value}_suction is not set")
