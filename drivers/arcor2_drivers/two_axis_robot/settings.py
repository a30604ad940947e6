"""Settings of a two-axis robot, checked when they are given."""

import dataclasses
import math
from typing import Final

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import check_serial_port

BAUD_RATES: Final = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000)
LONGEST_WATCHDOG: Final = 0.6
"""s: up to this value the servos stop within the time that the type declares (`loss_reaction`)."""


def within(name: str, value: float, low: float, high: float) -> None:
    """Raise OutOfRange, naming the parameter, unless the value lies in the range."""
    if not (math.isfinite(value) and low <= value <= high):
        raise OutOfRange(f"{name} must be {low:g} to {high:g}, not {value!r}")


@dataclasses.dataclass
class TwoAxisRobotSettings(Settings):
    """SI units. Joint 1 stands in the base, joint 2 at the end of link 1; 0 rad is the middle of a servo's turn.

    :param port: serial port of the bus adapter
    :param baud_rate: bit/s, as set in both servos
    :param id_1: bus id of joint 1
    :param id_2: bus id of joint 2
    :param direction_1: 1, or -1 when joint 1 is mounted the other way round
    :param direction_2: 1, or -1 when joint 2 is mounted the other way round
    :param homing_offset_1: added to what the encoder of joint 1 tells, rad, at most a quarter turn
    :param homing_offset_2: added to what the encoder of joint 2 tells, rad, at most a quarter turn
    :param link_1: length from axis 1 to axis 2, m
    :param link_2: length from axis 2 to the tool centre point, m
    :param lower_1: lower limit of joint 1, rad
    :param upper_1: upper limit of joint 1, rad
    :param lower_2: lower limit of joint 2, rad
    :param upper_2: upper limit of joint 2, rad
    :param max_joint_speed: what speed 1 means, rad/s
    :param joint_acceleration: what acceleration 1 means, rad/s²
    :param stop_deceleration: deceleration of a stop, rad/s²
    :param current_limit: most that a servo may draw, A
    :param watchdog: a servo stops when it has heard nothing for that long, s
    """

    port: str
    baud_rate: int = 1_000_000
    id_1: int = 1
    id_2: int = 2
    direction_1: int = 1
    direction_2: int = 1
    homing_offset_1: float = 0.0
    homing_offset_2: float = 0.0
    link_1: float = 0.15
    link_2: float = 0.10
    lower_1: float = -2.6
    upper_1: float = 2.6
    lower_2: float = -2.6
    upper_2: float = 2.6
    max_joint_speed: float = 3.0
    joint_acceleration: float = 12.0
    stop_deceleration: float = 30.0
    current_limit: float = 1.0
    watchdog: float = 0.4

    def __post_init__(self) -> None:
        check_serial_port("port", self.port, sockets=False)
        if self.baud_rate not in BAUD_RATES:
            raise OutOfRange(f"baud_rate must be one of {', '.join(map(str, BAUD_RATES))}, not {self.baud_rate!r}")
        for joint in (1, 2):
            within(f"id_{joint}", getattr(self, f"id_{joint}"), 0, 252)
            if getattr(self, f"direction_{joint}") not in (1, -1):
                raise OutOfRange(f"direction_{joint} must be 1 or -1, not {getattr(self, f'direction_{joint}')!r}")
            within(f"homing_offset_{joint}", getattr(self, f"homing_offset_{joint}"), -math.pi / 2, math.pi / 2)
            within(f"link_{joint}", getattr(self, f"link_{joint}"), 0.005, 1.0)
            within(f"lower_{joint}", getattr(self, f"lower_{joint}"), -3.14, 3.14)
            within(f"upper_{joint}", getattr(self, f"upper_{joint}"), -3.14, 3.14)
            if getattr(self, f"lower_{joint}") >= getattr(self, f"upper_{joint}"):
                raise OutOfRange(f"lower_{joint} must be below upper_{joint}")
        if self.id_1 == self.id_2:
            raise OutOfRange(f"id_2 must differ from id_1, which is {self.id_1}")
        within("max_joint_speed", self.max_joint_speed, 0.1, 8.0)
        within("joint_acceleration", self.joint_acceleration, 0.5, 100.0)
        within("stop_deceleration", self.stop_deceleration, 10.0, 200.0)
        within("current_limit", self.current_limit, 0.05, 3.2)
        # Below, a request asked for twice would trip it.
        within("watchdog", self.watchdog, 0.16, LONGEST_WATCHDOG)

    @property
    def ids(self) -> tuple[int, int]:
        """Give the bus ids of joints 1 and 2."""
        return self.id_1, self.id_2
