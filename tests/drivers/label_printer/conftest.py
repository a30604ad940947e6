"""A fake label printer in a process of its own, and the driver on its line."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from arcor2_drivers.label_printer.settings import ZplPrinterSettings
from arcor2_drivers.label_printer.zpl_printer import ZplPrinter
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]


@pytest.fixture
def make() -> Iterator[Callable[..., ZplPrinter]]:
    made: list[ZplPrinter] = []

    def build(port: str, **settings: Any) -> ZplPrinter:
        printer = ZplPrinter("printer_id", "printer", settings=ZplPrinterSettings(port, **settings))
        made.append(printer)
        return printer

    yield build
    for printer in made:
        printer.disconnect()


@pytest.fixture
def fake(request: pytest.FixtureRequest, start_fake: Callable[..., FakeProcess], tmp_path: Path) -> FakeProcess:
    """On TCP and silent while it cannot print; on a pty, or with flags, for a test that is parametrized with that."""
    kind = getattr(request, "param", "tcp")
    line = ("--link", str(tmp_path / "ttyPRINTER")) if kind == "pty" else ("--tcp", "127.0.0.1:0")
    return start_fake("label_printer", *line, "--duration", "0.15", *(["--no-mute"] if kind == "flags" else []))


@pytest.fixture
def printer(fake: FakeProcess, make: Callable[..., ZplPrinter]) -> ZplPrinter:
    printer = make(fake.ready["port"], answer_timeout=0.4, print_timeout=1.0)
    printer.connect()
    return printer
