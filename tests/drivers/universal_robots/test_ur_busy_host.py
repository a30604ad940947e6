"""UR: a busy host does not stop the arm; a frozen or dead one does."""

import math
import os
import signal
import sys
import time
from collections.abc import Callable
from subprocess import Popen

import psutil
import pytest

from arcor2_drivers.universal_robots import timing
from arcor2_drivers.universal_robots.control_process import EXIT_TOO_SLOW, ControlProgram
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_hw.data.device import LossKind
from arcor2_hw.exceptions import Cancelled, ConnectionLost
from tests.drivers.stall import BUSY, stall
from tests.waiting import wait_for

from .conftest import BackgroundCall, FakeUr, moving

Owner = Callable[[], "Popen[bytes]"]
FROZEN = 1.3


def far_move(robot: UR5e, fake: FakeUr) -> BackgroundCall:
    """Start a move of 3 s."""
    joints = robot.robot_joints()
    joints[0].value += 3.0
    doing = BackgroundCall(robot.move_to_joints, joints, 0.5)
    moving(fake)
    return doing


def control_process(pid: int | None = None) -> psutil.Process:
    (found,) = [p for p in psutil.Process(pid).children() if "control_process" in " ".join(p.cmdline())]
    return found


def await_standstill(fake: FakeUr) -> None:
    fake.control.wait_until(lambda t: not t["moving"])


def test_a_stall_of_half_a_second_does_not_stop_a_move(
    ready: UR5e, fake: FakeUr, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        timing, "STOP_REACTION_TIMEOUT", 10.0
    )  # on a busy machine the dashboard would stop the arm first
    doing = far_move(ready, fake)
    trips = fake.truth()["watchdog_trips"]
    for _ in range(2):
        stall(BUSY)
        truth = fake.truth()
        assert (truth["moving"], truth["watchdog_trips"]) == (True, trips)
        time.sleep(0.2)
    ready.stop()
    with pytest.raises(Cancelled):
        doing.result()
    assert ready.control_owner() == "us"


def test_a_jog_expires_while_the_host_is_stalled(ready: UR5e, fake: FakeUr) -> None:
    trips, start = fake.truth()["watchdog_trips"], fake.truth()["q"][0]
    ready.jog(joint_velocities=[0.3, 0.0, 0.0, 0.0, 0.0, 0.0], valid_for=0.2)
    stall(BUSY)
    truth = fake.truth()
    assert not truth["moving"]
    assert 0.01 < truth["q"][0] - start < 0.3 * BUSY
    assert truth["watchdog_trips"] == trips
    assert ready.control_owner() == "us"


def test_a_frozen_host_ends_control_with_the_reason(ready: UR5e, fake: FakeUr) -> None:
    doing = far_move(ready, fake)
    stall(FROZEN)
    assert not fake.truth()["moving"]
    with pytest.raises(ConnectionLost, match="this computer was too slow for the robot's watchdog"):
        doing.result()


def test_a_starved_control_process_reports_the_reason(ready: UR5e, fake: FakeUr) -> None:
    doing = far_move(ready, fake)
    trips = fake.truth()["watchdog_trips"]
    process = control_process()
    process.send_signal(signal.SIGSTOP)
    fake.control.wait_until(lambda t: t["watchdog_trips"] > trips)
    process.send_signal(signal.SIGCONT)
    with pytest.raises(ConnectionLost, match="this computer was too slow for the robot's watchdog"):
        doing.result()


def control_program(frequency: float, **commands: Callable[[], bool]) -> ControlProgram:
    """Return a control program without a controller."""
    program = ControlProgram.__new__(ControlProgram)
    program._frequency, program._written, program._jog_ends = frequency, time.monotonic(), math.inf
    program._late = -math.inf
    program._commands = {"was_late": program._was_late, **commands}
    return program


def test_a_command_that_outlasts_the_watchdog_reports_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    """The watchdog stops the control program, and the library rejects the command without a reason."""
    program = control_program(10.0, setPayload=lambda: bool(time.sleep(0.2)))
    monkeypatch.setattr(os, "_exit", sys.exit)
    with pytest.raises(SystemExit) as exit_:
        program.do("setPayload", [])
    assert exit_.value.code == EXIT_TOO_SLOW


def test_only_a_command_that_reaches_the_control_program_signals_its_watchdog() -> None:
    program = control_program(0.01, setStandardDigitalOut=lambda: True, setTcp=lambda: False, setPayload=lambda: True)
    written = program._written
    program.do("setStandardDigitalOut", [])
    program.do("setTcp", [])  # denied: the library may have sent nothing
    assert program._written == written
    program.do("setPayload", [])
    assert program._written > written


def test_a_slow_command_may_have_tripped_the_watchdog() -> None:
    """The last signal before the command may have been sent long ago."""
    program = control_program(10.0, setPayload=lambda: time.sleep(0.1) is None)
    assert not program.do("was_late", [])
    program.do("setPayload", [])
    assert program._was_late()


def test_a_frozen_owner_stops_the_arm(owner: Owner, fake: FakeUr) -> None:
    assert UR5e.loss_reaction.kind is LossKind.STOPS_WITHIN
    process = owner()
    time.sleep(0.3)  # at full speed
    os.kill(process.pid, signal.SIGSTOP)
    frozen = time.monotonic()
    await_standstill(fake)
    assert time.monotonic() - frozen > BUSY


def test_the_end_of_its_owner_stops_the_arm_before_the_watchdog_does(owner: Owner, fake: FakeUr) -> None:
    process = owner()
    time.sleep(0.3)
    trips = fake.truth()["watchdog_trips"]
    child = control_process(process.pid)
    process.kill()
    await_standstill(fake)
    assert fake.truth()["watchdog_trips"] == trips
    wait_for(lambda: not child.is_running() or child.status() == psutil.STATUS_ZOMBIE)
    fake.control.wait_until(lambda t: t["program"] is None)


def test_the_controllers_watchdog_stops_the_arm_when_the_computer_dies(owner: Owner, fake: FakeUr) -> None:
    process = owner()
    time.sleep(0.3)
    trips = fake.truth()["watchdog_trips"]
    child = control_process(process.pid)
    os.kill(process.pid, signal.SIGSTOP)
    child.kill()
    await_standstill(fake)
    assert fake.truth()["watchdog_trips"] == trips + 1


def test_a_door_opened_and_closed_during_a_stall_ends_the_program(owner: Owner, fake: FakeUr) -> None:
    process = owner()
    time.sleep(0.3)
    os.kill(process.pid, signal.SIGSTOP)
    fake.do("safeguard_stop")
    time.sleep(0.1)
    fake.do("safeguard_stop", on=False)
    os.kill(process.pid, signal.SIGCONT)
    fake.control.wait_until(lambda t: not t["moving"] and t["program"] is None)
    assert process.wait(20.0) != 0
