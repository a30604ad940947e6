"""`arcor2-hw device new`: generated code passes the suite, the linter and the analysis unchanged."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from arcor2_hw.data.cell import read_cell
from arcor2_server.cli.device_new import WIRES, Bus, refusal, texts
from arcor2_server.cli.starter_kinds import KINDS, NO_ACT, Base

pytestmark = pytest.mark.timeout(180)
COMMAND = [sys.executable, "-m", "arcor2_server.cli.main"]
ROOT = Path(__file__).parents[3]
RUN = [
    (Base.MACHINE, Bus.MODBUS),
    (Base.AXIS, Bus.SERIAL),
]
"""What is run here in full; every other combination is linted and analysed."""
OF_THE_AUTHOR = ("hook works", "hook readings", "hook beyond_limits", NO_ACT)
"""Hooks of the bench that only somebody who knows the device can fill, and a device that does nothing for long."""
ALL = [(base, bus) for base in KINDS for bus in WIRES]


def written(directory: Path, base: Base, bus: Bus, name: str = "dough-mixer") -> Path:
    done = subprocess.run(
        [*COMMAND, "device", "new", name, "--base", base, "--bus", bus, "--directory", str(directory)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return directory / name


def lines(path: Path) -> int:
    """The lines that somebody has to write: all but the empty ones."""
    return sum(bool(line.strip()) for line in path.read_text().splitlines())


@pytest.mark.parametrize(("base", "bus"), RUN, ids=lambda each: each.value)
def test_the_generated_driver_passes_the_suite(tmp_path: Path, base: Base, bus: Bus) -> None:
    root = written(tmp_path, base, bus)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-rs"],
        cwd=root,
        env=os.environ,
        capture_output=True,
        text=True,
        timeout=150,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-6000:]
    found = re.search(r"(\d+) passed", done.stdout)
    assert found is not None
    assert int(found.group(1)) >= 19, "the cases of the suite, and the driver's own"
    for line in done.stdout.splitlines():
        if line.startswith("SKIPPED"):
            assert line.endswith(OF_THE_AUTHOR), line


def test_generated_code_is_clean_with_any_name(tmp_path: Path) -> None:
    for base, bus in ALL:
        for name in ("x", "feeder-of-small-round-pi"):
            root = tmp_path / f"{base}-{bus}-{len(name)}"
            for path, text in texts(name, base, bus).items():
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text)
                assert "$" not in text, path
            (device,) = read_cell(root / "cell.yaml").devices
            assert device.name == name.replace("-", "_")
    for command in (["check"], ["format", "--check"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *command, "--no-cache", "."],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr


def test_a_modbus_machine_takes_sixty_lines_in_each_of_three_files(tmp_path: Path) -> None:
    root = written(tmp_path, Base.MACHINE, Bus.MODBUS, "press")
    by_hand = [root / "press" / "press.py", root / "press" / "press_fake.py", root / "tests" / "test_press.py"]
    assert sorted(path for path in root.rglob("*.py") if path.name != "__init__.py") == sorted(by_hand)
    assert lines(by_hand[0]) <= 60
    assert lines(by_hand[1]) <= 60


def test_the_drivers_are_typed(tmp_path: Path, pytestconfig: pytest.Config) -> None:
    kept = getattr(pytestconfig, "cache", None)  # of the library, which need not be read each time
    known = kept.mkdir("typed-starters") if kept is not None else tmp_path / "mypy"
    buses = [*WIRES, *WIRES]
    for base, bus in zip(KINDS, buses, strict=False):  # each base, each bus twice
        for path, text in texts(f"{base}-of-mine", base, bus).items():
            (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / path).write_text(text)
    drivers = [f"{base}_of_mine/{base}_of_mine.py" for base in KINDS]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--python-version", "3.11", *drivers],
        cwd=tmp_path,
        env=os.environ | {"MYPYPATH": str(ROOT), "MYPY_CACHE_DIR": str(known)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["arm", "--base", "robot", "--bus", "modbus"], "no template for robots"),
        (["eye", "--base", "camera", "--bus", "serial"], "no template for cameras"),
        (["belt", "--base", "machine", "--bus", "can"], "object dictionary"),
        (["Press!", "--base", "machine", "--bus", "modbus"], "invalid name"),
        (["class", "--base", "machine", "--bus", "modbus"], "invalid name"),
        (["press", "--base", "lamp", "--bus", "modbus"], "lamp"),
    ],
)
def test_invalid_options_are_refused_in_one_sentence(tmp_path: Path, arguments: list[str], said: str) -> None:
    done = subprocess.run(
        [*COMMAND, "device", "new", *arguments, "--directory", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    written(tmp_path, Base.GENERIC, Bus.HTTP, "scanner")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    again = [*COMMAND, "device", "new", "scanner", "--base", "machine", "--bus", "tcp", "--directory", str(tmp_path)]
    done = subprocess.run(again, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "already exists" in done.stderr
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_every_combination_is_written_or_refused() -> None:
    for base in Base:
        for bus in Bus:
            assert bool(refusal(base, bus)) is ((base, bus) not in ALL)
