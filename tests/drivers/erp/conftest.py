"""A fake planning service in a separate process, and the drivers connected to it."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from arcor2_drivers.erp.erp_service import ErpService
from arcor2_drivers.erp.settings import ErpSettings
from arcor2_hw.exceptions import Arcor2Error
from tests import waiting
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]


class Waiting:
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

    def outcome(self) -> object:
        self._thread.join(waiting.WITHIN)
        assert not self._thread.is_alive(), "it has not ended"
        return self.result

    def outcome_after(self, stop: Callable[[], object]) -> object:
        """Request stops until the call ends: a stop from before it waits has no effect."""

        def ended() -> bool:
            stop()
            return not self._thread.is_alive()

        waiting.wait_for(ended)
        return self.result


def serials(fake: FakeProcess, order: str = "A-1") -> list[str]:
    """Return the serial numbers that the service has of an order, in order of arrival."""
    return [result["serial"] for result in fake.truth()["results"] if result["order"] == order]


@pytest.fixture(scope="module")
def one_fake() -> Iterator[FakeProcess]:
    fake = FakeProcess("erp")
    fake.truth()  # opens the control channel
    yield fake
    fake.end()


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
    made: list[ErpService] = []

    def build(url: str, **settings: Any) -> ErpService:
        usual = {"outbox": str(tmp_path), "request_timeout": 0.5, "longest_pause": 0.5, "poll": 0.1}
        erp = ErpService("erp_id", "planning", ErpSettings(url, **{**usual, **settings}))
        made.append(erp)
        return erp

    yield build
    for erp in made:
        erp.disconnect()


@pytest.fixture
def erp(fake: FakeProcess, make: Callable[..., ErpService]) -> ErpService:
    erp = make(fake.ready["url"])
    erp.connect()
    return erp
