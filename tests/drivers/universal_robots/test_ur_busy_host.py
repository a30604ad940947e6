"""UR: a busy host does not stop the arm; a frozen or dead one does."""

import os
import signal
import time
from collections.abc import Callable
from subprocess import Popen

import psutil
import pytest

from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_hw.data.device import LossKind
from arcor2_hw.exceptions import Cancelled, ConnectionLost
from arcor2_hw.testing.own_time import own_time
from tests.drivers.stall import BUSY, stall

from .conftest import BackgroundCall, FakeUr, moving, wait

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


def stopped_within(fake: FakeUr, limit: float) -> None:
    began = own_time()
    fake.control.wait_until(lambda t: not t["moving"])
    assert own_time() - began < limit


def test_a_stall_of_half_a_second_does_not_stop_a_move(ready: UR5e, fake: FakeUr) -> None:
    doing = far_move(ready, fake)
    trips = fake.truth()["watchdog_trips"]
    for _ in range(2):
        stall(BUSY)
        truth = fake.truth()
        assert (truth["moving"], truth["watchdog_trips"]) == (True, trips)
        time.sleep(0.2)
    ready.stop()
    with pytest.raises(Cancelled):
        doing.result(1.0)
    assert ready.control_owner() == "us"


def test_a_jog_expires_while_the_host_is_stalled(ready: UR5e, fake: FakeUr) -> None:
    trips, start = fake.truth()["watchdog_trips"], fake.truth()["q"][0]
    ready.jog(joint_velocities=[0.3, 0.0, 0.0, 0.0, 0.0, 0.0], valid_for=0.2)
    stall(0.7)
    truth = fake.truth()
    assert not truth["moving"]
    assert 0.01 < truth["q"][0] - start < 0.3 * 0.45
    assert truth["watchdog_trips"] == trips
    assert ready.control_owner() == "us"


def test_a_frozen_host_ends_control_with_the_reason(ready: UR5e, fake: FakeUr) -> None:
    doing = far_move(ready, fake)
    stall(FROZEN)
    assert not fake.truth()["moving"]
    with pytest.raises(ConnectionLost, match="this computer was too slow for the robot's watchdog"):
        doing.result(1.0)


def test_a_starved_control_process_reports_the_reason(ready: UR5e, fake: FakeUr) -> None:
    doing = far_move(ready, fake)
    trips = fake.truth()["watchdog_trips"]
    process = control_process()
    process.send_signal(signal.SIGSTOP)
    fake.control.wait_until(lambda t: t["watchdog_trips"] > trips)
    process.send_signal(signal.SIGCONT)
    with pytest.raises(ConnectionLost, match="this computer was too slow for the robot's watchdog"):
        doing.result(1.0)


def test_a_frozen_owner_stops_the_arm_within_the_declared_time(owner: Owner, fake: FakeUr) -> None:
    assert UR5e.loss_reaction.kind is LossKind.STOPS_WITHIN
    process = owner()
    time.sleep(0.3)  # at full speed
    began = own_time()
    os.kill(process.pid, signal.SIGSTOP)
    time.sleep(BUSY)
    assert fake.truth()["moving"]
    stopped_within(fake, UR5e.loss_reaction.within - (own_time() - began))


def test_a_killed_process_stops_the_arm_at_once(owner: Owner, fake: FakeUr) -> None:
    process = owner()
    time.sleep(0.3)
    child = control_process(process.pid)
    process.kill()
    stopped_within(fake, 0.5)
    wait(lambda: not child.is_running() or child.status() == psutil.STATUS_ZOMBIE)
    fake.control.wait_until(lambda t: t["program"] is None)


def test_the_controllers_watchdog_stops_the_arm_when_the_computer_dies(owner: Owner, fake: FakeUr) -> None:
    process = owner()
    time.sleep(0.3)
    trips = fake.truth()["watchdog_trips"]
    child = control_process(process.pid)
    os.kill(process.pid, signal.SIGSTOP)
    child.kill()
    stopped_within(fake, 1.0)
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
