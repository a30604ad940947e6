"""Actions of the hands of a YuMi: fingers and suction cups."""

from typing import Final

from arcor2_hw.actions import StrEnum, action
from arcor2_hw.exceptions import DeviceFault, Refused

from .control import Control
from .motion_lines import Code
from .settings import YumiSettings

HAND_TIMEOUT: Final = 6.0
"""Time that a command of the hand may take, s; the whole stroke of the fingers takes one or two seconds."""
MIN_GRIPPED_WIDTH: Final = 0.001
"""Width between closed fingers from which on they hold a part, m."""
NOTHING_HELD: Final = "nothing_held"


class ArmId(StrEnum):
    """Arm, as seen by the robot."""

    LEFT = "left"
    RIGHT = "right"


class Hands:
    """Mixin with the actions of both hands."""

    name: str
    _yumi: YumiSettings
    _control: Control

    @action
    def grip(self, arm: ArmId = ArmId.LEFT, force: float = 10.0, *, an: str | None = None) -> float:
        """Close the fingers and return their width, m. Fail with nothing_held if they meet.

        :param arm: which arm
        :param force: gripping force, N
        """
        assert 1.0 <= force <= 20.0
        width = self._move_fingers(arm, Code.HAND_GRIP, force)
        if width < MIN_GRIPPED_WIDTH:
            raise DeviceFault(
                "The {value} hand of {name} gripped nothing.", fault_code=NOTHING_HELD, value=arm.value, name=self.name
            )
        return width

    @action
    def open_gripper(self, arm: ArmId = ArmId.LEFT, width: float = 0.02, *, an: str | None = None) -> float:
        """Open the fingers to a width, and return the width reached, m.

        :param arm: which arm
        :param width: width between the fingers, m
        """
        assert 0.0 <= width <= 0.025
        return self._move_fingers(arm, Code.HAND_MOVE, width * 1e3)

    @action
    def calibrate_gripper(self, arm: ArmId = ArmId.LEFT, *, an: str | None = None) -> None:
        """Close the empty fingers to find their zero. Needed once after each start of the controller.

        :param arm: which arm
        """
        self._move_fingers(arm, Code.HAND_CALIBRATE)

    @action
    def gripper_width(self, arm: ArmId = ArmId.LEFT, *, an: str | None = None) -> float:
        """Read the width between the fingers, m.

        :param arm: which arm
        """
        return self._move_fingers(arm, Code.HAND_STATE)

    @action
    def set_suction(self, arm: ArmId = ArmId.LEFT, on: bool = True, *, an: str | None = None) -> None:
        """Switch the vacuum. It keeps its state when the connection is lost.

        :param arm: which arm
        :param on: on or off
        """
        self._switch_air(arm, Code.HAND_VACUUM, on)

    @action
    def set_blow_off(self, arm: ArmId = ArmId.LEFT, on: bool = True, *, an: str | None = None) -> None:
        """Switch the air that blows a part off the cup.

        :param arm: which arm
        :param on: on or off
        """
        self._switch_air(arm, Code.HAND_BLOW, on)

    def _move_fingers(self, arm: ArmId, code: Code, *values: float) -> float:
        """Execute a command of the fingers and return their width, m."""
        return self._ask(arm, "gripper", code, *values)[0] / 1e3

    def _switch_air(self, arm: ArmId, code: Code, on: bool) -> None:
        self._ask(arm, "suction", code, float(on))

    def _ask(self, arm: ArmId, tool: str, code: Code, *values: float) -> tuple[float, ...]:
        """Send a command to a hand, and return its answer. Raise Refused unless the hand has the tool."""
        setting = f"{arm.value}_{tool}"
        if not getattr(self._yumi, setting):
            raise Refused(
                "The {value} hand of {name} has no fingers: {setting} is not set."
                if tool == "gripper"
                else "The {value} hand of {name} has no suction cup: {setting} is not set.",
                value=arm.value,
                name=self.name,
                setting=setting,
            )
        return self._control.current().lines[arm.value].ask(code, *values, within=HAND_TIMEOUT)
