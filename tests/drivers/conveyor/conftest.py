"""A fake conveyor in a separate process, and the driver on its bus."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.conveyor.conveyor import Conveyor
from arcor2_drivers.conveyor.settings import ConveyorSettings
from tests.drivers.devices import disconnecting
from tests.fakes.conftest import FakeProcess, wait_for

__all__ = ["wait_for"]


@pytest.fixture(scope="module")
def one_fake() -> Iterator[FakeProcess]:
    with FakeProcess("conveyor") as fake:
        yield fake


@pytest.fixture
def fake(one_fake: FakeProcess) -> FakeProcess:
    """Reset the fake: no faults, just switched on."""
    one_fake.control.do("heal")
    one_fake.control.do("mute", on=False)
    one_fake.control.do("power_cycle", belt=0)
    one_fake.control.wait_until(lambda truth: truth["booted"])
    return one_fake


@pytest.fixture
def make() -> Iterator[Callable[..., Conveyor]]:
    """Return ``make("127.0.0.1:4000", homing_method=19)``: an unconnected driver; the fixture disconnects it."""

    def build(address: str, **settings: Any) -> Conveyor:
        values = {"heartbeat_ms": 1000, "sdo_timeout": 0.4} | settings
        return Conveyor("belt_id", "belt", ConveyorSettings(f"socket://{address}", **values))

    with disconnecting(build) as make:
        yield make


@pytest.fixture
def observed(fake: FakeProcess, make: Callable[..., Conveyor]) -> Conveyor:
    conveyor = make(fake.ready["can"])
    conveyor.connect()
    return conveyor


@pytest.fixture
def belt(observed: Conveyor) -> Conveyor:
    observed.take_control()
    return observed
