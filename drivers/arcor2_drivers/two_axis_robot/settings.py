"""Settings of a two-axis robot."""

import dataclasses
import math
from typing import Annotated, Final

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import Range, check_serial_port, one_of

BAUD_RATES: Final = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000)
QUARTER: Final = math.pi / 2.0
MAX_WATCHDOG_TIMEOUT: Final = 0.6
"""Longest watchdog, s, with which the servos stop within the time that the type declares (`loss_reaction`)."""


@dataclasses.dataclass
class TwoAxisRobotSettings(Settings):
    """Settings in SI units. Joint 1 is in the base, joint 2 at the end of link 1; 0 rad is the middle of a turn.

    :param port: serial port of the bus adapter
    :param baud_rate: bit rate of both servos, bit/s
    :param id_1: bus id of joint 1
    :param id_2: bus id of joint 2
    :param direction_1: 1, or -1 if joint 1 is mounted the other way round
    :param direction_2: 1, or -1 if joint 2 is mounted the other way round
    :param homing_offset_1: offset of the encoder of joint 1, rad; at most a quarter turn
    :param homing_offset_2: offset of the encoder of joint 2, rad; at most a quarter turn
    :param link_1: length from axis 1 to axis 2, m
    :param link_2: length from axis 2 to the tool center point, m
    :param lower_1: lower limit of joint 1, rad
    :param upper_1: upper limit of joint 1, rad
    :param lower_2: lower limit of joint 2, rad
    :param upper_2: upper limit of joint 2, rad
    :param max_joint_speed: joint speed at speed 1, rad/s
    :param joint_acceleration: joint acceleration at acceleration 1, rad/s²
    :param stop_deceleration: deceleration of a stop, rad/s²
    :param current_limit: highest current of a servo, A
    :param watchdog: time without communication after which a servo stops, s
    """

    port: str = dataclasses.field(metadata={"found_by": "serial"})
    baud_rate: int = 1_000_000
    id_1: Annotated[int, Range(0, 252)] = 1
    id_2: Annotated[int, Range(0, 252)] = 2
    direction_1: int = 1
    direction_2: int = 1
    homing_offset_1: Annotated[float, Range(-QUARTER, QUARTER)] = 0.0
    homing_offset_2: Annotated[float, Range(-QUARTER, QUARTER)] = 0.0
    link_1: Annotated[float, Range(0.005, 1.0)] = 0.15
    link_2: Annotated[float, Range(0.005, 1.0)] = 0.10
    lower_1: Annotated[float, Range(-3.14, 3.14)] = -2.6
    upper_1: Annotated[float, Range(-3.14, 3.14)] = 2.6
    lower_2: Annotated[float, Range(-3.14, 3.14)] = -2.6
    upper_2: Annotated[float, Range(-3.14, 3.14)] = 2.6
    max_joint_speed: Annotated[float, Range(0.1, 8.0)] = 3.0
    joint_acceleration: Annotated[float, Range(0.5, 100.0)] = 12.0
    stop_deceleration: Annotated[float, Range(10.0, 200.0)] = 30.0
    current_limit: Annotated[float, Range(0.05, 3.2)] = 1.0
    watchdog: Annotated[float, Range(0.16, MAX_WATCHDOG_TIMEOUT)] = 0.4  # a shorter one trips on a repeated request

    def __post_init__(self) -> None:
        super().__post_init__()
        check_serial_port("port", self.port, sockets=False)
        one_of("baud_rate", self.baud_rate, BAUD_RATES)
        for joint in (1, 2):
            one_of(f"direction_{joint}", getattr(self, f"direction_{joint}"), (1, -1))
            if getattr(self, f"lower_{joint}") >= getattr(self, f"upper_{joint}"):
                raise OutOfRange("lower_{joint} must be below upper_{joint}", joint=joint)
        if self.id_1 == self.id_2:
            raise OutOfRange("id_2 must differ from id_1, which is {id_1}", id_1=self.id_1)

    @property
    def ids(self) -> tuple[int, int]:
        """Return the bus ids of joints 1 and 2."""
        return self.id_1, self.id_2
