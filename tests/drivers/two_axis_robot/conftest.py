"""Fake servos in a separate process, and a driver connected to them."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from arcor2_drivers.two_axis_robot.settings import TwoAxisRobotSettings
from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot
from arcor2_hw.data.geometry import Pose
from tests.drivers.background_call import BackgroundCall as BackgroundCall
from tests.drivers.devices import disconnecting
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]


def moving(fake: FakeProcess) -> None:
    """Wait until both joints really move."""
    fake.control.wait_until(lambda t: all(abs(servo["speed"]) > 0.1 for servo in t["servos"].values()))


def standing(truth: Any) -> bool:
    return all(abs(servo["velocity"]) <= 0.5 for servo in truth["servos"].values())  # a servo's resolution


@pytest.fixture
def make() -> Iterator[Callable[..., TwoAxisRobot]]:
    def build(port: str, pose: Pose | None = None, **settings: Any) -> TwoAxisRobot:
        wanted = TwoAxisRobotSettings(port, **settings)
        return TwoAxisRobot("arm_id", "arm", pose or Pose(), wanted)

    with disconnecting(build) as make:
        yield make


@pytest.fixture
def fake(start_fake: Callable[..., FakeProcess], tmp_path: Path) -> FakeProcess:
    return start_fake("two_axis_robot", "--link", str(tmp_path / "ttyDXL"))


@pytest.fixture
def robot(fake: FakeProcess, make: Callable[..., TwoAxisRobot]) -> TwoAxisRobot:
    """Connect without taking control."""
    robot = make(fake.ready["port"])
    robot.connect()
    return robot


@pytest.fixture
def ready(robot: TwoAxisRobot) -> TwoAxisRobot:
    """Connect and take control."""
    robot.take_control()
    return robot
