"""`arcor2-hw device new`: generated code passes the suite, the linter and the analysis unchanged."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from arcor2_hw.data.cell import read_cell
from arcor2_server.cli.device_new import WIRES, Bus, refusal, texts
from arcor2_server.cli.main import app
from arcor2_server.cli.starter_kinds import KINDS, Base
from tests import commands
from tests.server.cli.generated import run_tests

ROOT = Path(__file__).parents[3]
RUN = list(zip(KINDS, [*WIRES, *WIRES], strict=True))
"""The combinations whose tests run completely with `--matrix`: each base, each bus twice. All others are linted and
analysed. Without `--matrix`, each bus once."""
ALL = [(base, bus) for base in KINDS for bus in WIRES]


def generate(directory: Path, base: Base, bus: Bus, name: str = "dough-mixer") -> Path:
    words = ["device", "new", name, "--base", base, "--bus", bus, "--directory", str(directory)]
    assert app(words) == 0
    return directory / name


@pytest.mark.parametrize(
    ("base", "bus"),
    [*RUN[: len(WIRES)], *(pytest.param(*each, marks=pytest.mark.matrix) for each in RUN[len(WIRES) :])],
    ids=lambda each: each.value,
)
def test_the_generated_driver_reaches_silver(tmp_path: Path, base: Base, bus: Bus) -> None:
    output = run_tests(generate(tmp_path, base, bus))
    assert "DoughMixer: silver (claimed silver)" in output
    for line in output.splitlines():
        if line.startswith("SKIPPED"):
            assert line.endswith(tuple(why for _, why in KINDS[base].not_run)), line


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


def pass_tests(root: Path, selected: str, count: int) -> None:
    """Run selected tests of a generated driver; this number of them must pass."""
    assert f"{count} passed" in run_tests(root, "-k", selected)


def test_a_generated_modbus_driver_also_works_over_rtu(tmp_path: Path) -> None:
    root = generate(tmp_path, Base.GENERIC, Bus.MODBUS, "press")
    test = root / "tests" / "test_press.py"
    test.write_text(test.read_text().replace("    fake = ", '    arguments = ("--rtu",)\n    fake = '))
    pass_tests(root, "amount or half_a_frame or loss_reaction or reset_and_back", 4)


def test_lines_of_text_may_have_other_line_ends(tmp_path: Path) -> None:
    root = generate(tmp_path, Base.GENERIC, Bus.TCP, "press")
    link, fake = root / "press" / "link.py", root / "press" / "press_fake.py"
    link.write_text(link.read_text().replace('END = b"\\r"', 'END = b"\\r\\n"'))
    fake.write_text(fake.read_text().replace('"tcp")', '"tcp", end=b"\\r\\n")'))
    assert all('\\r\\n"' in path.read_text() for path in (link, fake))
    pass_tests(root, "amount or half_a_frame", 2)


def test_generated_drivers_pass_mypy(tmp_path: Path, pytestconfig: pytest.Config) -> None:
    cache = getattr(pytestconfig, "cache", None)  # mypy's cache of the library
    mypy_cache = cache.mkdir("typed-starters") if cache is not None else tmp_path / "mypy"
    for base, bus in RUN:
        for path, text in texts(f"{base}-of-mine", base, bus).items():
            (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / path).write_text(text)
    drivers = [f"{base}_of_mine/{base}_of_mine.py" for base in KINDS]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--python-version", "3.11", *drivers],
        cwd=tmp_path,
        env=os.environ | {"MYPYPATH": str(ROOT), "MYPY_CACHE_DIR": str(mypy_cache)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["arm", "--base", "robot", "--bus", "modbus"], "robots have no template"),
        (["eye", "--base", "camera", "--bus", "serial"], "cameras have no template"),
        (["belt", "--base", "machine", "--bus", "can"], "object dictionary"),
        (["Press!", "--base", "machine", "--bus", "modbus"], "invalid name"),
        (["class", "--base", "machine", "--bus", "modbus"], "invalid name"),
        (["generic", "--base", "machine", "--bus", "modbus"], "a class of the library has the name of 'generic'"),
        (["press", "--base", "lamp", "--bus", "modbus"], "lamp"),
    ],
)
def test_invalid_options_are_refused_in_one_sentence(tmp_path: Path, arguments: list[str], expected: str) -> None:
    done = commands.run(commands.CLI, "device", "new", *arguments, "--directory", tmp_path)
    assert done.returncode == 2
    assert expected in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_existing_files_are_not_overwritten(tmp_path: Path) -> None:
    generate(tmp_path, Base.GENERIC, Bus.HTTP, "scanner")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    again = ("device", "new", "scanner", "--base", "machine", "--bus", "tcp", "--directory", tmp_path)
    done = commands.run(commands.CLI, *again)
    assert done.returncode == 2
    assert "already exists" in done.stderr
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_every_combination_is_written_or_refused() -> None:
    for base in Base:
        for bus in Bus:
            assert bool(refusal(base, bus)) is ((base, bus) not in ALL)
