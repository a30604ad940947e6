"""The abstract base classes of object types."""

from arcor2_hw.objects.camera import Camera
from arcor2_hw.objects.generic import CollisionObject, Generic, GenericWithPose, VirtualCollisionObject
from arcor2_hw.objects.gripping import HoldsParts, PartSize
from arcor2_hw.objects.machine import Machine, MachineCommand, MachineState, UnitMode
from arcor2_hw.objects.robot import MultiArmRobot, Robot, RobotException
from arcor2_hw.objects.settings import Settings
from arcor2_hw.objects.small import (
    Axis,
    Code,
    Gripper,
    GripResult,
    HasPoints,
    IOBlock,
    NoRead,
    Printer,
    Reader,
    Scale,
    Suction,
)

__all__ = [
    "Axis",
    "Camera",
    "Code",
    "CollisionObject",
    "Generic",
    "GenericWithPose",
    "GripResult",
    "Gripper",
    "HasPoints",
    "HoldsParts",
    "IOBlock",
    "Machine",
    "MachineCommand",
    "MachineState",
    "MultiArmRobot",
    "NoRead",
    "PartSize",
    "Printer",
    "Reader",
    "Robot",
    "RobotException",
    "Scale",
    "Settings",
    "Suction",
    "UnitMode",
    "VirtualCollisionObject",
]
