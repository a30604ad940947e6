"""Runs of the conformance suite on the press of `broken`, in a separate process."""

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from tests import commands

HERE = Path(__file__).parent
PACKAGE = HERE / "broken"
QUALITY = (PACKAGE / "quality.yaml").read_text()
BROKEN = sorted(path.stem for path in PACKAGE.glob("[a-z]*.py") if not path.stem.startswith("toy_"))
SUITE = """
import importlib

from arcor2_hw.testing.conformance import Conformance
from broken.toy_press import ToyBench
from broken.toy_reactions import ContinuingBench, HoldingBench


def broken(case):
    module = importlib.import_module(f"broken.{case}")
    base = getattr(module, "BrokenBench", ToyBench)
    return type("Bench", (base,), {"object_type": module.BrokenPress, "label": case})


class TestToy(Conformance):
    benches = [ToyBench]


class TestReactions(Conformance):
    benches = [HoldingBench, ContinuingBench]


class TestBroken(Conformance):
    benches = [broken(case) for case in CASES]
"""


def run(
    folder: Path,
    *arguments: str,
    selected: str = "",
    quality: str = QUALITY,
    conftest: str = "",
    cases: Sequence[str] = (),
) -> str:
    """Run the suite on the press in a separate process and return pytest's output."""
    shutil.copytree(PACKAGE, folder / "broken", dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    for name, text in {
        "test_of_toy.py": "def test_connecting_observes():\n    pass\n",
        "test_toy.py": SUITE.replace("CASES", repr(list(cases))),
        "broken/quality.yaml": quality,
        "conftest.py": conftest,
        "pytest.ini": "[pytest]\n",
    }.items():
        (folder / name).write_text(text)
    options = ["-q", "-p", "no:cacheprovider", "-p", "arcor2_hw.testing.plugin", "-rA", *arguments]
    options += ["-k", selected] if selected else []
    # Environment variables of the surrounding run must not affect this one. None of the installed plugins is
    # loaded: that of dash, a dependency of Open3D, warns with every pytest, and others take time.
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("PYTEST_", "COV_"))}
    environment["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    ended = commands.run(commands.PYTEST, *options, cwd=folder, env=environment, timeout=290)
    return ended.stdout + ended.stderr


def case_of(name: str) -> str:
    """Return the case that a broken driver fails: several of one case are named `case__fault`."""
    return name.partition("__")[0]


def failed(output: str) -> list[str]:
    lines = [line for line in output.splitlines() if line.startswith(("FAILED", "ERROR "))]
    return sorted({line.partition("test_toy.py::TestToy::test_")[2].partition("[")[0] for line in lines})
