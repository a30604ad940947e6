"""A fake PLC in a separate process, and the drivers connected to it."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.opcua_plc.opcua_plc import OpcUaPlc
from arcor2_drivers.opcua_plc.settings import OpcUaPlcSettings
from tests.drivers.background_call import BackgroundCall as BackgroundCall
from tests.drivers.benches.opcua_plc_bench import HANDSHAKE
from tests.drivers.devices import disconnecting
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["HANDSHAKE", "start_fake", "wait_for"]

POINTS = (
    "part=DI ns=2;s=Cell.PartPresent | door=DI ns=2;s=Cell.DoorClosed | lamp=DO ns=2;s=Cell.Lamp on_loss=off | "
    "valve=DO ns=2;s=Cell.Valve | level=AI ns=2;s=Cell.Level scale=0.001 unit=m | "
    "temperature=AI ns=2;s=Cell.Temperature unit=°C | speed=AO ns=2;s=Cell.Speed scale=0.01 unit=m/s on_loss=off | "
    "pressure=AO ns=2;s=Cell.Pressure unit=Pa"
)


@pytest.fixture(scope="module")
def one_fake() -> Iterator[FakeProcess]:
    with FakeProcess("opcua_plc", "--time-scale", "5") as fake:
        yield fake


@pytest.fixture
def fake(one_fake: FakeProcess) -> FakeProcess:
    """Reset a PLC that was just switched on. One process serves all tests of a file, because a start takes 2 s."""
    one_fake.control.do("heal")
    one_fake.control.do("restart")
    return one_fake


@pytest.fixture
def make() -> Iterator[Callable[..., OpcUaPlc]]:
    """Return ``make("opc.tcp://127.0.0.1:4000", host_number=2)``: an unconnected driver."""

    def build(url: str, **settings: Any) -> OpcUaPlc:
        given = {"points": POINTS, "handshake": HANDSHAKE, **settings}
        return OpcUaPlc("plc_id", "plc", OpcUaPlcSettings(url, **given))

    with disconnecting(build) as make:
        yield make


@pytest.fixture
def observed(fake: FakeProcess, make: Callable[..., OpcUaPlc]) -> OpcUaPlc:
    plc = make(fake.ready["url"])
    plc.connect()
    return plc


@pytest.fixture
def plc(observed: OpcUaPlc) -> OpcUaPlc:
    observed.take_control()
    return observed
