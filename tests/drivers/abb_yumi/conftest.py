"""A fake controller of its own per module, on an address of its own, and a driver on it per test."""

import itertools
import os
import select
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import pytest

from arcor2_drivers.abb_yumi.settings import YumiSettings
from arcor2_drivers.abb_yumi.yumi import YuMi
from arcor2_fakes.control import BlockingControlClient
from arcor2_hw.data.geometry import Pose

RWS_PORT = 8080
_numbers = itertools.count(1)


class FakeYumi:
    """A running fake controller and its control channel."""

    def __init__(self, *arguments: str) -> None:
        self.host = f"127.{20 + os.getpid() % 60}.{os.getpid() // 60 % 250}.{next(_numbers)}"
        self.process = subprocess.Popen(
            [sys.executable, "-m", "arcor2_fakes.abb_yumi", "--host", self.host, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        assert self.process.stdout is not None
        assert select.select([self.process.stdout], [], [], 60.0)[0]
        line = self.process.stdout.readline()
        assert line.startswith(b"ready "), line
        self.control = BlockingControlClient(msgspec.json.decode(line.removeprefix(b"ready "))["control"])

    def do(self, command: str, **arguments: Any) -> Any:
        return self.control.do(command, **arguments)

    def truth(self) -> dict[str, Any]:
        found: dict[str, Any] = self.do("truth")
        return found

    def arm(self, arm: str) -> dict[str, Any]:
        found: dict[str, Any] = self.truth()["arms"][arm]
        return found

    def moving(self, *arms: str) -> bool:
        truth = self.truth()["arms"]
        return any(truth[arm]["moving"] for arm in arms or ("left", "right"))

    def reset(self) -> None:
        self.do("heal")
        self.do("renew")

    def end(self) -> None:
        self.control.close()
        self.process.terminate()
        try:
            self.process.wait(5.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()


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
    return YuMi("obj_1", "yumi", pose or Pose(), settings(host, **changed))


@pytest.fixture
def robot(fake: FakeYumi) -> Iterator[YuMi]:
    """Connected, control not taken."""
    robot = make(fake.host)
    robot.connect(3.0)
    yield robot
    robot.disconnect()


@pytest.fixture
def ready(robot: YuMi) -> YuMi:
    """Connected and controlled."""
    robot.take_control()
    return robot


class Doing:
    """A call on a thread of its own; `result` gives its result or raises its error."""

    def __init__(self, call: Callable[..., Any], *arguments: Any, **options: Any) -> None:
        self._value: Any = None
        self._error: BaseException | None = None

        def run() -> None:
            try:
                self._value = call(*arguments, **options)
            except BaseException as e:
                self._error = e

        self._thread = threading.Thread(target=run, daemon=True)
        self._thread.start()

    def result(self, within: float = 10.0) -> Any:
        self._thread.join(within)
        assert not self._thread.is_alive(), f"still busy after {within} s"
        if self._error is not None:
            raise self._error
        return self._value


def under_way(fake: FakeYumi, *arms: str) -> None:
    """Return when the arms really move."""
    fake.control.wait_until(lambda t: all(t["arms"][arm]["speed"] > 0.05 for arm in arms))


def wait(holds: Callable[[], bool], within: float = 5.0) -> None:
    until = time.monotonic() + within
    while not holds():
        assert time.monotonic() < until, f"not within {within} s"
        time.sleep(0.005)
