"""The 2F gripper: activation, gripping, lost parts, stop, control, scaling, settings."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, strategies as st

from arcor2_drivers.robotiq_2f import scaling
from arcor2_drivers.robotiq_2f.robotiq_2f import Robotiq2F
from arcor2_drivers.robotiq_2f.settings import Model, Robotiq2FSettings, Wire
from arcor2_drivers.robotiq_2f.status import FAULTS
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.data.object_type import Box
from arcor2_hw.exceptions import (
    Arcor2Error,
    Cancelled,
    DeviceFault,
    DeviceTimeout,
    NotFound,
    NotInControl,
    OutOfRange,
    Refused,
)
from arcor2_hw.objects.small import GripperState
from tests.drivers.background_call import BackgroundCall
from tests.drivers.surroundings import Carrier
from tests.fakes.conftest import FakeProcess


def test_connecting_and_taking_control_write_nothing(fake: FakeProcess, make: Callable[..., Robotiq2F]) -> None:
    commands = fake.truth()["count"]
    observed = make(fake.ready["ascii"])
    observed.connect()
    observed.connect()  # has no effect when connected
    assert observed.connection is Connection.ONLINE
    assert observed.state() is GripperState.INACTIVE
    assert observed.control_owner() is None
    with pytest.raises(NotInControl, match="grip to 0 m is refused: nobody has control"):
        observed.grip()
    with pytest.raises(NotInControl, match="activate is refused"):
        observed.activate()
    observed.stop()
    observed.take_control()
    with pytest.raises(Refused, match="release is refused in state inactive: activate it first"):
        observed.release()
    assert fake.truth()["count"] == commands
    assert fake.truth()["registers"]["STA"] == 0
    observed.disconnect()
    observed.disconnect()
    assert fake.truth()["count"] == commands


def test_a_complete_cycle(fake: FakeProcess, gripper: Robotiq2F) -> None:
    assert gripper.state() is GripperState.AT_POSITION
    commands = fake.truth()["count"]
    gripper.activate()  # has no effect when activated
    assert fake.truth()["count"] == commands

    fake.control.do("put_part", width=0.04)
    held, width = gripper.grip(0.01, force=127.5, speed=0.15)
    assert held
    assert width == pytest.approx(0.04, abs=0.0002)
    requested = fake.truth()["registers"]
    assert (requested["PRE"], requested["FOR"], requested["SPE"]) == (203, 128, 255)
    assert fake.truth()["gripped"]
    assert gripper.state() is GripperState.HOLDING
    assert gripper.part_held()

    gripper.release()
    assert not gripper.part_held()
    assert gripper.width() == pytest.approx(0.085)
    assert gripper.shown_values == {"width": 0.085}
    fake.control.do("remove_part")
    assert gripper.grip(0.03, speed=0.15) == (False, pytest.approx(0.03, abs=0.0002))
    assert gripper.state() is GripperState.AT_POSITION


def test_repeating_a_grip_returns_the_present_result(fake: FakeProcess, gripper: Robotiq2F) -> None:
    fake.control.do("put_part", width=0.05)
    assert gripper.grip(0.0, speed=0.15)[0]
    assert gripper.grip(0.0, speed=0.15)[0]
    fake.control.do("remove_part")
    assert gripper.grip(0.0, speed=0.15) == (False, 0.0)


def test_a_lost_part_is_detected(fake: FakeProcess, gripper: Robotiq2F, wait_for: Callable[..., Any]) -> None:
    fake.control.do("put_part", width=0.04)
    assert gripper.grip(0.0, speed=0.15)[0]
    fake.control.do("remove_part")
    wait_for(gripper.state, lambda state: state is GripperState.LOST)
    wait_for(lambda: fake.truth()["registers"]["OBJ"], lambda found: found == 3)
    assert not gripper.part_held()
    assert gripper.state() is GripperState.LOST  # until the next command
    gripper.release()
    assert gripper.state() is GripperState.AT_POSITION


def test_the_gripped_part_is_attached_to_the_robot(
    fake: FakeProcess, gripper: Robotiq2F, wait_for: Callable[..., Any]
) -> None:
    robot = Carrier()
    gripper.mount(lambda name: robot, lambda name: robot)
    fake.control.do("put_part", width=0.04)
    gripper.grip(0.0, speed=0.15)
    (part,) = robot.parts.values()
    assert part.name == "part of gripper"
    assert isinstance(part.model, Box)
    assert part.model.size_x == pytest.approx(0.036, abs=1e-3)  # the width at which it was gripped
    assert part.in_link.position.z + part.model.size_z / 2.0 <= 0.0, "between the fingers, not beyond"
    gripper.set_part(0.05, 0.06, 0.07)
    gripper.grip(0.0, speed=0.15)
    (part,) = robot.parts.values()
    assert isinstance(part.model, Box)
    assert part.model.size_z == pytest.approx(0.066)
    gripper.release()
    assert robot.parts == {}
    gripper.grip(0.0, speed=0.15)
    assert robot.parts
    fake.control.do("remove_part")
    wait_for(lambda: robot.parts, lambda parts: not parts)
    assert gripper.state() is GripperState.LOST


def test_blocked_release_fails(fake: FakeProcess, gripper: Robotiq2F) -> None:
    gripper.grip(0.0, speed=0.15)
    fake.control.do("block")
    with pytest.raises(DeviceFault, match=r"release ended at 0\.0000 m: the fingers are blocked"):
        gripper.release()
    fake.control.do("block", on=False)
    gripper.release()


def test_stop_ends_a_grip_and_keeps_the_part(
    fake: FakeProcess, gripper: Robotiq2F, wait_for: Callable[..., Any]
) -> None:
    doing = BackgroundCall(lambda: gripper.grip(0.0, speed=0.02))
    wait_for(gripper.state, lambda state: state is GripperState.MOVING)
    with pytest.raises(Refused, match=r"is busy \(.*\): release has to wait"):
        gripper.release()
    gripper.stop()
    position = fake.truth()["position"]
    assert isinstance(doing.outcome(), Cancelled)
    assert 3 < position < 230
    assert fake.truth()["position"] == position
    assert gripper.state() is GripperState.AT_POSITION
    gripper.release()

    fake.control.do("put_part", width=0.06)
    assert gripper.grip(0.0, speed=0.15)[0]
    commands = fake.truth()["count"]
    gripper.stop()
    assert fake.truth()["count"] == commands
    assert gripper.part_held()


def test_stop_ends_an_activation(fake: FakeProcess, observed: Robotiq2F, wait_for: Callable[..., Any]) -> None:
    observed.take_control()
    doing = BackgroundCall(observed.activate)
    wait_for(lambda: fake.truth()["registers"]["STA"] == 1)
    observed.stop()
    assert isinstance(doing.outcome(), Cancelled)
    assert fake.truth()["registers"]["STA"] == 0
    observed.activate()
    assert observed.state() is GripperState.AT_POSITION


def test_major_fault_ends_a_grip_and_is_acknowledged(
    fake: FakeProcess, gripper: Robotiq2F, wait_for: Callable[..., Any]
) -> None:
    code = 0x0E
    doing = BackgroundCall(lambda: gripper.grip(0.0, speed=0.02))
    wait_for(gripper.state, lambda state: state is GripperState.MOVING)
    fake.control.do("fault", code=code)
    error = doing.outcome()
    assert isinstance(error, DeviceFault)
    assert error.fault_code == code
    assert "gripper at 127.0.0.1" in str(error)
    assert "overcurrent" in str(error)
    assert error.detail == FAULTS[code].remedy
    (alarm,) = gripper.alarms()
    assert (alarm.code, alarm.text) == ("14", "overcurrent")
    assert gripper.health is Health.FAILURE
    with pytest.raises(DeviceFault):
        gripper.release()
    with pytest.raises(NotFound):
        gripper.acknowledge("5")
    gripper.acknowledge(str(code))
    assert gripper.alarms() == []
    assert gripper.state() is GripperState.INACTIVE
    gripper.activate()


def test_a_minor_fault_is_reported_until_its_cause_is_removed(
    fake: FakeProcess, gripper: Robotiq2F, wait_for: Callable[..., Any]
) -> None:
    fake.control.do("fault", code=8)
    wait_for(gripper.alarms)
    assert gripper.health is Health.OFF_SPEC
    with pytest.raises(Refused, match="let the gripper cool down"):
        gripper.acknowledge("8")
    fake.control.do("fault", code=0)
    wait_for(lambda: gripper.health is Health.NORMAL)


def test_interference_fails_the_activation(fake: FakeProcess, observed: Robotiq2F) -> None:
    observed.take_control()
    fake.control.do("put_part", width=0.05)
    with pytest.raises(DeviceFault, match="activate ended by fault 13"):
        observed.activate()


def test_a_power_cycle_during_a_grip(fake: FakeProcess, gripper: Robotiq2F, wait_for: Callable[..., Any]) -> None:
    doing = BackgroundCall(lambda: gripper.grip(0.0, speed=0.02))
    wait_for(gripper.state, lambda state: state is GripperState.MOVING)
    fake.control.do("power_cycle")
    assert isinstance(doing.outcome(), DeviceFault)
    assert gripper.state() is GripperState.INACTIVE
    commands = fake.truth()["count"]
    with pytest.raises(Refused, match="activate it first"):
        gripper.grip()
    assert fake.truth()["count"] == commands


def test_another_client_is_detected_and_named(
    fake: FakeProcess, gripper: Robotiq2F, make: Callable[..., Robotiq2F], wait_for: Callable[..., Any]
) -> None:
    gripper.grip(0.02, speed=0.15)
    other = make(fake.ready["ascii"])
    other.connect()
    other.take_control()
    doing = BackgroundCall(lambda: other.grip(0.08, speed=0.02))
    wait_for(lambda: gripper.control_owner() != "us")
    with pytest.raises(NotInControl, match="another client of the gripper, which requested position 16"):
        gripper.release()
    with pytest.raises(NotInControl, match="another client, which moves the gripper, has it"):
        gripper.take_control()
    other.stop()
    doing.outcome()
    gripper.take_control()
    gripper.release()


def test_values_out_of_range_send_nothing(fake: FakeProcess, gripper: Robotiq2F) -> None:
    commands = fake.truth()["count"]
    for name, value in (("width", 0.2), ("width", -0.01), ("force", 5.0), ("force", 300.0), ("speed", float("nan"))):
        with pytest.raises(OutOfRange, match=f"{name} must be"):
            gripper.grip(**{name: value})
    assert fake.truth()["count"] == commands


def test_a_grip_that_takes_too_long_is_stopped(
    fake: FakeProcess, gripper: Robotiq2F, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arcor2_drivers.robotiq_2f.robotiq_2f.MARGIN", -5.05)
    with pytest.raises(DeviceTimeout, match=r"gripper at .*: grip to 0 m took longer than 0\.2 s"):
        gripper.grip(0.0, speed=0.02)
    gripper._await_standstill()
    assert 3 < fake.truth()["position"] < 230


@given(st.floats(0.0, 0.085))
def test_widths_round_trip_through_scaling(width: float) -> None:
    settings = Robotiq2FSettings(host="h")
    position = scaling.position(settings, width)
    assert settings.open_position <= position <= settings.closed_position
    assert abs(scaling.width(settings, position) - width) <= 0.085 / 227 / 2 + 1e-9


def test_scaling_by_the_limits_of_the_model() -> None:
    settings = Robotiq2FSettings(host="h", model=Model.TWO_F_140, tcp_z=0.23)
    assert (scaling.position(settings, 0.14), scaling.position(settings, 0.0)) == (3, 230)
    assert (scaling.force(settings, 10.0), scaling.force(settings, 125.0)) == (0, 255)
    assert (scaling.speed(settings, 0.03), scaling.speed(settings, 0.25)) == (0, 255)
    assert (scaling.width(settings, 0), scaling.width(settings, 255)) == (0.14, 0.0)


def test_tool_and_limits_default_to_those_of_the_model() -> None:
    small = Robotiq2F("id", "small", Robotiq2FSettings(host="h"))
    large = Robotiq2F("id", "large", Robotiq2FSettings(host="h", model=Model.TWO_F_140, tcp_z=0.23, max_force=100.0))
    assert (small.mass, small.tcp.position.z) == (0.925, 0.163)
    assert (large.mass, large.tcp.position.z) == (1.025, 0.23)
    assert (large._s.stroke, large._s.min_force, large._s.max_force) == (0.14, 10.0, 100.0)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"host": " "}, "host"),
        ({"port": 0}, "port"),
        ({"wire": Wire.MODBUS_RTU}, "serial_port"),
        ({"baud_rate": 1}, "baud_rate"),
        ({"unit_id": 0}, "unit_id"),
        ({"request_timeout": 0.0}, "request_timeout"),
        ({"activation_timeout": float("inf")}, "activation_timeout"),
        ({"stroke": 1.0}, "stroke"),
        ({"open_position": -1}, "open_position"),
        ({"closed_position": 3}, "closed_position"),
        ({"max_force": 20.0}, "max_force"),
        ({"min_speed": -0.1}, "min_speed"),
        ({"model": Model.TWO_F_140}, "tcp_z"),
        ({"mass": 50.0}, "mass"),
        ({"max_speed": 0.01}, "max_speed"),
    ],
)
def test_an_invalid_setting_names_the_parameter(wrong: dict[str, Any], named: str) -> None:
    with pytest.raises(OutOfRange, match=f"^{named} must be") as caught:
        Robotiq2FSettings(**{"host": "gripper.local", **wrong})
    assert isinstance(caught.value, Arcor2Error)
