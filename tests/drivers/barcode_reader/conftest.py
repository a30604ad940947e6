"""A fake reader in a separate process, and the driver on its line."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.barcode_reader.barcode_reader import BarcodeReader
from arcor2_drivers.barcode_reader.settings import BarcodeReaderSettings
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]


@pytest.fixture
def make() -> Iterator[Callable[..., BarcodeReader]]:
    """Return ``make("/dev/pts/3", answer_timeout=0.2)``: an unconnected driver; the fixture disconnects it."""
    made: list[BarcodeReader] = []

    def build(port: str, **settings: Any) -> BarcodeReader:
        reader = BarcodeReader("reader_id", "reader", settings=BarcodeReaderSettings(port, **settings))
        made.append(reader)
        return reader

    yield build
    for reader in made:
        reader.disconnect()


@pytest.fixture(scope="module")
def on_pty(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FakeProcess]:
    fake = FakeProcess("barcode_reader", "--link", str(tmp_path_factory.mktemp("line") / "reader"), "--timeout", "0.5")
    fake.truth()  # opens the control channel
    yield fake
    fake.end()


@pytest.fixture(scope="module")
def on_tcp() -> Iterator[FakeProcess]:
    fake = FakeProcess("barcode_reader", "--tcp", "127.0.0.1:0", "--timeout", "0.5")
    fake.truth()
    yield fake
    fake.end()


@pytest.fixture
def fake(request: pytest.FixtureRequest) -> FakeProcess:
    """Reset the fake to its factory state, on a pty or (if parametrized) on TCP. One process serves a file."""
    fake: FakeProcess = request.getfixturevalue(f"on_{getattr(request, 'param', 'pty')}")
    fake.control.do("renew")
    return fake


@pytest.fixture
def reader(fake: FakeProcess, make: Callable[..., BarcodeReader]) -> BarcodeReader:
    reader = make(fake.ready["port"], answer_timeout=0.25)
    reader.connect()
    return reader
