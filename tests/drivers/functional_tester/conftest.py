"""A fake tester in a separate process, and the driver connected to it."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.functional_tester.functional_tester import FunctionalTester
from arcor2_drivers.functional_tester.settings import FunctionalTesterSettings
from arcor2_hw.data.geometry import Pose
from tests.drivers.devices import disconnecting
from tests.drivers.faults import relay
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["relay", "start_fake", "wait_for"]


@pytest.fixture(scope="module")
def one_fake() -> Iterator[FakeProcess]:
    with FakeProcess("functional_tester", "--seed", "1", "--test-time", "6", "--time-scale", "20") as fake:
        yield fake


@pytest.fixture
def fake(one_fake: FakeProcess) -> FakeProcess:
    """Reset the tester to its factory state. One process serves all tests of a file."""
    one_fake.control.do("renew")
    return one_fake


@pytest.fixture(scope="module")
def one_slow_fake() -> Iterator[FakeProcess]:
    with FakeProcess("functional_tester", "--seed", "1", "--test-time", "20", "--time-scale", "5") as fake:
        yield fake


@pytest.fixture
def slow_fake(one_slow_fake: FakeProcess) -> FakeProcess:
    """Reset a tester whose tests take 4 s; everything else is fast."""
    one_slow_fake.control.do("renew")
    return one_slow_fake


@pytest.fixture
def make() -> Iterator[Callable[..., FunctionalTester]]:
    """Return ``make("127.0.0.1:4000", watchdog_ms=500)``: an unconnected driver; the fixture disconnects it."""

    def build(address: str, **settings: Any) -> FunctionalTester:
        host, _, port = address.rpartition(":")
        return FunctionalTester(
            "tester_id", "tester", Pose(), None, settings=FunctionalTesterSettings(host, int(port), **settings)
        )

    with disconnecting(build) as make:
        yield make


@pytest.fixture
def observed(fake: FakeProcess, make: Callable[..., FunctionalTester]) -> FunctionalTester:
    tester = make(fake.ready["modbus"])
    tester.connect()
    return tester


@pytest.fixture
def tester(observed: FunctionalTester) -> FunctionalTester:
    observed.take_control()
    return observed


@pytest.fixture
def loaded(fake: FakeProcess, tester: FunctionalTester) -> FunctionalTester:
    """Put a good board into the tester and close the door."""
    tester.open_door()
    assert tester.shown_values == {"door": 1.0}
    fake.control.do("put_board", code="GOOD-1")
    tester.close_door()
    assert tester.shown_values == {"door": 0.0}
    return tester
