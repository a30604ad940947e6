"""The vacuum gripper on an I/O block: parts gripped, lost and stuck; stops; faults of the carrier."""

import threading
import time
from typing import Any

import pytest

from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.vacuum_gripper.settings import VacuumGripperSettings
from arcor2_drivers.vacuum_gripper.suction_gripper import SuctionGripper
from arcor2_hw.data.device import Connection, Health, LossKind
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceFault,
    DeviceTimeout,
    InvalidData,
    NotConnected,
    NotFound,
    NotInControl,
    OutOfRange,
    Refused,
    Stale,
)
from arcor2_hw.objects import Generic
from tests.drivers.background_call import BackgroundCall
from tests.drivers.surroundings import Carrier
from tests.fakes.conftest import FakeProcess
from tests.waiting import wait_for

from .conftest import Make

VACUUM, BLOW = 0, 1


def part(fake: FakeProcess, there: bool) -> None:
    fake.control.do("set_input", number=0, on=there)


def output(fake: FakeProcess, number: int) -> bool:
    return bool(fake.truth()["outputs"][number])


@pytest.fixture
def holding(gripper: SuctionGripper, fake: FakeProcess) -> SuctionGripper:
    """Grip a part."""
    part(fake, True)
    gripper.grip()
    return gripper


def test_a_part_is_gripped_and_released(gripper: SuctionGripper, fake: FakeProcess) -> None:
    doing = BackgroundCall(gripper.grip)
    wait_for(lambda: output(fake, VACUUM))
    time.sleep(0.1)
    assert not gripper.part_held(), "the sensor has not reported a part yet"
    part(fake, True)
    assert doing.outcome() is None
    assert gripper.is_part_held()
    gripper.check_part()
    doing = BackgroundCall(gripper.release)
    wait_for(lambda: output(fake, BLOW))
    assert not output(fake, VACUUM), "no air is blown while the vacuum is on"
    part(fake, False)
    assert doing.outcome() is None
    assert not output(fake, BLOW)
    assert gripper.alarms() == []


def test_a_missed_part_is_an_error_and_switches_the_vacuum_off(make: Make, fake: FakeProcess) -> None:
    gripper = make(grip_time=0.2)
    gripper.connect()
    gripper.take_control()
    with pytest.raises(DeviceFault, match="gripper holds nothing") as fault:
        gripper.grip()
    assert fault.value.fault_code == "nothing_held"
    assert not output(fake, VACUUM)
    with pytest.raises(DeviceFault, match="lost its part"):
        gripper.check_part()


def test_the_part_is_attached_to_the_robot_until_released_or_lost(make: Make, fake: FakeProcess) -> None:
    robot = Carrier()
    gripper = make(part_size_x=0.1, part_size_y=0.08, part_size_z=0.02, release_time=0.2)
    gripper.mount(lambda name: robot, lambda name: robot)
    gripper.connect()
    gripper.take_control()
    part(fake, True)
    gripper.grip()
    assert [held.name for held in robot.parts.values()] == ["part of gripper"]
    assert robot.parts["part of gripper"].in_link.position.z == pytest.approx(0.01), "the part is below the cup"
    with pytest.raises(DeviceFault, match="sticks"):
        gripper.release()
    assert robot.parts, "the part sticks"
    gripper.blow_off()
    assert robot.parts == {}
    gripper.grip()
    assert robot.parts
    part(fake, False)
    wait_for(lambda: robot.parts == {})
    assert [alarm.code for alarm in gripper.alarms()] == ["part_lost"]


def test_a_stuck_part_is_an_error(make: Make, fake: FakeProcess) -> None:
    gripper = make(release_time=0.2)
    gripper.connect()
    gripper.take_control()
    part(fake, True)
    gripper.grip()
    with pytest.raises(DeviceFault, match="sticks") as fault:
        gripper.release()
    assert fault.value.fault_code == "part_sticks"
    assert not output(fake, BLOW), "blowing has ended nevertheless"


def test_a_part_lost_during_transport_is_an_alarm_and_an_error(holding: SuctionGripper, fake: FakeProcess) -> None:
    part(fake, False)
    wait_for(lambda: [alarm.code for alarm in holding.alarms()] == ["part_lost"])
    assert holding.health is Health.CHECK_FUNCTION
    part(fake, True)  # the sensor reports a part again, but the loss stays reported
    with pytest.raises(DeviceFault) as fault:
        holding.check_part()
    assert fault.value.fault_code == "part_lost"
    part(fake, False)
    with pytest.raises(DeviceFault, match="lost its part before"):
        holding.release()
    assert not output(fake, VACUUM)
    assert holding.alarms(), "until a person acknowledges it"
    with pytest.raises(NotFound):
        holding.acknowledge("other")
    holding.acknowledge("part_lost")
    assert (holding.alarms(), holding.health) == ([], Health.NORMAL)


def test_a_flicker_of_the_sensor_is_tolerated(make: Make, fake: FakeProcess) -> None:
    gripper = make(lost_after=1.5)
    gripper.connect()
    gripper.take_control()
    part(fake, True)
    gripper.grip()
    part(fake, False)
    time.sleep(0.2)
    part(fake, True)
    time.sleep(1.6)
    assert gripper.alarms() == []
    gripper.off()
    part(fake, False)
    time.sleep(0.2)
    assert gripper.alarms() == [], "a released part is not a lost one"


def test_a_stop_ends_an_action_and_keeps_the_part(gripper: SuctionGripper, fake: FakeProcess) -> None:
    doing = BackgroundCall(gripper.grip)
    wait_for(lambda: output(fake, VACUUM))
    gripper.stop()
    assert isinstance(doing.outcome(), Cancelled)
    assert output(fake, VACUUM)
    doing = BackgroundCall(gripper.blow_off)
    wait_for(lambda: output(fake, BLOW))
    gripper.stop()
    assert isinstance(doing.outcome(), Cancelled)
    assert not output(fake, BLOW)


def test_one_action_at_a_time(gripper: SuctionGripper, fake: FakeProcess) -> None:
    doing = BackgroundCall(gripper.grip)
    wait_for(lambda: output(fake, VACUUM))
    for second in (gripper.grip, gripper.release, gripper.blow_off):
        with pytest.raises(Refused, match="gripper is gripping or releasing"):
            second()
    part(fake, True)
    assert doing.outcome() is None


def test_the_vacuum_detects_a_part_without_a_switch(make: Make, fake: FakeProcess) -> None:
    gripper = make(part_input="", vacuum_input="pressure", part_vacuum=20_000.0, grip_time=0.3)
    gripper.connect()
    gripper.take_control()
    fake.control.do("set_analog", number=0, raw=12_000)
    assert gripper.measure_vacuum() == pytest.approx(12_000.0)
    with pytest.raises(DeviceFault, match="holds nothing"):
        gripper.grip()
    fake.control.do("set_analog", number=0, raw=25_000)
    gripper.grip()
    assert gripper.part_held()


def test_without_a_sensor_actions_wait_for_their_time(make: Make, fake: FakeProcess) -> None:
    gripper = make(part_input="", blow_output="", grip_time=0.3, release_time=0.2)
    gripper.connect()
    gripper.take_control()
    began = time.monotonic()
    gripper.grip()
    assert time.monotonic() - began >= 0.3
    assert gripper.part_held()
    gripper.release()
    assert not gripper.part_held()
    for refused in (gripper.blow_off, gripper.measure_vacuum):
        with pytest.raises(Refused, match="gripper has no"):
            refused()


# ------------------------------------------------------------------------------------------------ the carrier
def test_connecting_switches_nothing(make: Make, fake: FakeProcess) -> None:
    assert SuctionGripper.loss_reaction.kind is LossKind.HOLDS
    before = fake.truth()["outputs"]
    gripper = make()
    assert gripper.connection is Connection.OFFLINE
    with pytest.raises(NotConnected, match=r"gripper.*block"):
        gripper.part_held()
    gripper.connect()
    assert gripper.connection is Connection.ONLINE
    assert gripper.control_owner() != "us"
    gripper.disconnect()
    assert fake.truth()["outputs"] == before


def test_without_control_nothing_is_switched(make: Make, block: RemoteIO, fake: FakeProcess) -> None:
    gripper = make()
    gripper.connect()
    with pytest.raises(NotInControl, match="gripper on block"):
        gripper.on()
    assert not output(fake, VACUUM)
    gripper.take_control()
    assert block.control_owner() == "us", "the carrier has control"
    gripper.on()
    assert output(fake, VACUUM)
    gripper.disconnect()
    assert output(fake, VACUUM), "releasing control of the carrier does not drop the part"


def test_an_output_that_does_not_hold_on_loss_is_refused(make: Make) -> None:
    gripper = make(vacuum_output="falls")
    with pytest.raises(InvalidData, match="falls of block goes off on a loss"):
        gripper.connect()
    assert gripper.connection is Connection.FAILED


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"carrier": "nobody"}, "nobody"),
        ({"vacuum_output": "part2"}, "no digital output 'part2'; it has vacuum, blow, falls"),
        ({"part_input": "pressure", "vacuum_input": ""}, "no digital input 'pressure'; it has part"),
        ({"blow_output": "part", "part_input": ""}, "no digital output 'part'"),
        ({"vacuum_input": "falls"}, "no analog input 'falls'"),
    ],
)
def test_missing_points_of_the_carrier_are_named(make: Make, settings: dict[str, str], problem: str) -> None:
    with pytest.raises((InvalidData, NotFound), match=problem):
        make(**settings).connect(0.3)


def test_connecting_waits_for_the_carrier(make: Make, block: RemoteIO) -> None:
    block.disconnect()
    gripper = make()
    with pytest.raises(NotConnected, match="gripper: block is not connected"):
        gripper.connect(0.2)
    doing = BackgroundCall(lambda: gripper.connect(10.0))
    time.sleep(0.1)
    block.connect()
    assert doing.outcome() is None
    assert gripper.connection is Connection.ONLINE


def test_connecting_waits_for_a_carrier_that_is_about_to_reconnect(
    make: Make, block: RemoteIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    read, failures = block.read, [NotConnected("the link is being opened again"), ConnectionLost("no answer")]

    def failing_first(name: str) -> Any:
        if failures:
            raise failures.pop()
        return read(name)

    monkeypatch.setattr(block, "read", failing_first)
    gripper = make()
    gripper.connect(5.0)
    assert not failures
    assert gripper.connection is Connection.ONLINE


def test_disconnecting_ends_the_wait_for_a_lost_carrier(gripper: SuctionGripper, block: RemoteIO) -> None:
    searched = threading.Event()

    def find(name: str) -> Generic:
        searched.set()
        return block

    gripper.attach(find)
    block.disconnect()
    assert searched.wait(30.0), "the gripper does not wait for its carrier"
    gripper.disconnect()
    assert f"observing {gripper.who}" not in {thread.name for thread in threading.enumerate()}
    block.connect()
    gripper.connect()
    assert gripper.connection is Connection.ONLINE


def test_a_lost_carrier_returns_no_old_values(holding: SuctionGripper, fake: FakeProcess) -> None:
    fake.control.do("silence")
    try:
        wait_for(lambda: holding.connection is Connection.LOST)
        assert holding.health is Health.FAILURE
        with pytest.raises((ConnectionLost, DeviceTimeout, Stale), match="gripper on block"):
            holding.part_held()
        assert holding.alarms() == [], "without a sensor value no part is reported lost"
    finally:
        fake.control.do("heal")
    wait_for(lambda: holding.connection in (Connection.BACK, Connection.ONLINE))
    with pytest.raises(NotInControl):
        holding.off()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("carrier", " "),
        ("vacuum_output", ""),
        ("blow_output", "vacuum"),
        ("grip_time", -1.0),
        ("blow_time", 0.0),
        ("part_vacuum", float("nan")),
        ("lost_after", 99.0),
    ],
)
def test_an_invalid_setting_is_named(name: str, value: object) -> None:
    chosen: dict[str, Any] = {"carrier": "block", "vacuum_output": "vacuum", name: value}
    with pytest.raises(OutOfRange, match=name if name != "blow_output" else "may be used once"):
        VacuumGripperSettings(**chosen)
