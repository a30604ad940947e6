"""Faults of the Magician: wire faults, a killed owner, and other clients."""

import os
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import serial

from arcor2_drivers.dobot_magician.dobot_magician import DobotMagician
from arcor2_drivers.dobot_magician.frames import encode
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceTimeout, NotConnected, NotInControl, Refused
from tests.drivers.background_call import BackgroundCall
from tests.drivers.dobot_magician.test_dm_working import joints
from tests.drivers.stall import BUSY, stall
from tests.fakes.conftest import FakeProcess


def ptp(x: float, mode: int = 4) -> bytes:
    return encode(84, 3, struct.pack("<B4f", mode, x, 45.0, 45.0, 0.0))


def write(port: str, *frames: bytes) -> None:
    """Send frames like a foreign program, and close the port."""
    with serial.Serial(port, 115200, timeout=1.0) as line:
        for frame in frames:
            line.write(frame)
            assert line.read(14 if frame[4] == 3 else 6)


def test_a_stall_of_half_a_second_keeps_the_connection(fake: FakeProcess, arm: DobotMagician) -> None:
    for _ in range(3):
        stall(BUSY)
        assert arm.connection is Connection.ONLINE
        arm.robot_joints()
    assert arm.control_owner() == "us"


def test_a_missing_port_or_one_in_use(fake: FakeProcess, make: Callable[..., DobotMagician]) -> None:
    absent = make("/dev/no-such-port")
    with pytest.raises(NotConnected, match=r"^arm at /dev/no-such-port: the port cannot be opened$"):
        absent.connect()
    assert absent.connection is Connection.FAILED
    with serial.Serial(fake.ready["port"], exclusive=True):
        other = make(fake.ready["port"])
        with pytest.raises(NotConnected, match=r"is used by another program$"):
            other.connect()
    other.connect()


@pytest.mark.parametrize("fault", ["silence", "garbage"])
def test_invalid_answers_are_errors(fake: FakeProcess, make: Callable[..., DobotMagician], fault: str) -> None:
    fake.control.do(fault)
    arm = make(fake.ready["port"])
    with pytest.raises(DeviceTimeout, match=r"^arm at .*ttyDOBOT did not answer within 1 s\.$"):
        arm.connect(2.0)
    fake.control.do("heal")
    arm.connect()


@pytest.mark.parametrize("fault", ["silence", "garbage", "half_frame", "wrong_checksum"])
def test_a_wire_fault_is_a_loss_and_recovers(
    fake: FakeProcess, arm: DobotMagician, wait_for: Callable[..., Any], fault: str
) -> None:
    fake.control.do(fault)
    wait_for(lambda: arm.connection, lambda state: state in (Connection.LOST, Connection.BACK))
    if fault != "wrong_checksum":
        with pytest.raises(ConnectionLost, match=r"[Tt]he connection to arm at .*ttyDOBOT is lost"):
            arm.get_end_effector_pose("tcp")
        with pytest.raises(ConnectionLost):
            arm.move_to_joints(joints(0, 45, 45, 0), 1.0)
        assert arm.health is Health.FAILURE
    fake.control.do("heal")
    wait_for(lambda: arm.connection, lambda state: state is Connection.BACK)
    wait_for(lambda: arm.health, lambda health: health is Health.NORMAL)
    with pytest.raises(NotInControl):  # only observation is restored
        arm.move_to_joints(joints(0, 45, 45, 0), 1.0)
    arm.take_control()
    assert arm.connection is Connection.ONLINE
    arm.move_to_joints(joints(20, 45, 45, 0), 1.0)
    assert fake.truth()["motions"] == 1


def test_late_answers_are_not_used(
    start_fake: Callable[..., FakeProcess], make: Callable[..., DobotMagician], wait_for: Callable[..., Any]
) -> None:
    fake = start_fake("dobot_magician")
    arm = make(fake.ready["port"], answer_timeout=0.15)
    arm.connect()
    fake.control.do("slow", seconds=0.8)  # a busy machine extends the driver's time limit
    wait_for(lambda: arm.connection, lambda state: state is Connection.LOST)
    deadline = time.monotonic() + 1.2  # meanwhile answers to earlier requests keep arriving
    while time.monotonic() < deadline:
        assert arm.connection is Connection.LOST
        time.sleep(0.01)
    fake.control.do("heal")
    wait_for(lambda: arm.connection, lambda state: state is Connection.BACK)
    assert arm.identify().serial == "DT1022049091"


def test_unplugging_and_plugging_during_a_move(
    fake: FakeProcess, arm: DobotMagician, wait_for: Callable[..., Any]
) -> None:
    doing = BackgroundCall(lambda: arm.move_to_joints(joints(60, 45, 45, 0), 0.06))
    fake.control.wait_until(lambda truth: truth["moving"])
    fake.control.do("unplug")
    outcome = doing.outcome()
    assert isinstance(outcome, ConnectionLost), outcome
    assert "a joint move" in str(outcome)
    assert "arm at" in str(outcome)
    with pytest.raises(ConnectionLost):
        arm.stop()  # the stop cannot be sent, and the driver logs it
    fake.control.do("plug")
    wait_for(lambda: arm.connection, lambda state: state is Connection.BACK)
    fake.control.wait_until(lambda truth: not truth["moving"])
    truth = fake.truth()
    assert truth["joints"][0] == pytest.approx(60.0, abs=0.01)  # it continues, as declared
    assert truth["motions"] == 1
    with pytest.raises(NotInControl):
        arm.home()


def test_stop_after_a_reconnect_stops_a_motion_left_running(
    fake: FakeProcess, arm: DobotMagician, wait_for: Callable[..., Any]
) -> None:
    arm.conveyor(0.05)
    doing = BackgroundCall(lambda: arm.move_to_joints(joints(60, 45, 45, 0), 0.02))
    fake.control.wait_until(lambda truth: truth["moving"])
    fake.control.do("reset")
    assert isinstance(doing.outcome(), ConnectionLost)
    wait_for(lambda: arm.connection, lambda state: state is Connection.BACK)
    assert fake.truth()["moving"] is True
    arm.stop()
    truth = fake.truth()
    assert (truth["moving"], truth["steppers"]["0"]) == (False, [False, 0])
    assert arm.control_owner() is None


def test_control_is_refused_while_another_client_moves_the_arm(
    fake: FakeProcess, make: Callable[..., DobotMagician]
) -> None:
    ratio = encode(83, 1, struct.pack("<2f", 1.0, 50.0))
    write(fake.ready["port"], ratio, ptp(30.0), encode(240, 1))
    fake.control.wait_until(lambda truth: truth["moving"])
    arm = make(fake.ready["port"])
    arm.connect()
    with pytest.raises(NotInControl, match="is being moved by another client"):
        arm.take_control()
    assert arm.control_owner() == "another client"
    with pytest.raises(NotInControl):
        arm.stop()
    arm.disconnect()
    assert fake.truth()["moving"] is True
    arm.connect()
    fake.control.wait_until(lambda truth: not truth["moving"])
    assert fake.truth()["joints"][0] == pytest.approx(30.0, abs=0.01)
    arm.take_control()
    assert arm.control_owner() == "us"


def test_commands_left_in_a_stopped_queue_never_run(fake: FakeProcess, make: Callable[..., DobotMagician]) -> None:
    write(fake.ready["port"], ptp(30.0), ptp(-30.0))
    fake.control.wait_until(lambda truth: truth["queued"] == 2)
    arm = make(fake.ready["port"])
    arm.connect()
    assert fake.truth()["queued"] == 2
    arm.take_control()
    arm.move_to_joints(joints(10, 45, 45, 0), 1.0)
    truth = fake.truth()
    assert truth["motions"] == 1
    assert truth["joints"][0] == pytest.approx(10.0, abs=0.01)


def test_homing_after_a_power_cycle(fake: FakeProcess, arm: DobotMagician, wait_for: Callable[..., Any]) -> None:
    doing = BackgroundCall(lambda: arm.move_to_joints(joints(60, 45, 45, 0), 0.06))
    fake.control.wait_until(lambda truth: truth["moving"])
    fake.control.do("power_cycle")
    assert isinstance(doing.outcome(), DeviceError)
    wait_for(lambda: arm.connection, lambda state: state is Connection.BACK)
    assert [alarm.code for alarm in arm.alarms()] == ["00h"]
    with pytest.raises(NotInControl):
        arm.move_to_joints(joints(0, 45, 45, 0), 1.0)
    assert fake.truth()["moving"] is False
    arm.acknowledge("00h")
    arm.take_control()
    began = time.monotonic()
    arm.home()
    assert time.monotonic() - began > 0.6
    truth = fake.truth()
    assert truth["homed"] is True
    assert truth["tool"][:2] == pytest.approx([259.1, 0.0], abs=0.1)


def test_a_motion_whose_answer_is_lost_never_runs(
    fake: FakeProcess, arm: DobotMagician, wait_for: Callable[..., Any]
) -> None:
    fake.control.do("mute", number=84)
    with pytest.raises(DeviceTimeout, match=r"^arm at .* did not answer within 1 s\.$") as raised:
        arm.move_to_joints(joints(40, 45, 45, 0), 1.0)
    assert "id 84" in raised.value.detail
    wait_for(lambda: arm.connection, lambda state: state is Connection.BACK)
    fake.control.do("mute", number=84, on=False)
    arm.take_control()  # the motion whose answer was lost waits in the queue, and is dropped
    arm.move_to_joints(joints(10, 45, 45, 0), 1.0)
    truth = fake.truth()
    assert truth["motions"] == 1
    assert truth["joints"][0] == pytest.approx(10.0, abs=0.01)


OWNER = """
import sys
from arcor2_drivers.dobot_magician.dobot_magician import DobotMagician
from arcor2_drivers.dobot_magician.settings import DobotMagicianSettings
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
import math
arm = DobotMagician("a", "arm", Pose(), DobotMagicianSettings(sys.argv[1]))
arm.connect()
arm.take_control()
for angle in (60, -60, 60):
    arm.move_to_joints([Joint(f"joint_{i + 1}", math.radians(v)) for i, v in enumerate((angle, 45, 45, 0))], 0.06)
"""


def test_a_killed_owner_leaves_only_the_present_motion(fake: FakeProcess, tmp_path: Path) -> None:
    script = tmp_path / "owner.py"
    script.write_text(OWNER)
    owner = subprocess.Popen([sys.executable, str(script), fake.ready["port"]], env=dict(os.environ))
    try:
        fake.control.wait_until(lambda truth: truth["moving"])
    finally:
        owner.kill()
        owner.wait()
    fake.control.wait_until(lambda truth: not truth["moving"])
    truth = fake.truth()
    assert truth["joints"][0] == pytest.approx(60.0, abs=0.01)
    assert (truth["motions"], truth["queued"], truth["longest_queue"]) == (1, 0, 1)


def test_disconnecting_stops_the_arm(fake: FakeProcess, arm: DobotMagician) -> None:
    doing = BackgroundCall(lambda: arm.move_to_joints(joints(60, 45, 45, 0), 0.06))
    fake.control.wait_until(lambda truth: truth["moving"])
    arm.disconnect()
    assert isinstance(doing.outcome(), DeviceError)
    truth = fake.truth()
    assert truth["moving"] is False
    assert truth["joints"][0] < 60.0


def test_a_stop_during_a_pick_drops_its_other_motions(fake: FakeProcess, arm: DobotMagician) -> None:
    for _ in range(3):
        arm.stop()
    arm.move_to_joints(joints(0, 45, 45, 0), 1.0)
    guard = arm._control.stops.guard()
    arm.stop()
    with pytest.raises((DeviceError, Refused), match="was stopped"):
        arm._motion.to_joints((0.1, 0.7, 0.7, 0.0), 1.0, guard)
    assert fake.truth()["queued"] == 0
