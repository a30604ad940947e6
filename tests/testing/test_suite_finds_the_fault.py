"""The suite passes a correct driver. A driver that breaks one rule fails only the case of that rule."""

import re
import shutil
from pathlib import Path

import pytest

from arcor2_hw.analysis import SourceFile
from arcor2_hw.testing import declarations
from arcor2_hw.testing.conformance import Conformance
from tests.testing.toy_suite import BROKEN, PACKAGE, QUALITY, case_of, failed, run

NO_ORPHAN = """
from broken.toy_press import ToyBench
from arcor2_hw.testing.bench import Bench

ToyBench.orphan = Bench.orphan
"""
REASON = "not_run:\n  loss_reaction: the press would die with its driver\n"


def test_a_correct_driver_passes_and_reaches_silver(tmp_path: Path) -> None:
    output = run(tmp_path, "test_toy.py::TestToy")
    assert f"{len(Conformance.cases()) + 1} passed in" in output, output
    assert f"ToyPress: silver (claimed silver), {len(Conformance.cases())} passed; next: quality.yaml names" in output


def test_presses_that_hold_and_continue_as_declared_pass(tmp_path: Path) -> None:
    output = run(tmp_path, selected="TestReactions and (loss_reaction or nothing_resumes)")
    assert "4 passed, " in output, output


def test_each_case_has_a_broken_driver() -> None:
    assert set(map(case_of, BROKEN)) == Conformance.cases()


@pytest.mark.parametrize(
    ("cases", "options"),
    [
        ([f"test_toy.py::TestBroken::test_{case_of(name)}[{name}]" for name in BROKEN], ()),
        pytest.param(["test_toy.py::TestBroken"], ("-pxdist", "-n4", "--dist=load"), marks=pytest.mark.matrix),
    ],
    ids=["one case", "all cases"],
)
def test_each_broken_driver_fails_only_its_case(tmp_path: Path, cases: list[str], options: tuple[str, ...]) -> None:
    selection = (*cases, *options, "--phases=1", "-rfE", "--tb=short")
    output = run(tmp_path, *selection, selected="not test_level", cases=BROKEN)
    found: dict[str, set[str]] = {}
    for case, bench in re.findall(r"^(?:FAILED|ERROR) test_toy.py::TestBroken::test_(\w+)\[(\w+)\]", output, re.M):
        found.setdefault(bench, set()).add(case)
    assert found == {name: {case_of(name)} for name in BROKEN}, output


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
    ("old", "new", "problem"),
    [
        ("outputs_on_loss: off", "outputs_on_loss: maybe", "outputs_on_loss"),
        ("limits: []", "limit: []", "unknown field `limit`"),
        ("level: silver", "not_run: {loss_reaction: because}", "not_run: loss_reaction needs a reason in words"),
        ("level: silver", "level: best", "level"),
        ("level: silver", "frames: {morse: []}", "unknown kind morse"),
        ("types: [ToyPress, BrokenPress]", "types: [Other]", "types does not name ToyPress"),
        ("stroke, weigh]", "weigh]", "actions does not name stroke"),
        ("stroke, weigh]", "stroke, weigh, jump]", "has no action jump"),
    ],
)
def test_an_invalid_quality_file_is_named(tmp_path: Path, old: str, new: str, problem: str) -> None:
    assert old in QUALITY
    folder = shutil.copytree(PACKAGE, tmp_path / PACKAGE.name)
    (folder / "quality.yaml").write_text(QUALITY.replace(old, new))
    path = folder / "toy_press.py"
    wrong = declarations.faults(SourceFile("ToyPress", "broken.toy_press", path.read_bytes(), str(path)))
    assert len(wrong) == 1
    assert problem in wrong[0]


def test_a_real_device_is_used_only_if_named(tmp_path: Path) -> None:
    real = "from broken.toy_press import ToyBench\n\nToyBench.real = True\n"
    for options in (["--real"], ["--real-device", "ToyPress"]):
        assert "1 skipped, " in run(tmp_path, *options, selected="TestToy and stop_passes", conftest=real)
    options = ["--real", "--real-device", "ToyPress"]
    assert "1 passed, " in run(tmp_path, *options, selected="TestToy and stop_passes", conftest=real)
