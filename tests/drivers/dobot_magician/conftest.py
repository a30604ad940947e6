"""A fake arm in a separate process, and a driver connected to it."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.dobot_magician.dobot_magician import DobotMagician
from arcor2_drivers.dobot_magician.settings import DobotMagicianSettings
from arcor2_hw.data.geometry import Pose, Position
from tests.drivers.devices import disconnecting
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]

BASE = Pose(Position(0.4, -0.2, 0.138))


@pytest.fixture
def make() -> Iterator[Callable[..., DobotMagician]]:
    """Return ``make("/dev/pts/3", answer_timeout=0.2)``: an unconnected driver; the fixture disconnects it."""

    def build(port: str, **settings: Any) -> DobotMagician:
        return DobotMagician("arm_id", "arm", BASE, DobotMagicianSettings(port, **{"answer_timeout": 1.0, **settings}))

    with disconnecting(build) as make:
        yield make


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FakeProcess]:
    """Start one fake for all tests of a file, because starting one takes longer than most of them."""
    with FakeProcess(
        "dobot_magician", "--link", str(tmp_path_factory.mktemp("dev") / "ttyDOBOT"), "--pace", "12"
    ) as fake:
        yield fake


@pytest.fixture
def fake(running: FakeProcess) -> FakeProcess:
    """Reset the fake to its factory state, plugged in and without faults."""
    running.control.do("unplug")
    running.control.do("heal")
    running.control.do("plug")
    running.control.do("renew")
    return running


@pytest.fixture
def arm(fake: FakeProcess, make: Callable[..., DobotMagician]) -> DobotMagician:
    """Connect and take control."""
    arm = make(fake.ready["port"], suction_time=0.05, gripper_time=0.05, conveyor_port=0)
    arm.connect()
    arm.take_control()
    return arm
