"""A fake arm in a process of its own, and the driver on its line."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from arcor2_drivers.dobot_magician.dobot_magician import DobotMagician
from arcor2_drivers.dobot_magician.settings import DobotMagicianSettings
from arcor2_hw.data.geometry import Pose, Position
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]

BASE = Pose(Position(0.4, -0.2, 0.138))


@pytest.fixture
def make() -> Iterator[Callable[..., DobotMagician]]:
    """Gives ``make("/dev/pts/3", answer_timeout=0.2)``: a driver, not connected; it is disconnected in the end."""
    made: list[DobotMagician] = []

    def build(port: str, **settings: Any) -> DobotMagician:
        arm = DobotMagician("arm_id", "arm", BASE, DobotMagicianSettings(port, **settings))
        made.append(arm)
        return arm

    yield build
    for arm in made:
        arm.disconnect()


@pytest.fixture
def fake(start_fake: Callable[..., FakeProcess], tmp_path: Path) -> FakeProcess:
    return start_fake("dobot_magician", "--link", str(tmp_path / "ttyDOBOT"), "--pace", "6")


@pytest.fixture
def arm(fake: FakeProcess, make: Callable[..., DobotMagician]) -> DobotMagician:
    """Connected and in control."""
    arm = make(fake.ready["port"], suction_time=0.05, gripper_time=0.05, conveyor_port=0)
    arm.connect()
    arm.take_control()
    return arm
