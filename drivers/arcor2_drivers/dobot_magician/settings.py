"""Settings of a Dobot Magician, checked when they are given."""

import dataclasses
import math

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.gripping import check_part_size
from arcor2_hw.objects.settings import check_serial_port


def within(name: str, value: float, low: float, high: float) -> None:
    """Raise OutOfRange, naming the parameter, unless the value lies in the range."""
    if not (math.isfinite(value) and low <= value <= high):
        raise OutOfRange(f"{name} must be {low:g} to {high:g}, not {value!r}")


@dataclasses.dataclass
class DobotMagicianSettings(Settings):
    """SI units.

    :param port: path of the serial port, such as /dev/ttyUSB0
    :param answer_timeout: time the arm has to answer a question, s
    :param tool_x: how far the tool is before the wrist, m; 0.0597 for the suction cup and the gripper as delivered
    :param tool_z: how far the tool is above the wrist, m; negative: below
    :param max_joint_speed: what speed 1 means in a joint move, rad/s
    :param max_tcp_speed: what speed 1 means in a linear move, m/s
    :param joint_acceleration: what speed 1 means in a joint move, rad/s²
    :param tcp_acceleration: what speed 1 means in a linear move, m/s²
    :param jump_height: how far a jump rises above the higher of its two ends, m
    :param jump_limit: height in the arm's base that a jump does not rise above, m
    :param suction_time: time the suction cup takes to hold or to let go, s
    :param gripper_time: time the gripper takes to open or close, s
    :param conveyor_port: stepper port of the conveyor belt, 0 or 1; -1: there is none
    :param conveyor_pulses: pulses per metre of the belt; the vendor's belt has 32000 per turn of a 36 mm roller
    :param home_timeout: time that homing may take, s
    :param part_size_x: edge of a gripped part along the x axis of the tool, m; 0: unknown, safe moves ignore the part
    :param part_size_y: edge of a gripped part along the y axis of the tool, m
    :param part_size_z: edge of a gripped part along the z axis of the tool, m
    """

    port: str
    answer_timeout: float = 0.3
    tool_x: float = 0.0597
    tool_z: float = 0.0
    max_joint_speed: float = 3.5
    max_tcp_speed: float = 0.4
    joint_acceleration: float = 3.5
    tcp_acceleration: float = 0.8
    jump_height: float = 0.03
    jump_limit: float = 0.15
    suction_time: float = 0.3
    gripper_time: float = 0.5
    conveyor_port: int = -1
    conveyor_pulses: float = 282942.0
    home_timeout: float = 60.0
    part_size_x: float = 0.0
    part_size_y: float = 0.0
    part_size_z: float = 0.0

    def __post_init__(self) -> None:
        check_serial_port("port", self.port, sockets=False)
        within("answer_timeout", self.answer_timeout, 0.05, 5.0)
        within("tool_x", self.tool_x, 0.0, 0.3)
        within("tool_z", self.tool_z, -0.3, 0.3)
        within("max_joint_speed", self.max_joint_speed, 0.05, math.radians(320.0))
        within("max_tcp_speed", self.max_tcp_speed, 0.01, 1.0)
        within("joint_acceleration", self.joint_acceleration, 0.05, 20.0)
        within("tcp_acceleration", self.tcp_acceleration, 0.05, 10.0)
        within("jump_height", self.jump_height, 0.0, 0.2)
        within("jump_limit", self.jump_limit, -0.1, 0.3)
        within("suction_time", self.suction_time, 0.0, 10.0)
        within("gripper_time", self.gripper_time, 0.0, 10.0)
        if self.conveyor_port not in (-1, 0, 1):
            raise OutOfRange(f"conveyor_port must be 0 or 1, or -1 for none, not {self.conveyor_port!r}")
        within("conveyor_pulses", self.conveyor_pulses, 1000.0, 1e7)
        within("home_timeout", self.home_timeout, 1.0, 300.0)
        check_part_size(self, within)
