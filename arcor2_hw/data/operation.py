"""What is told of robots and devices in operation beside the protocol: who holds a motion, health, alarms."""

import enum

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.device import Alarm, Health


class HoldKind(enum.StrEnum):
    """What lasts only as long as a person holds on to it."""

    JOG = "jog"
    HAND_TEACHING = "hand_teaching"


class RobotHoldData(Data, frozen=True):
    """What the event RobotHold carries: a user took hold of a robot, or the hold has ended and the robot is at rest.

    reason: why it ended, where the user did not simply let go.
    """

    robot_id: str
    kind: HoldKind
    user: str
    held: bool
    reason: str | Unset = UNSET
    arm_id: str | Unset = UNSET


class ObjectHealthData(Data, frozen=True):
    """What the event ObjectHealth carries: condition, alarms and owner of control of an object in operation.

    control_owner: "us", another's name, or left out when nobody has control.
    """

    object_id: str
    health: Health
    alarms: list[Alarm] = field(default_factory=list)
    control_owner: str | Unset = UNSET
