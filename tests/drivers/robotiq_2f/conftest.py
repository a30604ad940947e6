"""A fake gripper in a separate process, and a driver connected to it."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.robotiq_2f.robotiq_2f import Robotiq2F
from arcor2_drivers.robotiq_2f.settings import Robotiq2FSettings
from tests.drivers.devices import disconnecting
from tests.fakes.conftest import FakeProcess, wait_for

__all__ = ["wait_for"]

PACE = 6.0


@pytest.fixture(scope="module")
def running() -> Iterator[FakeProcess]:
    with FakeProcess("robotiq_2f", "--time-scale", str(PACE)) as fake:
        yield fake


@pytest.fixture
def fake(running: FakeProcess) -> FakeProcess:
    """Reset the fake as if it was just switched on."""
    running.control.do("heal")
    running.control.do("remove_part")
    running.control.do("block", on=False)
    running.control.do("power_cycle")
    running.control.do("pace", factor=PACE)
    return running


@pytest.fixture
def make() -> Iterator[Callable[..., Robotiq2F]]:
    """Return ``make("127.0.0.1:4000", request_timeout=0.2)``: an unconnected driver; the fixture disconnects it."""

    def build(address: str, **settings: Any) -> Robotiq2F:
        host, _, port = address.rpartition(":")
        return Robotiq2F("gripper_id", "gripper", Robotiq2FSettings(host=host, port=int(port), **settings))

    with disconnecting(build) as make:
        yield make


@pytest.fixture
def observed(fake: FakeProcess, make: Callable[..., Robotiq2F]) -> Robotiq2F:
    gripper = make(fake.ready["ascii"])
    gripper.connect()
    return gripper


@pytest.fixture
def gripper(fake: FakeProcess, observed: Robotiq2F) -> Robotiq2F:
    """Take control and activate."""
    make_ready(fake, observed)
    return observed


def make_ready(fake: FakeProcess, gripper: Robotiq2F) -> None:
    """Take control and activate, faster than the motions of the tests."""
    fake.control.do("pace", factor=100.0)
    gripper.take_control()
    gripper.activate()
    fake.control.do("pace", factor=PACE)
