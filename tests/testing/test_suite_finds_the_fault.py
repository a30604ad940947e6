"""The suite passes a driver that keeps the rules, and fails one that breaks a rule in the case for it."""

import subprocess
import sys
from pathlib import Path

import pytest

from arcor2_hw.analysis import SourceFile
from arcor2_hw.testing import described

HERE = Path(__file__).parent
QUALITY = (HERE / "quality_of_toy.yaml").read_text()
CASES = [
    "absent_device",
    "command_needs_control",
    "connect_is_idempotent",
    "connecting_observes",
    "connecting_to_a_silent_device",
    "constructor_opens_nothing",
    "control_does_not_come_back",
    "control_is_refused",
    "disconnect_is_idempotent",
    "disconnecting_ends_an_act",
    "nothing_is_left_behind",
    "nothing_resumes",
    "silence_in_a_call",
    "stale_is_an_error",
    "stop_passes",
]
SUITE = """
from arcor2_hw.testing.conformance import Conformance
from toy_press import ToyBench, ToyPress


def broken(case):
    kind = type(f"Toy_{{case}}", (ToyPress,), {{"breaks": case, "__module__": "toy_press"}})
    return type("BrokenBench", (ToyBench,), {{"object_type": kind}})


class TestToy(Conformance):
    benches = [ToyBench]


class TestBroken(Conformance):
    benches = [broken(case) for case in {cases!r}]
"""


def run(folder: Path, *cases: str, selected: str = "TestToy", quality: str = "", conftest: str = "") -> str:
    """Run the suite on the press in a process of its own; give what pytest printed."""
    folder.mkdir(exist_ok=True)
    for name, text in {
        "toy_press.py": (HERE / "toy_press.py").read_text(),
        "test_toy.py": SUITE.format(cases=CASES),
        "quality.yaml": quality or QUALITY,
        "conftest.py": conftest,
        "pytest.ini": "[pytest]\nasyncio_default_fixture_loop_scope = function\n",
    }.items():
        (folder / name).write_text(text)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-rA", *(cases or ("-k", selected))]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=100, check=False).stdout


def failed(output: str) -> list[str]:
    lines = [line for line in output.splitlines() if line.startswith(("FAILED", "ERROR "))]
    return sorted({line.partition("test_toy.py::TestToy::test_")[2].partition("[")[0] for line in lines})


def test_a_driver_that_keeps_the_rules_passes(tmp_path: Path) -> None:
    output = run(tmp_path, "test_toy.py::TestToy")
    assert "18 passed, 1 skipped in" in output, output


def test_each_broken_rule_fails_in_its_case(tmp_path: Path) -> None:
    output = run(tmp_path, *(f"test_toy.py::TestBroken::test_{case}[Toy_{case}]" for case in CASES))
    assert f"{len(CASES)} failed in" in output, output[-3000:]


def test_a_hook_that_is_missing_needs_a_written_reason(tmp_path: Path) -> None:
    output = run(tmp_path, selected="TestToy and loss_reaction", quality=QUALITY.partition("not_run:")[0])
    assert failed(output) == ["loss_reaction"]
    assert "lacks orphan: implement it, or give the reason in quality.yaml under not_run" in output


def test_a_reason_for_what_can_be_run_is_refused(tmp_path: Path) -> None:
    output = run(
        tmp_path, selected="TestToy and stop_passes", quality=QUALITY + "  stop_passes: it is too hard for us\n"
    )
    assert failed(output) == ["stop_passes"]
    assert "says that stop_passes is not run, but the bench can run it" in output


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("outputs_on_loss: off", "outputs_on_loss: maybe", "outputs_on_loss"),
        ("limits: []", "limit: []", "unknown field `limit`"),
        ("loss_reaction: the", "loss_reaction: because  #", "not_run: loss_reaction needs a reason"),
        ("types: [ToyPress]", "types: [Other]", "types does not name ToyPress"),
        ("actions: [clamp, stroke]", "actions: [clamp]", "actions does not name stroke"),
        ("actions: [clamp, stroke]", "actions: [clamp, stroke, jump]", "has no action jump"),
    ],
)
def test_a_quality_file_that_is_not_in_order_is_named(tmp_path: Path, old: str, new: str, told: str) -> None:
    assert old in QUALITY
    (tmp_path / "quality.yaml").write_text(QUALITY.replace(old, new))
    source = (HERE / "toy_press.py").read_bytes()
    wrong = described.faults(SourceFile("ToyPress", "toy_press", source, str(tmp_path / "toy_press.py")))
    assert len(wrong) == 1
    assert told in wrong[0]


def test_a_real_device_is_not_touched_unless_named(tmp_path: Path) -> None:
    real = "from toy_press import ToyBench\n\nToyBench.real = True\n"
    assert "1 skipped, " in run(tmp_path, selected="TestToy and stop_passes", conftest=real)
