"""Two-axis robot: a busy host does not stop the servos; a frozen or dead one does."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Cancelled, NotInControl
from tests.drivers.stall import BUSY, stall
from tests.fakes.conftest import FakeProcess

from .conftest import BackgroundCall, moving, standing
from .test_two_axis_faults import FAR, KILLED


@pytest.fixture
def owner(fake: FakeProcess) -> Iterator["subprocess.Popen[bytes]"]:
    """Start another process that moves the arm over a long distance."""
    command = [sys.executable, "-c", KILLED, fake.ready["port"]]
    with subprocess.Popen(command, cwd=Path(__file__).parents[3]) as process:
        fake.control.wait_until(lambda t: t["servos"]["1"]["speed"] > 0.5)
        yield process
        process.kill()


def trips(fake: FakeProcess) -> int:
    return sum(servo["watchdog"] == 0xFF for servo in fake.truth()["servos"].values())


def test_a_stall_of_half_a_second_does_not_stop_a_move(fake: FakeProcess, ready: TwoAxisRobot) -> None:
    doing = BackgroundCall(ready.move_to_joints, FAR, 0.15)
    moving(fake)
    for _ in range(2):
        stall(BUSY)
        assert trips(fake) == 0
        assert not standing(fake.truth())
        time.sleep(0.1)
    ready.stop()
    with pytest.raises(Cancelled):
        doing.result()
    assert ready.control_owner() == "us"
    ready.move_to_joints([Joint("joint_1", 0.0), Joint("joint_2", 0.0)], 1.0)


def test_a_frozen_owner_stops_the_servos(fake: FakeProcess, owner: "subprocess.Popen[bytes]") -> None:
    os.kill(owner.pid, signal.SIGSTOP)
    frozen = time.monotonic()
    fake.control.wait_until(standing)
    assert time.monotonic() - frozen > BUSY
    assert trips(fake) == 2


def test_a_killed_process_stops_the_servos(fake: FakeProcess, owner: "subprocess.Popen[bytes]") -> None:
    owner.kill()
    fake.control.wait_until(standing)
    assert trips(fake) == 2


def test_a_tripped_watchdog_is_named(fake: FakeProcess, ready: TwoAxisRobot) -> None:
    keep_alive = ready._observer._keep_alive
    assert keep_alive is not None
    doing = BackgroundCall(ready.move_to_joints, FAR, 0.15)
    moving(fake)
    os.kill(keep_alive.pid, signal.SIGKILL)  # as if this computer had not scheduled it
    stall(0.7)
    assert trips(fake) == 2
    with pytest.raises(NotInControl, match="this computer was too slow for the robot's watchdog"):
        doing.result()


def test_releasing_control_ends_the_child_process(ready: TwoAxisRobot, wait_for: Callable[..., object]) -> None:
    keep_alive = ready._observer._keep_alive
    assert keep_alive is not None
    ready.release_control()
    wait_for(lambda: not Path(f"/proc/{keep_alive.pid}").exists())
