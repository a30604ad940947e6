"""first_day.yaml of all drivers, and the plan of the session."""

import inspect
import re
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.analysis import InstalledType, Library
from arcor2_hw.data.cell import CellDevice
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.objects import Robot
from arcor2_hw.runtime.creation import find_type
from arcor2_hw.testing import declarations, quality
from arcor2_hw.testing.conformance import Conformance
from arcor2_hw.testing.first_day import plan
from arcor2_hw.testing.first_day.bench import real_bench
from arcor2_hw.testing.first_day.declaration import FILE, FirstDay, Motion, read
from arcor2_hw.testing.first_day.session import BEFORE

NOT_DEVICES = {"Bin", "Blister", "ErpService"}
"""Types that have no hardware of their own."""
DEVICES = [each for each in declarations.drivers() if each.name not in NOT_DEVICES]
DOCS = Path(__file__).parents[3] / "docs"


def test_every_case_is_in_one_group() -> None:
    assert sorted(plan.ALL) == sorted(Conformance.cases())


@pytest.mark.parametrize("driver", DEVICES, ids=lambda driver: driver.name)
def test_the_declaration_of_a_driver_fits_its_type(driver: InstalledType) -> None:
    day = read(Path(driver.folder))[driver.name]
    assert driver.file is not None
    settings = {each.name for each in Library([driver.file]).analyse(driver.name).meta.settings}
    assert day.before
    assert not set(day.limits) - settings
    kind = find_type(driver.name)
    for motion in (day.small, day.full):
        if not isinstance(motion, Motion):
            continue
        if isinstance(motion.joint, int):
            assert issubclass(kind, Robot)
        else:
            inspect.signature(getattr(kind, str(motion.call))).bind(None, **motion.arguments, **motion.asked)
    types = quality.read(Path(driver.folder) / quality.FILE).types
    assert set(read(Path(driver.folder))) <= set(types)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("Press: {small: {joint: 1, by: 0.5, speed: 0.1}, full: {joint: 1, by: 0.9, speed: 0.1}}", "twice as long"),
        ("Press: {small: {joint: 0, by: 0.5, speed: 0.1}}", "joint from 1 on"),
        ("Press: {small: {joint: 1, by: 0.5, speed: 2}}", "speed from 0 to 1"),
        ("Press: {small: {call: press}}", "the sentence that the person confirms"),
        ("Press: {small: {call: press, joint: 1, does: It presses.}}", "either joint or call"),
        ("Press: {limit: [force]}", "unknown field `limit`"),
    ],
)
def test_an_invalid_declaration_is_named(tmp_path: Path, text: str, problem: str) -> None:
    (tmp_path / FILE).write_text(text)
    with pytest.raises(InvalidData, match=rf"{tmp_path.name}/{FILE}: .*{problem}"):
        read(tmp_path)


def test_a_driver_without_a_declaration_is_read_only(tmp_path: Path) -> None:
    assert read(tmp_path) == {}
    assert FirstDay().small is not Motion


def test_a_secret_setting_is_found() -> None:
    settings: dict[str, Any] = {"host": "192.0.2.7", "user": "robot", "password": "hidden word"}
    bench = real_bench(CellDevice("yumi", "YuMi", settings), Path("cell.yaml"))()
    assert bench.secrets() == ["hidden word"]


def test_the_page_shows_the_same_as_the_command() -> None:
    page = (DOCS / "how-to" / "first-hardware-day.md").read_text()
    flat = " ".join(page.split())
    for line in BEFORE:
        assert line in flat
    titles = re.findall(r"^\| ([A-Z][\w ]+) \| ", page, re.MULTILINE)
    assert titles[-len(plan.GROUPS) :] == [group.title for group in plan.GROUPS]
