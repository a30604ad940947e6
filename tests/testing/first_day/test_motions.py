"""The motions declared by first_day.yaml move the simulated device, and are detected and stopped."""

import dataclasses
from pathlib import Path

import pytest

from arcor2_hw.data.base import Unset
from arcor2_hw.data.cell import CellDevice
from arcor2_hw.exceptions import Cancelled
from arcor2_hw.testing import declarations
from arcor2_hw.testing.bench import Bench
from arcor2_hw.testing.first_day.bench import real_bench
from arcor2_hw.testing.first_day.declaration import read
from arcor2_hw.testing.life import BackgroundCall
from arcor2_hw.testing.steps import stop_of
from tests.drivers.test_conformance import found_benches
from tests.waiting import WITHIN, wait_for

ASKED = {"RemoteIO": {"name": "valve"}, "OpcUaPlc": {"name": "lamp"}}


INSTALLED = {each.name for each in declarations.drivers()}


def moving(bench: type[Bench]) -> bool:
    if bench.type_name() not in INSTALLED:
        return False
    day = read(bench.quality_file().parent).get(bench.type_name())
    return day is not None and not isinstance(day.small, Unset)


@pytest.mark.parametrize("kind", list(filter(moving, found_benches())), ids=lambda kind: kind.name())
def test_the_declared_motions(kind: type[Bench]) -> None:
    fake = kind()
    fake.start()
    try:
        fake.reset()
        given = fake.make().settings
        settings = {field.name: getattr(given, field.name) for field in dataclasses.fields(given) if field.init}
        real = real_bench(CellDevice("device", kind.type_name(), settings), Path("cell.yaml"))()
        real.asked = {which: ASKED.get(kind.type_name(), {}) for which in ("small", "full")}
        real.start()
        try:
            device = real.controlled()
            before = fake.writes()
            real.command(device)
            assert fake.writes() != before
            if isinstance(real.day.full, Unset):
                return
            act = BackgroundCall(lambda: real.run_long(device))
            wait_for(lambda: act.over or (fake.running() and real.running()))
            assert not act.over, act.error
            stop_of(device)()
            assert isinstance(act.outcome(WITHIN, "the stopped motion"), Cancelled)
            wait_for(lambda: not fake.running() and not real.running())
        finally:
            real.release()
            real.end()
    finally:
        fake.end()
