"""A fake block in a separate process, and the drivers connected to it."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.remote_io.settings import RemoteIOSettings
from tests.drivers.devices import disconnecting
from tests.drivers.faults import relay
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["relay", "start_fake", "wait_for"]

POINTS = (
    "part=DI0; door=DI1 debounce=0.1; lamp=DO4; valve=DO5 on_loss=hold; lock=DO6 on_loss=on; "
    "level=AI0 scale=0.001 unit=m; speed=AO0 scale=0.01 unit=m/s; pressure=AO1 on_loss=hold"
)


@pytest.fixture(scope="module")
def one_fake() -> Iterator[FakeProcess]:
    with FakeProcess("remote_io") as fake:
        yield fake


@pytest.fixture
def fake(one_fake: FakeProcess) -> FakeProcess:
    """Reset the block to its factory state. One process serves all tests of a file."""
    one_fake.control.do("renew")
    return one_fake


@pytest.fixture
def make() -> Iterator[Callable[..., RemoteIO]]:
    """Return ``make("127.0.0.1:4000", watchdog_ms=500)``: an unconnected driver; the fixture disconnects it."""

    def build(address: str, **settings: Any) -> RemoteIO:
        host, _, port = address.rpartition(":")
        where: dict[str, Any] = {"host": host, "port": int(port)} if host else {"serial_port": address}
        return RemoteIO("block_id", "block", RemoteIOSettings(**{**where, "points": POINTS, **settings}))

    with disconnecting(build) as make:
        yield make


@pytest.fixture
def observed(fake: FakeProcess, make: Callable[..., RemoteIO]) -> RemoteIO:
    block = make(fake.ready["modbus"])
    block.connect()
    return block


@pytest.fixture
def block(observed: RemoteIO) -> RemoteIO:
    observed.take_control()
    return observed
