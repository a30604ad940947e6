"""A vacuum gripper on a fake I/O block, and on the outputs of a fake UR."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.remote_io.settings import RemoteIOSettings
from arcor2_drivers.vacuum_gripper.settings import VacuumGripperSettings
from arcor2_drivers.vacuum_gripper.suction_gripper import SuctionGripper
from arcor2_hw.exceptions import NotFound
from arcor2_hw.objects import Generic
from tests.drivers.devices import disconnecting
from tests.fakes.conftest import FakeProcess

POINTS = "part=DI0; vacuum=DO0 on_loss=hold; blow=DO1; falls=DO2; pressure=AI0 unit=Pa"


@pytest.fixture(scope="module")
def one_fake() -> Iterator[FakeProcess]:
    with FakeProcess("remote_io") as fake:
        yield fake


@pytest.fixture
def fake(one_fake: FakeProcess) -> FakeProcess:
    one_fake.control.do("renew")
    return one_fake


@pytest.fixture
def block(fake: FakeProcess) -> Iterator[RemoteIO]:
    """Return the connected carrier."""
    host, _, port = fake.ready["modbus"].rpartition(":")
    made = RemoteIO("block_id", "block", RemoteIOSettings(host=host, port=int(port), points=POINTS))
    made.connect()
    yield made
    made.disconnect()


Make = Callable[..., SuctionGripper]


@pytest.fixture
def make(block: RemoteIO) -> Iterator[Make]:
    """Return ``make(grip_time=1.0)``: an unconnected gripper on the block; the fixture disconnects it."""

    def find(name: str) -> Generic:
        if name not in (block.name, block.id):
            raise NotFound(f"the scene has no object {name}")
        return block

    def build(**settings: Any) -> SuctionGripper:
        chosen = {"carrier": "block", "vacuum_output": "vacuum", "blow_output": "blow", "part_input": "part"}
        gripper = SuctionGripper("gripper_id", "gripper", VacuumGripperSettings(**{**chosen, **settings}))
        gripper.attach(find)
        return gripper

    with disconnecting(build) as make:
        yield make


@pytest.fixture
def gripper(make: Make) -> SuctionGripper:
    """Connect and take control."""
    gripper = make()
    gripper.connect()
    gripper.take_control()
    return gripper
