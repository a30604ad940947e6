"""A fake controller of its own per module, on an address of its own, and a driver on it per test."""

import contextlib
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

from arcor2_drivers.universal_robots.settings import UrSettings
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_fakes.control import BlockingControlClient
from arcor2_hw.data.geometry import Pose

HOME = [0.0, -1.5707963267948966, 1.5707963267948966, -1.5707963267948966, -1.5707963267948966, 0.0]
_numbers = itertools.count(1)


class FakeUr:
    """A running fake controller and its control channel."""

    def __init__(self, *arguments: str) -> None:
        self.host = f"127.{100 + os.getpid() % 100}.{os.getpid() // 100 % 250}.{next(_numbers)}"
        self.process = subprocess.Popen(
            [sys.executable, "-m", "arcor2_fakes.ur", "--host", self.host, "--control", "127.0.0.1:0", *arguments],
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

    def reset(self) -> None:
        self.do("heal")
        for command in ("safeguard_stop", "foreign_program", "fieldbus", "emergency_stop", "reduced", "recovery"):
            self.do(command, on=False)
        self.do("no_obstacle")
        self.do("remote_control", on=True)
        self.do("operational_mode", mode="AUTOMATIC")
        self.do("speed_slider", fraction=1.0)
        self.control.wait_until(lambda t: not t["moving"] and t["program"] is None)
        self.do("place", q=HOME)

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
    """An arm brisker than as delivered, so that tests need not wait for it, whose watchdog bears a busy computer."""
    brisk = {"max_joint_speed": 2.0, "joint_acceleration": 8.0, "tcp_acceleration": 4.0, "watchdog_frequency": 5.0}
    return UR5e(
        "obj_1", "ur", pose or Pose(), UrSettings(host, **{"payload_mass": 1.0, "tcp_z": 0.1, **brisk, **settings})
    )


@pytest.fixture
def robot(fake: FakeUr) -> Iterator[UR5e]:
    """Connected, control not taken."""
    robot = make(fake.host)
    robot.connect(3.0)
    yield robot
    robot.disconnect()


@pytest.fixture
def ready(robot: UR5e) -> UR5e:
    """Connected and controlled."""
    robot.take_control()
    return robot


class Doing:
    """A call on a thread of its own; `result` gives its result or raises its error."""

    def __init__(self, call: Callable[..., Any], *arguments: Any, **options: Any) -> None:
        self._value: Any = None
        self._error: BaseException | None = None
        self.ended_at = 0.0

        def run() -> None:
            try:
                self._value = call(*arguments, **options)
            except BaseException as e:
                self._error = e
            self.ended_at = time.monotonic()

        self._thread = threading.Thread(target=run, daemon=True)
        self._thread.start()

    def result(self, within: float = 10.0) -> Any:
        self._thread.join(within)
        assert not self._thread.is_alive(), f"still busy after {within} s"
        if self._error is not None:
            raise self._error
        return self._value


def moving(fake: FakeUr) -> None:
    """Return when the arm really moves."""
    wait(lambda: max(map(abs, fake.truth()["qd"])) > 0.05)


def wait(holds: Callable[[], bool], within: float = 5.0) -> None:
    until = time.monotonic() + within
    while not holds():
        assert time.monotonic() < until, f"not within {within} s"
        time.sleep(0.005)
