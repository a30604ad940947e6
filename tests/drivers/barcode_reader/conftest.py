"""A fake reader in a separate process, and the driver on its line."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.barcode_reader.barcode_reader import BarcodeReader
from arcor2_drivers.barcode_reader.settings import BarcodeReaderSettings
from tests.drivers.devices import disconnecting
from tests.fakes.conftest import FakeProcess, fakes_of, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]


@pytest.fixture
def make() -> Iterator[Callable[..., BarcodeReader]]:
    """Return ``make("/dev/pts/3", answer_timeout=0.2)``: an unconnected driver; the fixture disconnects it."""

    def build(port: str, **settings: Any) -> BarcodeReader:
        return BarcodeReader("reader_id", "reader", settings=BarcodeReaderSettings(port, **settings))

    with disconnecting(build) as make:
        yield make


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, FakeProcess]]:
    """Start one fake per kind of line for all tests of a file."""
    tcp, pty = ("--tcp", "127.0.0.1:0"), ("--link", str(tmp_path_factory.mktemp("line") / "reader"))
    with fakes_of("barcode_reader", "--timeout", "0.5", tcp=tcp, pty=pty) as fakes:
        yield fakes


@pytest.fixture
def fake(request: pytest.FixtureRequest, running: dict[str, FakeProcess]) -> FakeProcess:
    """Reset the fake to its factory state, on a pty or (if parametrized) on TCP."""
    fake = running[getattr(request, "param", "pty")]
    fake.control.do("renew")
    return fake


@pytest.fixture
def reader(fake: FakeProcess, make: Callable[..., BarcodeReader]) -> BarcodeReader:
    reader = make(fake.ready["port"], answer_timeout=0.25)
    reader.connect()
    return reader
