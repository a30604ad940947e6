"""A fake controller per module, on its own address, and a driver per test."""

from collections.abc import Iterator
from typing import Any

import pytest

from arcor2_drivers.abb_yumi.settings import YumiSettings
from arcor2_drivers.abb_yumi.yumi import YuMi
from arcor2_hw.data.geometry import Pose
from arcor2_hw.testing.addresses import own_loopback
from tests.drivers.background_call import BackgroundCall as BackgroundCall
from tests.fakes.conftest import FakeProcess

RWS_PORT = 8080


class FakeYumi(FakeProcess):
    """A running fake controller and its control channel."""

    def __init__(self, *arguments: str) -> None:
        self.host = own_loopback()
        super().__init__("abb_yumi", "--host", self.host, *arguments)
        self.truth()  # opens the control channel

    def do(self, command: str, **arguments: Any) -> Any:
        return self.control.do(command, **arguments)

    def arm(self, arm: str) -> dict[str, Any]:
        found: dict[str, Any] = self.truth()["arms"][arm]
        return found

    def moving(self, *arms: str) -> bool:
        truth = self.truth()["arms"]
        return any(truth[arm]["moving"] for arm in arms or ("left", "right"))

    def reset(self) -> None:
        self.do("heal")
        self.do("renew")


@pytest.fixture(scope="module")
def module_fake() -> Iterator[FakeYumi]:
    fake = FakeYumi("--time-scale", "2")
    yield fake
    fake.end()


@pytest.fixture
def fake(module_fake: FakeYumi) -> FakeYumi:
    module_fake.reset()
    return module_fake


def settings(host: str, **changed: Any) -> YumiSettings:
    usual = {"rws_port": RWS_PORT, "left_mass": 0.23, "right_mass": 0.23, "left_tcp_z": 0.136, "right_tcp_z": 0.136}
    return YumiSettings(host, **{**usual, **changed})


def make(host: str, pose: Pose | None = None, **changed: Any) -> YuMi:
    robot = YuMi("obj_1", "yumi", pose or Pose(), settings(host, **changed))
    robot._observer.fresh_for = 2.0  # about ten requests, each of which a busy machine delays
    return robot


@pytest.fixture
def robot(fake: FakeYumi) -> Iterator[YuMi]:
    """Connect without taking control."""
    robot = make(fake.host)
    robot.connect(30.0)
    yield robot
    robot.disconnect()


@pytest.fixture
def ready(robot: YuMi) -> YuMi:
    """Connect and take control."""
    robot.take_control()
    return robot


def under_way(fake: FakeYumi, *arms: str) -> None:
    """Wait until the arms really move."""
    fake.control.wait_until(lambda t: all(t["arms"][arm]["speed"] > 0.05 for arm in arms))
