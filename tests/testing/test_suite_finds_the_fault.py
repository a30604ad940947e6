"""The suite passes a correct driver. A driver that breaks one rule fails only the case of that rule."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from arcor2_hw.analysis import SourceFile
from arcor2_hw.testing import declarations
from arcor2_hw.testing.conformance import Conformance

HERE = Path(__file__).parent
PACKAGE = HERE / "broken"
QUALITY = (PACKAGE / "quality.yaml").read_text()
BROKEN = sorted(path.stem for path in PACKAGE.glob("[a-z]*.py") if path.stem != "toy_press")
NO_ORPHAN = """
from broken.toy_press import ToyBench
from arcor2_hw.testing.bench import Bench

ToyBench.orphan = Bench.orphan
"""
REASON = "not_run:\n  loss_reaction: the press would die with its driver\n"
SUITE = """
import importlib

from arcor2_hw.testing.conformance import Conformance
from broken.toy_press import ToyBench


def broken(case):
    module = importlib.import_module(f"broken.{case}")
    base = getattr(module, "BrokenBench", ToyBench)
    return type("Bench", (base,), {"object_type": module.BrokenPress, "label": case})


class TestToy(Conformance):
    benches = [ToyBench]


class TestBroken(Conformance):
    benches = [broken(case) for case in CASES]
"""


def run(
    folder: Path, *arguments: str, selected: str = "", quality: str = QUALITY, conftest: str = "", cases: bool = False
) -> str:
    """Run the suite on the press in its own process and return the output of pytest."""
    shutil.copytree(PACKAGE, folder / "broken", dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    for name, text in {
        "test_of_toy.py": "def test_connecting_observes():\n    pass\n",
        "test_toy.py": SUITE.replace("CASES", repr(BROKEN if cases else [])),
        "broken/quality.yaml": quality,
        "conftest.py": conftest,
        "pytest.ini": "[pytest]\n",
    }.items():
        (folder / name).write_text(text)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "arcor2_hw.testing.plugin"]
    command += ["-rA", *arguments, *(["-k", selected] if selected else [])]
    # What the run around this one tells its own processes is not meant for this one. Of the plugins that happen to be
    # installed none is loaded: the one of dash, which Open3D brings along, warns with every pytest, others take time.
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("PYTEST_", "COV_"))}
    environment["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    ended = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=170, check=False
    )
    return ended.stdout + ended.stderr


def failed(output: str) -> list[str]:
    lines = [line for line in output.splitlines() if line.startswith(("FAILED", "ERROR "))]
    return sorted({line.partition("test_toy.py::TestToy::test_")[2].partition("[")[0] for line in lines})


def test_a_correct_driver_passes_and_reaches_silver(tmp_path: Path) -> None:
    output = run(tmp_path, "test_toy.py::TestToy")
    assert f"{len(Conformance.cases()) + 1} passed in" in output, output
    assert f"ToyPress: silver (claimed silver), {len(Conformance.cases())} passed; next: quality.yaml names" in output


def test_there_is_a_broken_driver_for_each_case() -> None:
    assert set(BROKEN) == Conformance.cases()


@pytest.mark.timeout(180)
def test_each_broken_driver_fails_only_its_case(tmp_path: Path) -> None:
    options = ("-pxdist", "-n8", "--dist=load", "--phases=1")
    output = run(tmp_path, "test_toy.py::TestBroken", *options, selected="not test_level", cases=True)
    found: dict[str, set[str]] = {}
    for case, bench in re.findall(r"^(?:FAILED|ERROR) test_toy.py::TestBroken::test_(\w+)\[(\w+)\]", output, re.M):
        found.setdefault(bench, set()).add(case)
    assert found == {case: {case} for case in BROKEN}, output[-6000:]


def test_a_missing_hook_requires_a_reason(tmp_path: Path) -> None:
    output = run(tmp_path, selected="TestToy and loss_reaction", conftest=NO_ORPHAN)
    assert failed(output) == ["loss_reaction"]
    assert "lacks orphan: implement it, or give the reason in quality.yaml under not_run" in output
    output = run(tmp_path, selected="TestToy and loss_reaction", conftest=NO_ORPHAN, quality=QUALITY + REASON)
    assert "1 skipped, " in output
    assert "the press would die with its driver" in output


def test_a_reason_for_a_case_that_can_run_is_refused(tmp_path: Path) -> None:
    output = run(tmp_path, selected="TestToy and loss_reaction", quality=QUALITY + REASON)
    assert failed(output) == ["loss_reaction"]
    assert "excludes loss_reaction, but the bench can run it" in output


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("outputs_on_loss: off", "outputs_on_loss: maybe", "outputs_on_loss"),
        ("limits: []", "limit: []", "unknown field `limit`"),
        ("level: silver", "not_run: {loss_reaction: because}", "not_run: loss_reaction needs a reason in words"),
        ("level: silver", "level: best", "level"),
        ("level: silver", "frames: {morse: []}", "unknown kind morse"),
        ("types: [ToyPress, BrokenPress]", "types: [Other]", "types does not name ToyPress"),
        ("actions: [clamp, press, stroke]", "actions: [clamp, press]", "actions does not name stroke"),
        ("actions: [clamp, press, stroke]", "actions: [clamp, press, stroke, jump]", "has no action jump"),
    ],
)
def test_an_invalid_quality_file_is_named(tmp_path: Path, old: str, new: str, told: str) -> None:
    assert old in QUALITY
    (tmp_path / "quality.yaml").write_text(QUALITY.replace(old, new))
    source = (PACKAGE / "toy_press.py").read_bytes()
    wrong = declarations.faults(SourceFile("ToyPress", "broken.toy_press", source, str(tmp_path / "toy_press.py")))
    assert len(wrong) == 1
    assert told in wrong[0]


def test_a_real_device_is_used_only_if_named(tmp_path: Path) -> None:
    real = "from broken.toy_press import ToyBench\n\nToyBench.real = True\n"
    for options in (["--real"], ["--real-device", "ToyPress"]):
        assert "1 skipped, " in run(tmp_path, *options, selected="TestToy and stop_passes", conftest=real)
    options = ["--real", "--real-device", "ToyPress"]
    assert "1 passed, " in run(tmp_path, *options, selected="TestToy and stop_passes", conftest=real)
