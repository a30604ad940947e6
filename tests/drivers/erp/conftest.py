"""A fake planning service in a separate process, and the drivers connected to it."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from arcor2_drivers.erp.erp_service import ErpService
from arcor2_drivers.erp.settings import ErpSettings
from tests import waiting
from tests.drivers.background_call import BackgroundCall as BackgroundCall
from tests.drivers.devices import disconnecting
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]


def outcome_after(call: BackgroundCall, stop: Callable[[], object]) -> object:
    """Return the outcome of a call that is stopped until it ends: a stop from before it waits has no effect."""

    def ended() -> bool:
        stop()
        return call.over

    waiting.wait_for(ended)
    return call.outcome()


def serials(fake: FakeProcess, order: str = "A-1") -> list[str]:
    """Return the serial numbers of an order that the service has received, in the order of arrival."""
    return [result["serial"] for result in fake.truth()["results"] if result["order"] == order]


@pytest.fixture(scope="module")
def one_fake() -> Iterator[FakeProcess]:
    with FakeProcess("erp") as fake:
        yield fake


@pytest.fixture
def fake(one_fake: FakeProcess) -> Iterator[FakeProcess]:
    """Reset the service to an empty plan. One process serves all tests of a file."""
    for command in ("heal", "work", "forget"):
        one_fake.control.do(command)
    yield one_fake
    for command in ("heal", "work"):
        one_fake.control.do(command)


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Callable[..., ErpService]]:
    """Return ``make("http://127.0.0.1:4000", poll=0.1)``: an unconnected driver; the fixture disconnects it."""

    def build(url: str, **settings: Any) -> ErpService:
        usual = {"outbox": str(tmp_path), "request_timeout": 1.0, "longest_pause": 0.5, "poll": 0.1}
        return ErpService("erp_id", "planning", ErpSettings(url, **{**usual, **settings}))

    with disconnecting(build) as make:
        yield make


@pytest.fixture
def erp(fake: FakeProcess, make: Callable[..., ErpService]) -> ErpService:
    erp = make(fake.ready["url"])
    erp.connect()
    return erp
