"""Settings of a vacuum gripper."""

import dataclasses
from typing import Annotated

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.gripping import check_part_size
from arcor2_hw.objects.settings import Range, within


@dataclasses.dataclass
class VacuumGripperSettings(Settings):
    """Points of the carrier that the gripper uses, by their names on the carrier.

    :param carrier: name of the robot or I/O block in the scene whose outputs are used
    :param vacuum_output: digital output that switches the vacuum
    :param blow_output: digital output that switches the blast of air; empty: none
    :param part_input: digital input that is on while a part is held; empty: none
    :param vacuum_input: analogue input of the vacuum below ambient pressure, Pa; empty: none
    :param part_vacuum: vacuum from which on a part counts as held, if there is no part_input, Pa
    :param grip_time: longest time until a part is held; without a sensor the time to wait, s
    :param release_time: longest time until a part is released; without a sensor the time to wait, s
    :param blow_time: duration of the blast of air, s
    :param lost_after: time without a sensed part after which it counts as lost, s
    :param robot: name of the robot that carries the gripper; empty: the carrier, or the only robot of the scene
    :param part_size_x: size of a gripped part along the x axis of the tool, m; 0: unknown, safe moves ignore the part
    :param part_size_y: size of a gripped part along the y axis of the tool, m
    :param part_size_z: size of a gripped part along the z axis of the tool, m
    """

    carrier: str
    vacuum_output: str
    blow_output: str = ""
    part_input: str = ""
    vacuum_input: str = ""
    part_vacuum: Annotated[float, Range(1.0, 101_325.0, "Pa")] = 30_000.0
    grip_time: Annotated[float, Range(0.0, 60.0, "s")] = 1.0
    release_time: Annotated[float, Range(0.0, 60.0, "s")] = 1.0
    blow_time: Annotated[float, Range(0.01, 10.0, "s")] = 0.2
    lost_after: Annotated[float, Range(0.0, 10.0, "s")] = 0.1
    robot: str = ""
    part_size_x: float = 0.0
    part_size_y: float = 0.0
    part_size_z: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("carrier", "vacuum_output"):
            if not getattr(self, name).strip():
                raise OutOfRange("{name} must not be empty", name=name)
        points = [p for p in (self.vacuum_output, self.blow_output, self.part_input, self.vacuum_input) if p]
        if len(set(points)) != len(points):
            raise OutOfRange("each point may be used once: {points}", points=", ".join(points))
        check_part_size(self, within)
