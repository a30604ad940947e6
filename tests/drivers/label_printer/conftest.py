"""A fake label printer in a separate process, and the driver on its line."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.label_printer.settings import ZplPrinterSettings
from arcor2_drivers.label_printer.zpl_printer import ZplPrinter
from tests.drivers.devices import disconnecting
from tests.fakes.conftest import FakeProcess, fakes_of, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]


@pytest.fixture
def make() -> Iterator[Callable[..., ZplPrinter]]:
    def build(port: str, **settings: Any) -> ZplPrinter:
        return ZplPrinter("printer_id", "printer", settings=ZplPrinterSettings(port, **settings))

    with disconnecting(build) as make:
        yield make


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, FakeProcess]]:
    """Start one fake per kind for all tests of a file, because starting one takes longer than most of them."""
    tcp, pty = ("--tcp", "127.0.0.1:0"), ("--link", str(tmp_path_factory.mktemp("dev") / "ttyPRINTER"))
    with fakes_of("label_printer", "--duration", "0.15", tcp=tcp, pty=pty, flags=(*tcp, "--no-mute")) as fakes:
        yield fakes


@pytest.fixture
def fake(request: pytest.FixtureRequest, running: dict[str, FakeProcess]) -> FakeProcess:
    """Reset the fake to its factory state: on a pty and silent while it cannot print, or as parametrized."""
    fake = running[getattr(request, "param", "pty")]
    for command in ("unplug", "heal", "plug", "renew"):
        fake.control.do(command)
    return fake


@pytest.fixture
def printer(fake: FakeProcess, make: Callable[..., ZplPrinter]) -> ZplPrinter:
    printer = make(fake.ready["port"], answer_timeout=0.4, print_timeout=1.0)
    printer.connect()
    return printer
