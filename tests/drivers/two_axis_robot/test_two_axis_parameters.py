"""Backups of the setup of the servos, over the bus."""

import pytest
from msgspec.structs import replace

from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot
from arcor2_hw.data.maintenance import DeviceParameter
from arcor2_hw.exceptions import Refused

SPEED = "servo 2: velocity limit"


def speed_of(robot: TwoAxisRobot) -> object:
    return next(each.value for each in robot.parameters_dump() if each.name == SPEED)


def test_parameters_are_written_and_failures_are_named(robot: TwoAxisRobot) -> None:
    (speed,) = (each for each in robot.parameters_dump() if each.name == SPEED)
    wanted = [
        replace(speed, value=150),
        DeviceParameter("servo 1: temperature limit", 255),
        DeviceParameter("servo 1: PWM limit", "much"),
        DeviceParameter("servo 3: PWM limit", 5),
    ]
    failures = {each.name: each.reason for each in robot.parameters_restore(wanted)}
    assert speed_of(robot) == 150
    assert "beyond the register's limit" in failures["servo 1: temperature limit"]
    assert "not a value of a register of 2 bytes" in failures["servo 1: PWM limit"]
    assert "no parameter servo 3: PWM limit" in failures["servo 3: PWM limit"]
    assert len(failures) == 3


def test_nothing_is_written_under_torque(ready: TwoAxisRobot) -> None:
    before = ready.parameters_dump()
    with pytest.raises(Refused, match="only without torque"):
        ready.parameters_restore([DeviceParameter(SPEED, 150)])
    assert ready.parameters_dump() == before
