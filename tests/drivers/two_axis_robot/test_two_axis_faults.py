"""Faults of the two-axis robot: absent, silent, garbage, unplugged, killed, hardware errors."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from arcor2_drivers.two_axis_robot.bus import Bus
from arcor2_drivers.two_axis_robot.control import Control
from arcor2_drivers.two_axis_robot.registers import HOMING_OFFSET, STATE, TORQUE
from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.data.robot import Joint, Safety
from arcor2_hw.exceptions import (
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    InvalidData,
    NotConnected,
    NotFound,
    NotInControl,
    Refused,
    Stale,
)
from tests.fakes.conftest import FakeProcess

from .conftest import BackgroundCall, moving, standing

FAR = [Joint("joint_1", 2.0), Joint("joint_2", -2.0)]
HOME = [Joint("joint_1", 0.0), Joint("joint_2", 0.0)]
Make = Callable[..., TwoAxisRobot]
WaitFor = Callable[..., object]


def test_a_missing_port_or_one_in_use_is_named(fake: FakeProcess, make: Make, robot: TwoAxisRobot) -> None:
    absent = make("/dev/ttyNOBODY")
    with pytest.raises(NotConnected, match=r"arm: port /dev/ttyNOBODY"):
        absent.connect()
    assert absent.connection is Connection.FAILED
    with pytest.raises(NotConnected, match=fake.ready["port"]):
        make(fake.ready["port"]).connect()


def test_an_absent_servo_is_named(fake: FakeProcess, make: Make) -> None:
    fake.control.do("absent", servo=2)
    robot = make(fake.ready["port"])
    with pytest.raises(DeviceTimeout, match=rf"servo 2 of arm at {fake.ready['port']}"):
        robot.connect(2.0)
    fake.control.do("absent", servo=2, on=False)
    robot.connect()
    assert robot.connection is Connection.ONLINE


def test_garbage_and_noise_do_not_hang(fake: FakeProcess, make: Make) -> None:
    fake.control.do("garbage")
    robot = make(fake.ready["port"])
    with pytest.raises(DeviceTimeout, match="servo 1 of arm at"):
        robot.connect(2.0)


def test_one_damaged_answer_is_tolerated(fake: FakeProcess, ready: TwoAxisRobot) -> None:
    fake.control.do("wrong_crc")
    ready.move_to_joints(HOME, 0.5)
    assert ready.connection is Connection.ONLINE
    assert ready.control_owner() == "us"


@pytest.mark.parametrize("reading", ["read", "sync_read"])
def test_control_is_taken_although_an_answer_is_missing(
    robot: TwoAxisRobot, monkeypatch: pytest.MonkeyPatch, reading: str
) -> None:
    step = {"read": "_set_up", "sync_read": "_enable"}[reading]
    perform, read, missing = getattr(Control, step), getattr(Bus, reading), [False]

    def performed(control: Control, bus: Bus) -> None:
        missing[0] = True
        perform(control, bus)

    def answered(bus: Bus, *arguments: Any) -> Any:
        if missing[0]:
            missing[0] = False
            raise DeviceTimeout("no answer")
        return read(bus, *arguments)

    monkeypatch.setattr(Control, step, performed)
    monkeypatch.setattr(Bus, reading, answered)
    robot.take_control()
    assert robot.control_owner() == "us"
    assert robot.connection is Connection.ONLINE


@pytest.mark.parametrize("fault", ["half_frame", "garbage", "unplug"])
def test_a_connection_loss_during_a_move(fake: FakeProcess, ready: TwoAxisRobot, wait_for: WaitFor, fault: str) -> None:
    doing = BackgroundCall(ready.move_to_joints, FAR, 0.5)
    moving(fake)
    fake.control.do(fault)
    with pytest.raises((ConnectionLost, NotInControl, DeviceTimeout), match="arm"):
        doing.result()
    stopped = fake.control.wait_until(standing)["servos"]["1"]
    assert stopped["watchdog"] == 0xFF  # the servo itself stopped
    assert 0.0 < stopped["angle"] < 2.0
    wait_for(lambda: ready.connection is Connection.LOST)
    assert ready.health is Health.FAILURE
    with pytest.raises((ConnectionLost, Stale)):
        ready.robot_joints()
    fake.control.do("heal")
    fake.control.do("plug")
    wait_for(lambda: ready.connection is Connection.BACK)
    with pytest.raises(NotInControl, match="lost"):  # only observation is restored by itself
        ready.move_to_joints(HOME, 0.5)
    assert fake.truth()["servos"]["1"]["angle"] == stopped["angle"]
    ready.take_control()
    assert fake.truth()["servos"]["1"]["angle"] == pytest.approx(stopped["angle"], abs=0.002)
    ready.check_if_ready_to_move()


KILLED = """
import sys
from arcor2_drivers.two_axis_robot.settings import TwoAxisRobotSettings
from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
robot = TwoAxisRobot("id", "arm", Pose(), TwoAxisRobotSettings(sys.argv[1], watchdog=0.4))
robot.connect()
robot.take_control()
robot.move_to_joints([Joint("joint_1", 2.0), Joint("joint_2", -2.0)], 0.3)
"""


def test_the_servos_stop_when_the_process_is_killed(fake: FakeProcess, make: Make) -> None:
    process = subprocess.Popen([sys.executable, "-c", KILLED, fake.ready["port"]], cwd=Path(__file__).parents[3])
    try:
        fake.control.wait_until(lambda t: t["servos"]["1"]["speed"] > 0.5)
        os.kill(process.pid, signal.SIGKILL)
    finally:
        process.kill()
        process.wait()
    servo = fake.control.wait_until(standing)["servos"]["1"]
    assert servo["watchdog"] == 0xFF
    assert servo["angle"] < 1.9
    robot = make(fake.ready["port"])
    robot.connect()
    assert robot.control_owner() is None
    robot.take_control()
    assert fake.truth()["servos"]["1"]["angle"] == pytest.approx(servo["angle"], abs=0.002)


def test_a_hardware_error_is_named_and_cleared_by_a_person(fake: FakeProcess, ready: TwoAxisRobot) -> None:
    doing = BackgroundCall(ready.move_to_joints, FAR, 0.5)
    moving(fake)
    fake.control.do("hardware_error", servo=2, bits=0x20)
    with pytest.raises(DeviceFault, match=r"servo 2: overload") as caught:
        doing.result()
    assert caught.value.fault_code == "2:5"
    assert ready.state().safety is Safety.FAULT
    assert ready.health is Health.FAILURE
    assert ready.control_owner() is None
    assert [alarm.code for alarm in ready.alarms()] == ["2:5"]
    assert fake.control.wait_until(standing)["servos"]["1"]["angle"] < 1.9  # the other joint does not continue alone
    with pytest.raises(DeviceFault, match="overload"):
        ready.take_control()
    with pytest.raises(Refused, match="restart_safety"):
        ready.acknowledge("2:5")
    with pytest.raises(NotFound):
        ready.acknowledge("1:5")
    with pytest.raises(InvalidData):
        ready.restart_safety(" ")
    ready.restart_safety("the one at the cell")
    assert ready.alarms() == []
    assert ready.connection is Connection.ONLINE
    servo = fake.truth()["servos"]["2"]
    assert servo["torque"] == 0
    with pytest.raises(NotInControl):
        ready.move_to_joints(HOME, 0.5)
    with pytest.raises(Refused, match="no hardware error"):
        ready.restart_safety("the one at the cell")
    ready.take_control()
    ready.move_to_joints(HOME, 1.0)


def test_a_refusal_names_servo_and_register_and_keeps_the_connection(fake: FakeProcess, robot: TwoAxisRobot) -> None:
    fake.control.do("status_error", servo=1, error=6)
    with pytest.raises(Refused, match=r"servo 1 of arm at .* refuses .* register 38: the value is beyond"):
        robot.take_control()
    assert robot.control_owner() is None
    assert robot.connection is Connection.ONLINE
    robot.take_control()


def test_a_power_loss_of_a_servo_ends_control(fake: FakeProcess, ready: TwoAxisRobot, wait_for: WaitFor) -> None:
    fake.control.do("power_cycle")

    def refused() -> bool:
        try:
            ready.move_to_joints(HOME, 0.5)
        except DeviceError as e:
            return isinstance(e, NotInControl)
        return False

    wait_for(refused)
    assert all(servo["torque"] == 0 for servo in fake.truth()["servos"].values())


@pytest.mark.parametrize("request_", ["read", "write"])
def test_a_late_answer_is_not_used_for_another_request(fake: FakeProcess, request_: str) -> None:
    bus = Bus("arm", fake.ready["port"], 1_000_000)
    bus.open()
    errors: list[str] = []
    try:
        fake.control.do("slow", seconds=1.0)
        # The library discards data that arrive between two requests; then the ping is repeated.
        while len(errors) < 40 and not any("belongs to another instruction" in each for each in errors):
            if len(errors) % 8 == 0:
                fake.control.do("absent", servo=1, on=False)
                with pytest.raises(DeviceTimeout, match="servo 1"):
                    bus.ping(1)
                fake.control.do("absent", servo=1)
            # The next answer is the late one to the ping.
            with pytest.raises(DeviceTimeout, match="servo 1") as caught:
                bus.read(1, HOMING_OFFSET) if request_ == "read" else bus.write(1, TORQUE, 0)
            errors.append(str(caught.value))
    finally:
        bus.close()
    assert "belongs to another instruction" in errors[-1]


def test_a_missing_servo_is_reported_within_the_deadline(fake: FakeProcess) -> None:
    bus = Bus("arm", fake.ready["port"], 1_000_000)
    bus.open()
    try:
        assert len(bus.sync_read((1, 2), STATE)) == 2
        with pytest.raises(DeviceTimeout, match="servo 7 of arm"):
            bus.read(7, HOMING_OFFSET)
    finally:
        bus.close()
