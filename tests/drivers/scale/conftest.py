"""A fake scale in a process of its own, and the driver on its line."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from arcor2_drivers.scale.mt_sics_scale import MtSicsScale
from arcor2_drivers.scale.settings import MtSicsScaleSettings
from tests.fakes.conftest import FakeProcess, start_fake, wait_for

__all__ = ["start_fake", "wait_for"]


@pytest.fixture
def make() -> Iterator[Callable[..., MtSicsScale]]:
    made: list[MtSicsScale] = []

    def build(port: str, **settings: Any) -> MtSicsScale:
        scale = MtSicsScale("scale_id", "scale", settings=MtSicsScaleSettings(port, **settings))
        made.append(scale)
        return scale

    yield build
    for scale in made:
        scale.disconnect()


@pytest.fixture
def fake(request: pytest.FixtureRequest, start_fake: Callable[..., FakeProcess], tmp_path: Path) -> FakeProcess:
    """On a pty; on TCP for a test that is parametrized with it."""
    tcp = getattr(request, "param", "pty") == "tcp"
    line = ("--tcp", "127.0.0.1:0") if tcp else ("--link", str(tmp_path / "ttySCALE"))
    return start_fake("scale", *line, "--settling", "0.3", "--stability-timeout", "0.6")


@pytest.fixture
def scale(fake: FakeProcess, make: Callable[..., MtSicsScale]) -> MtSicsScale:
    scale = make(fake.ready["port"], answer_timeout=0.4, stable_timeout=1.0)
    scale.connect()
    return scale
