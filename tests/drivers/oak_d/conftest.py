"""One fake camera for these modules, reset for every test, and the driver on its stream."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.oak_d.oak_d import OakD
from arcor2_drivers.oak_d.settings import OakDSettings
from arcor2_hw.data.geometry import Orientation, Pose, Position
from tests.drivers.devices import disconnecting
from tests.fakes.conftest import FakeProcess

ABOVE = {"position": [0.0, 0.0, 0.8], "orientation": [1.0, 0.0, 0.0, 0.0]}
BOARD = {"name": "board", "pose": {"position": [0.1, 0.05, 0.03]}, "size": [0.08, 0.05, 0.06], "color": [200, 30, 30]}
PATIENCE = 40.0
"""Time limit for the first picture, s: the fake loads Open3D on a busy machine."""


@pytest.fixture(scope="module")
def running() -> Iterator[FakeProcess]:
    with FakeProcess("oak_d", "--width", "640", "--height", "360", "--boot-time", "0.5") as fake:
        yield fake


@pytest.fixture
def fake(running: FakeProcess) -> FakeProcess:
    running.control.do("heal")
    running.control.do("power_cycle", seconds=0.0)
    running.control.do("camera", pose=ABOVE)
    running.control.do("scene", things=[BOARD])
    return running


@pytest.fixture
def make() -> Iterator[Callable[..., OakD]]:
    def build(address: str, **settings: Any) -> OakD:
        pose = Pose(Position(0.0, 0.0, 0.8), Orientation(1.0, 0.0, 0.0, 0.0))
        return OakD("camera_id", "camera", pose, None, OakDSettings(address, **settings))

    with disconnecting(build) as make:
        yield make


@pytest.fixture
def camera(fake: FakeProcess, make: Callable[..., OakD]) -> OakD:
    camera = make(fake.ready["stream"], frame_timeout=1.5)
    camera.connect(PATIENCE)
    return camera
