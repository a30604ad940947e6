"""Settings of a Dobot Magician."""

import dataclasses
import math
from typing import Annotated

from arcor2_hw.objects import Settings
from arcor2_hw.objects.gripping import LARGEST
from arcor2_hw.objects.settings import Range, check_serial_port


@dataclasses.dataclass
class DobotMagicianSettings(Settings):
    """Settings in SI units.

    :param port: path of the serial port, such as /dev/ttyUSB0
    :param answer_timeout: time for an answer of the arm, s
    :param tool_x: distance of the tool in front of the wrist, m; 0.0597 for suction cup and gripper as delivered
    :param tool_z: distance of the tool above the wrist, m; negative: below it
    :param max_joint_speed: joint speed of a joint move at speed 1, rad/s
    :param max_tcp_speed: tool speed of a linear move at speed 1, m/s
    :param joint_acceleration: acceleration of a joint move at speed 1, rad/s²
    :param tcp_acceleration: acceleration of a linear move at speed 1, m/s²
    :param jump_height: height of a jump above the higher of its two ends, m
    :param jump_limit: greatest height of a jump in the arm's base, m
    :param suction_time: time the suction cup takes to hold or release a part, s
    :param gripper_time: time the gripper takes to open or close, s
    :param conveyor_port: stepper port of the conveyor belt, 0 or 1; -1: no belt
    :param conveyor_pulses: pulses per metre of the belt; the vendor's belt has 32000 per turn of a 36 mm roller
    :param home_timeout: longest time for homing, s
    :param part_size_x: size of a gripped part along the x axis of the tool, m; 0: unknown, safe moves ignore the part
    :param part_size_y: size of a gripped part along the y axis of the tool, m
    :param part_size_z: size of a gripped part along the z axis of the tool, m
    """

    port: str = dataclasses.field(metadata={"found_by": "serial"})
    answer_timeout: Annotated[float, Range(0.05, 5.0)] = 0.3
    tool_x: Annotated[float, Range(0.0, 0.3)] = 0.0597
    tool_z: Annotated[float, Range(-0.3, 0.3)] = 0.0
    max_joint_speed: Annotated[float, Range(0.05, math.radians(320.0))] = 3.5
    max_tcp_speed: Annotated[float, Range(0.01, 1.0)] = 0.4
    joint_acceleration: Annotated[float, Range(0.05, 20.0)] = 3.5
    tcp_acceleration: Annotated[float, Range(0.05, 10.0)] = 0.8
    jump_height: Annotated[float, Range(0.0, 0.2)] = 0.03
    jump_limit: Annotated[float, Range(-0.1, 0.3)] = 0.15
    suction_time: Annotated[float, Range(0.0, 10.0)] = 0.3
    gripper_time: Annotated[float, Range(0.0, 10.0)] = 0.5
    conveyor_port: Annotated[int, Range(-1, 1)] = -1
    conveyor_pulses: Annotated[float, Range(1000.0, 1e7)] = 282942.0
    home_timeout: Annotated[float, Range(1.0, 300.0)] = 60.0
    part_size_x: Annotated[float, Range(0.0, LARGEST)] = 0.0
    part_size_y: Annotated[float, Range(0.0, LARGEST)] = 0.0
    part_size_z: Annotated[float, Range(0.0, LARGEST)] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_serial_port("port", self.port, sockets=False)
