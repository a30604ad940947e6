"""A fake scale in a separate process, and the driver on its line."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.scale.mt_sics_scale import MtSicsScale
from arcor2_drivers.scale.settings import MtSicsScaleSettings
from tests.drivers.devices import disconnecting
from tests.fakes.conftest import FakeProcess, fakes_of, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]


@pytest.fixture
def make() -> Iterator[Callable[..., MtSicsScale]]:
    def build(port: str, **settings: Any) -> MtSicsScale:
        return MtSicsScale("scale_id", "scale", settings=MtSicsScaleSettings(port, **settings))

    with disconnecting(build) as make:
        yield make


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, FakeProcess]]:
    """Start one fake per kind of line for all tests of a file, because starting one takes longer than most of them."""
    tcp, pty = ("--tcp", "127.0.0.1:0"), ("--link", str(tmp_path_factory.mktemp("dev") / "ttySCALE"))
    with fakes_of("scale", "--settling", "0.2", "--stability-timeout", "0.6", tcp=tcp, pty=pty) as fakes:
        yield fakes


@pytest.fixture
def fake(request: pytest.FixtureRequest, running: dict[str, FakeProcess]) -> FakeProcess:
    """Reset the fake to its factory state, on a pty or (if parametrized) on TCP."""
    fake = running[getattr(request, "param", "pty")]
    for command in ("unplug", "heal", "plug", "renew"):
        fake.control.do(command)
    return fake


@pytest.fixture
def scale(fake: FakeProcess, make: Callable[..., MtSicsScale]) -> MtSicsScale:
    scale = make(fake.ready["port"], answer_timeout=0.4, stable_timeout=1.0)
    scale.connect()
    return scale
