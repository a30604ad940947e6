"""Settings of a vacuum gripper, checked when they are given."""

import dataclasses
import math

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.gripping import check_part_size


def within(name: str, value: float, low: float, high: float) -> None:
    """Raise OutOfRange, naming the parameter, unless the value lies in the range."""
    if not (math.isfinite(value) and low <= value <= high):
        raise OutOfRange(f"{name} must be {low:g} to {high:g}, not {value!r}")


@dataclasses.dataclass
class VacuumGripperSettings(Settings):
    """The points are named as the carrier names them.

    :param carrier: name of the robot or I/O block in the scene whose outputs are used
    :param vacuum_output: digital output that makes the vacuum
    :param blow_output: digital output of the blast of air; empty: there is none
    :param part_input: digital input that is on while a part is held; empty: there is none
    :param vacuum_input: analogue input of the vacuum below the surrounding pressure, Pa; empty: there is none
    :param part_vacuum: vacuum from which on a part counts as held, where no part_input tells, Pa
    :param grip_time: longest time for a part to be held; without a sensor the time that is waited, s
    :param release_time: longest time for a part to be gone; without a sensor the time that is waited, s
    :param blow_time: length of the blast of air, s
    :param lost_after: a part is lost when it is not sensed for that long, s
    :param robot: name of the robot that carries the gripper; empty: the carrier, or the only robot of the scene
    :param part_size_x: edge of a gripped part along the x axis of the tool, m; 0: unknown, safe moves ignore the part
    :param part_size_y: edge of a gripped part along the y axis of the tool, m
    :param part_size_z: edge of a gripped part along the z axis of the tool, m
    """

    carrier: str
    vacuum_output: str
    blow_output: str = ""
    part_input: str = ""
    vacuum_input: str = ""
    part_vacuum: float = 30_000.0
    grip_time: float = 1.0
    release_time: float = 1.0
    blow_time: float = 0.2
    lost_after: float = 0.1
    robot: str = ""
    part_size_x: float = 0.0
    part_size_y: float = 0.0
    part_size_z: float = 0.0

    def __post_init__(self) -> None:
        for name in ("carrier", "vacuum_output"):
            if not getattr(self, name).strip():
                raise OutOfRange(f"{name} must not be empty")
        points = [p for p in (self.vacuum_output, self.blow_output, self.part_input, self.vacuum_input) if p]
        if len(set(points)) != len(points):
            raise OutOfRange(f"each point serves once: {', '.join(points)}")
        within("part_vacuum", self.part_vacuum, 1.0, 101_325.0)
        within("grip_time", self.grip_time, 0.0, 60.0)
        within("release_time", self.release_time, 0.0, 60.0)
        within("blow_time", self.blow_time, 0.01, 10.0)
        within("lost_after", self.lost_after, 0.0, 10.0)
        check_part_size(self, within)
