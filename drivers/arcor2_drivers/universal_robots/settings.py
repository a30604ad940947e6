"""Settings of a Universal Robots arm."""

import dataclasses
import math
from typing import Annotated

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.objects import Settings
from arcor2_hw.objects.gripping import LARGEST
from arcor2_hw.objects.settings import Range, check_host, within

MIN_WATCHDOG_FREQUENCY = 2.5
"""Minimum watchdog frequency, Hz, with which the arm stops within the time that the type declares (`loss_reaction`)."""
MANUAL_TCP_SPEED = 0.25
"""Highest TCP speed in manual mode, m/s (ISO 10218-1, reduced speed)."""
FULL_TURN = 2.0 * math.pi
OUTPUTS = 18
"""Number of digital inputs and number of digital outputs: 8 standard, 8 configurable, 2 at the tool."""


@dataclasses.dataclass
class UrSettings(Settings):
    """Settings in SI units. Poses of the TCP are in the flange; its orientation is a rotation vector.

    :param host: address of the controller
    :param payload_mass: mass at the flange, kg; negative: not set. Required before the robot can move
    :param payload_cog_x: center of gravity of the payload, m
    :param payload_cog_y: center of gravity of the payload, m
    :param payload_cog_z: center of gravity of the payload, m
    :param tcp_x: tool center point, m
    :param tcp_y: tool center point, m
    :param tcp_z: tool center point, m
    :param tcp_rx: orientation at the tool center point, rad
    :param tcp_ry: orientation at the tool center point, rad
    :param tcp_rz: orientation at the tool center point, rad
    :param max_tcp_speed: TCP speed of a linear move at speed 1, m/s
    :param max_joint_speed: joint speed of a joint move at speed 1, rad/s
    :param tcp_acceleration: acceleration of linear moves, m/s²
    :param joint_acceleration: acceleration of joint moves, rad/s²
    :param stop_deceleration: deceleration of a stop, m/s²
    :param watchdog_frequency: lowest rate of watchdog signals, Hz; below it the controller stops the arm
    :param use_upper_range_registers: leave registers 0 to 23 to a fieldbus, if the controller supports it
    :param gripper_output: digital output of the gripper, 0 to 17; -1: no gripper
    :param part_sensor_input: digital input of the part sensor, 0 to 17; -1: no sensor
    :param gripper_time: time the gripper takes to open or close, s
    :param part_size_x: size of a gripped part along the x axis of the tool, m; 0: unknown, safe moves ignore the part
    :param part_size_y: size of a gripped part along the y axis of the tool, m
    :param part_size_z: size of a gripped part along the z axis of the tool, m
    :param part_offset_z: shift of a gripped part from the tool center point along the tool, m
    """

    host: str = dataclasses.field(metadata={"found_by": "ur"})
    payload_mass: float = dataclasses.field(default=-1.0, metadata={"for_control": True})
    payload_cog_x: Annotated[float, Range(-1.0, 1.0)] = 0.0
    payload_cog_y: Annotated[float, Range(-1.0, 1.0)] = 0.0
    payload_cog_z: Annotated[float, Range(-1.0, 1.0)] = 0.0
    tcp_x: Annotated[float, Range(-1.0, 1.0)] = 0.0
    tcp_y: Annotated[float, Range(-1.0, 1.0)] = 0.0
    tcp_z: Annotated[float, Range(-1.0, 1.0)] = 0.0
    tcp_rx: Annotated[float, Range(-FULL_TURN, FULL_TURN)] = 0.0
    tcp_ry: Annotated[float, Range(-FULL_TURN, FULL_TURN)] = 0.0
    tcp_rz: Annotated[float, Range(-FULL_TURN, FULL_TURN)] = 0.0
    max_tcp_speed: Annotated[float, Range(0.01, 3.0)] = 1.0
    max_joint_speed: Annotated[float, Range(0.01, math.pi)] = 1.05
    tcp_acceleration: Annotated[float, Range(0.05, 15.0)] = 1.2
    joint_acceleration: Annotated[float, Range(0.05, 40.0)] = 1.4
    stop_deceleration: Annotated[float, Range(0.5, 15.0)] = 5.0
    watchdog_frequency: Annotated[float, Range(MIN_WATCHDOG_FREQUENCY, 50.0)] = MIN_WATCHDOG_FREQUENCY
    use_upper_range_registers: bool = True
    gripper_output: Annotated[int, Range(-1, OUTPUTS - 1)] = 0
    part_sensor_input: Annotated[int, Range(-1, OUTPUTS - 1)] = -1
    gripper_time: Annotated[float, Range(0.0, 10.0)] = 0.3
    part_size_x: Annotated[float, Range(0.0, LARGEST)] = 0.0
    part_size_y: Annotated[float, Range(0.0, LARGEST)] = 0.0
    part_size_z: Annotated[float, Range(0.0, LARGEST)] = 0.0
    part_offset_z: Annotated[float, Range(-1.0, 1.0)] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_host(self.host)
        if not self.payload_mass < 0.0:
            within("payload_mass", self.payload_mass, 0.0, 40.0)

    @property
    def tcp(self) -> Pose:
        """Return the TCP in the flange."""
        orientation = Orientation.from_rotation_vector(self.tcp_rx, self.tcp_ry, self.tcp_rz)
        return Pose(Position(self.tcp_x, self.tcp_y, self.tcp_z), orientation)

    @property
    def payload_cog(self) -> tuple[float, float, float]:
        """Return the center of gravity of the payload in the flange, m."""
        return self.payload_cog_x, self.payload_cog_y, self.payload_cog_z
