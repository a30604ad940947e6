"""Backups of the setup of the drive, over SDO."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from arcor2_drivers.conveyor.conveyor import Conveyor
from arcor2_hw.data.maintenance import DeviceParameter
from arcor2_hw.exceptions import Refused
from tests.fakes.conftest import FakeProcess

WINDOW = "following error window (6065h)"
RATIO = "motor revolutions of the gear (6091h:01)"
ABSENT = "home offset (607Ch)"


def value_of(belt: Conveyor, name: str) -> object:
    return next(each.value for each in belt.parameters_dump() if each.name == name)


def test_parameters_are_written_and_stored_and_failures_are_named(
    observed: Conveyor, fake: FakeProcess, make: Callable[..., Conveyor]
) -> None:
    before = observed.parameters_dump()
    names = [each.name for each in before]
    assert RATIO in names
    assert "position window (6067h)" not in names  # this drive has none
    wanted = [
        DeviceParameter(WINDOW, 500),
        DeviceParameter("maximum torque (6072h)", 9000),
        DeviceParameter("polarity (607Eh)", "reversed"),
        DeviceParameter("velocity window (606Dh)", 1),
        DeviceParameter("color", 1),
    ]
    failures = {each.name: each.reason for each in observed.parameters_restore(wanted)}
    assert "refuses writing 9000" in failures["maximum torque (6072h)"]
    assert "reversed is not a value" in failures["polarity (607Eh)"]
    assert "06020000h" in failures["velocity window (606Dh)"]
    assert "knows no parameter color" in failures["color"]
    assert len(failures) == 4
    observed.disconnect()
    fake.control.do("power_cycle")
    fake.control.wait_until(lambda truth: truth["booted"])
    again = make(fake.ready["can"])
    again.connect()
    assert value_of(again, WINDOW) == 500
    assert again.parameters_restore(before) == []
    assert again.parameters_dump() == before


def test_nothing_is_written_to_an_enabled_drive(belt: Conveyor) -> None:
    before = belt.parameters_dump()
    belt.reset()
    with pytest.raises(Refused, match="only while the drive is switched off"):
        belt.parameters_restore([replace(before[0], value=1)])
    assert belt.parameters_dump() == before
