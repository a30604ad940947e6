"""A fake controller per module, on its own address, and a driver per test."""

import contextlib
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.universal_robots.settings import UrSettings
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_hw.data.geometry import Pose
from arcor2_hw.testing.addresses import own_loopback
from tests.drivers.background_call import BackgroundCall as BackgroundCall
from tests.fakes.conftest import FakeProcess
from tests.waiting import wait_for

HOME = [0.0, -1.5707963267948966, 1.5707963267948966, -1.5707963267948966, -1.5707963267948966, 0.0]


class FakeUr(FakeProcess):
    """A running fake controller and its control channel."""

    def __init__(self, *arguments: str) -> None:
        self.host = own_loopback()
        super().__init__("ur", "--host", self.host, "--control", "127.0.0.1:0", *arguments)
        self.truth()  # opens the control channel

    def do(self, command: str, **arguments: Any) -> Any:
        return self.control.do(command, **arguments)

    def reset(self) -> None:
        self.do("heal")
        if self.truth()["safety"] in ("VIOLATION", "FAULT"):
            self.do("restart_safety")
        self.do("contact", on=False)
        for command in ("safeguard_stop", "foreign_program", "fieldbus", "emergency_stop", "reduced", "recovery"):
            self.do(command, on=False)
        self.do("no_obstacle")
        self.do("remote_control", on=True)
        self.do("operational_mode", mode="AUTOMATIC")
        self.do("speed_slider", fraction=1.0)
        self.control.wait_until(lambda t: not t["moving"] and t["program"] is None)
        self.do("place", q=HOME)


@pytest.fixture(scope="module")
def module_fake() -> Iterator[FakeUr]:
    fake = FakeUr("--time-scale", "0.1")
    yield fake
    fake.end()


@pytest.fixture
def fake(module_fake: FakeUr) -> FakeUr:
    module_fake.reset()
    return module_fake


@pytest.fixture
def start_fake() -> Iterator[Callable[..., FakeUr]]:
    with contextlib.ExitStack() as stack:

        def start(*arguments: str) -> FakeUr:
            fake = FakeUr(*arguments)
            stack.callback(fake.end)
            return fake

        yield start


def make(host: str, pose: Pose | None = None, **settings: Any) -> UR5e:
    """Return an arm with shorter times than in its factory state, so that tests are fast."""
    brisk = {"max_joint_speed": 2.0, "joint_acceleration": 8.0, "tcp_acceleration": 4.0}
    return UR5e(
        "obj_1", "ur", pose or Pose(), UrSettings(host, **{"payload_mass": 1.0, "tcp_z": 0.1, **brisk, **settings})
    )


@pytest.fixture
def robot(fake: FakeUr) -> Iterator[UR5e]:
    """Connect without taking control."""
    robot = make(fake.host)
    robot.connect(30.0)
    yield robot
    robot.disconnect()


@pytest.fixture
def ready(robot: UR5e) -> UR5e:
    """Connect and take control."""
    robot.take_control()
    return robot


def moving(fake: FakeUr) -> None:
    """Wait until the arm really moves."""
    wait_for(lambda: max(map(abs, fake.truth()["qd"])) > 0.05)


@pytest.fixture
def owner(fake: FakeUr) -> Iterator[Callable[[], "subprocess.Popen[bytes]"]]:
    """Return ``owner()``, which starts another process and returns it once the arm is in a long move."""
    started: list[subprocess.Popen[bytes]] = []
    code = textwrap.dedent(
        f"""
        from arcor2_drivers.universal_robots.settings import UrSettings
        from arcor2_drivers.universal_robots.ur5e import UR5e
        from arcor2_hw.data.geometry import Pose
        robot = UR5e("obj_1", "ur", Pose(), UrSettings({fake.host!r}, payload_mass=1.0))
        robot.connect(30.0)
        robot.take_control()
        joints = robot.robot_joints()
        joints[0].value += 3.0
        robot.move_to_joints(joints, 1.0)
        """
    )

    def start() -> "subprocess.Popen[bytes]":
        started.append(subprocess.Popen([sys.executable, "-c", code]))
        moving(fake)
        return started[-1]

    yield start
    for process in started:
        if process.poll() is None:
            process.kill()
        process.wait()
