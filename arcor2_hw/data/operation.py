"""Data about robots and devices of an online scene that is not in ARCOR2: hold-to-run, health, alarms."""

import enum

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, TranslatableData, Unset
from arcor2_hw.data.device import Alarm, Health
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import ObjectModel


class HoldKind(enum.StrEnum):
    """Kind of motion that lasts only while a user holds a button."""

    JOG = "jog"
    HAND_TEACHING = "hand_teaching"


class RobotHoldData(TranslatableData, frozen=True):
    """Data of the event RobotHold: a user started to hold a robot, or the hold ended and the robot is at standstill.

    reason: why it ended, unless the user released the button.
    """

    robot_id: str
    kind: HoldKind
    user: str
    held: bool
    reason: str | Unset = UNSET
    arm_id: str | Unset = UNSET


class ObjectHealthData(Data, frozen=True):
    """Data of the event ObjectHealth: condition, alarms and owner of control of an object of the online scene.

    control_owner: "us", the name of another client, or omitted when nobody has control.
    """

    object_id: str
    health: Health
    alarms: list[Alarm] = field(default_factory=list)
    control_owner: str | Unset = UNSET


class CarriedPart(Data, frozen=True):
    """A part that a robot carries.

    link: end effector, or link of the robot. pose: in its frame. model: omitted for a collision object of the scene,
    which has the same name.
    """

    name: str
    link: str
    pose: Pose
    model: ObjectModel | Unset = UNSET


class ObjectValuesData(Data, frozen=True):
    """Data of the event ObjectValues: visible state of a device, such as an open door. Missing values are unknown.

    values: by name, in SI units, such as the width of a gripper; 1 for on. parts: carried by a robot.
    """

    object_id: str
    values: dict[str, float] = field(default_factory=dict)
    parts: list[CarriedPart] = field(default_factory=list)
