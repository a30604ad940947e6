"""A fake tightening controller in a process of its own, and the driver on its port."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.screwdriver.screwdriver import OpenProtocolScrewdriver
from arcor2_drivers.screwdriver.settings import OpenProtocolScrewdriverSettings
from tests.drivers.devices import disconnecting
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]


@pytest.fixture
def make() -> Iterator[Callable[..., OpenProtocolScrewdriver]]:
    """Return ``make("127.0.0.1:4545", keep_alive=0.3)``: a driver that is not connected; the fixture disconnects it."""

    def build(address: str, **settings: Any) -> OpenProtocolScrewdriver:
        host, _, port = address.rpartition(":")
        settings = {"answer_timeout": 2.0, "keep_alive": 0.3} | settings
        return OpenProtocolScrewdriver(
            "screwdriver_id", "screwdriver", OpenProtocolScrewdriverSettings(host, int(port), **settings)
        )

    with disconnecting(build) as make:
        yield make


@pytest.fixture(scope="module")
def running() -> Iterator[FakeProcess]:
    """One fake for the tests of a file, because starting one takes longer than most of them."""
    with FakeProcess("screwdriver", "--duration", "0.2", "--response-timeout", "0.4") as fake:
        yield fake


@pytest.fixture
def fake(running: FakeProcess) -> FakeProcess:
    running.control.do("renew")
    return running


@pytest.fixture
def screwdriver(fake: FakeProcess, make: Callable[..., OpenProtocolScrewdriver]) -> OpenProtocolScrewdriver:
    """Return a driver in control of the fake."""
    screwdriver = make(fake.ready["open_protocol"])
    screwdriver.connect()
    screwdriver.take_control()
    return screwdriver
