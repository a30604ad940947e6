"""A fake reader in a process of its own, and the driver on its line."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from arcor2_drivers.barcode_reader.barcode_reader import BarcodeReader
from arcor2_drivers.barcode_reader.settings import BarcodeReaderSettings
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]


@pytest.fixture
def make() -> Iterator[Callable[..., BarcodeReader]]:
    """Gives ``make("/dev/pts/3", answer_timeout=0.2)``: a driver, not connected; it is disconnected in the end."""
    made: list[BarcodeReader] = []

    def build(port: str, **settings: Any) -> BarcodeReader:
        reader = BarcodeReader("reader_id", "reader", settings=BarcodeReaderSettings(port, **settings))
        made.append(reader)
        return reader

    yield build
    for reader in made:
        reader.disconnect()


@pytest.fixture
def fake(request: pytest.FixtureRequest, start_fake: Callable[..., FakeProcess], tmp_path: Path) -> FakeProcess:
    """On a pty; on TCP for a test that is parametrized with it."""
    tcp = getattr(request, "param", "pty") == "tcp"
    line = ("--tcp", "127.0.0.1:0") if tcp else ("--link", str(tmp_path / "ttyREADER"))
    return start_fake("barcode_reader", *line, "--timeout", "0.5")


@pytest.fixture
def reader(fake: FakeProcess, make: Callable[..., BarcodeReader]) -> BarcodeReader:
    reader = make(fake.ready["port"], answer_timeout=0.25)
    reader.connect()
    return reader
