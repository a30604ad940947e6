"""A fake PLC in a separate process, and the drivers connected to it."""

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.opcua_plc.opcua_plc import OpcUaPlc
from arcor2_drivers.opcua_plc.settings import OpcUaPlcSettings
from arcor2_hw.exceptions import Arcor2Error
from tests.drivers.benches.opcua_plc_bench import HANDSHAKE
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["HANDSHAKE", "start_fake", "wait_for"]

POINTS = (
    "part=DI ns=2;s=Cell.PartPresent | door=DI ns=2;s=Cell.DoorClosed | lamp=DO ns=2;s=Cell.Lamp on_loss=off | "
    "valve=DO ns=2;s=Cell.Valve | level=AI ns=2;s=Cell.Level scale=0.001 unit=m | "
    "temperature=AI ns=2;s=Cell.Temperature unit=°C | speed=AO ns=2;s=Cell.Speed scale=0.01 unit=m/s on_loss=off | "
    "pressure=AO ns=2;s=Cell.Pressure unit=Pa"
)


class BackgroundCall:
    """A call in its own thread."""

    def __init__(self, call: Callable[[], object]) -> None:
        self.result: object = None
        self._thread = threading.Thread(target=self._run, args=(call,), daemon=True)
        self._thread.start()

    def _run(self, call: Callable[[], object]) -> None:
        try:
            self.result = call()
        except Arcor2Error as error:
            self.result = error

    def outcome(self, within: float = 20.0) -> object:
        self._thread.join(within)
        assert not self._thread.is_alive(), f"it has not ended within {within:g} s"
        return self.result


@pytest.fixture(scope="module")
def one_fake() -> Iterator[FakeProcess]:
    fake = FakeProcess("opcua_plc", "--time-scale", "5")
    fake.truth()  # opens the control channel
    yield fake
    fake.end()


@pytest.fixture
def fake(one_fake: FakeProcess) -> FakeProcess:
    """Reset a PLC that was just switched on. One process serves all tests of a file, because a start takes 2 s."""
    one_fake.control.do("heal")
    one_fake.control.do("restart")
    return one_fake


@pytest.fixture
def make() -> Iterator[Callable[..., OpcUaPlc]]:
    """Return ``make("opc.tcp://127.0.0.1:4000", host_number=2)``: an unconnected driver."""
    made: list[OpcUaPlc] = []

    def build(url: str, **settings: Any) -> OpcUaPlc:
        given = {"points": POINTS, "handshake": HANDSHAKE, **settings}
        plc = OpcUaPlc("plc_id", "plc", OpcUaPlcSettings(url, **given))
        made.append(plc)
        return plc

    yield build
    for plc in made:
        plc.disconnect()


@pytest.fixture
def observed(fake: FakeProcess, make: Callable[..., OpcUaPlc]) -> OpcUaPlc:
    plc = make(fake.ready["url"])
    plc.connect()
    return plc


@pytest.fixture
def plc(observed: OpcUaPlc) -> OpcUaPlc:
    observed.take_control()
    return observed
