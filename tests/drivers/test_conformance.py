"""The conformance suite on every installed driver, and the declarations of its source."""

import importlib
import pkgutil
import subprocess
import sys
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import pytest

from arcor2_hw.analysis import InstalledType
from arcor2_hw.testing import declarations, quality, rules
from arcor2_hw.testing.bench import Bench
from arcor2_hw.testing.conformance import Conformance
from arcor2_hw.testing.plugin import COLLECTED
from tests.drivers import benches

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path(__file__).resolve().parent


def found_benches() -> list[type[Bench]]:
    """Return the benches of all modules of the package `benches`."""
    return [
        each
        for module in pkgutil.iter_modules(benches.__path__, f"{benches.__name__}.")
        for each in vars(importlib.import_module(module.name)).values()
        if isinstance(each, type) and issubclass(each, Bench) and each.__module__ == module.name
    ]


def collected_tests(config: pytest.Config) -> Mapping[str, frozenset[str]]:
    """Return the names of the tests of the drivers, by file: those of this run, or else those that pytest collects."""
    found = config.stash[COLLECTED]
    return found if {str(path) for path in FOLDER.rglob("test_*.py")} <= found.keys() else all_driver_tests()


@lru_cache(maxsize=1)
def all_driver_tests() -> dict[str, frozenset[str]]:
    """Return the names of the tests that pytest collects for the drivers, by file."""
    command = (sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", "tests/drivers")
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert listed.returncode == 0, listed.stdout[-2000:] + listed.stderr[-2000:]
    found: dict[str, set[str]] = {str(path): set() for path in FOLDER.rglob("*.py")}
    for line in listed.stdout.splitlines():
        path, _, test = line.partition("::")
        if test:
            found[str(ROOT / path)].add(test.rpartition("::")[2].partition("[")[0])
    return {path: frozenset(names) for path, names in found.items()}


class TestConformance(Conformance):
    benches = found_benches()


@pytest.mark.parametrize("driver", declarations.drivers(), ids=lambda driver: driver.name)
def test_every_installed_driver_is_covered(driver: InstalledType, pytestconfig: pytest.Config) -> None:
    assert driver.file is not None, driver.problem and driver.problem.what
    file = Path(driver.folder) / quality.FILE
    wrong = declarations.faults(driver.file)
    assert not wrong, "; ".join(wrong)
    claims = quality.read(file)
    assert claims.conformance is quality.Conformance.BENCH, "quality.yaml has no `conformance: bench`"
    assert (ROOT / claims.page).is_file(), f"quality.yaml names the page {claims.page}, which does not exist"
    wrong = rules.missing_tests(claims.named_tests(), [FOLDER], file.parent.name, collected_tests(pytestconfig))
    assert not wrong, "; ".join(wrong)
    have = {bench.type_name() for bench in TestConformance.benches}
    assert driver.name in have or driver.name in claims.not_run, f"{driver.name} has neither a bench nor a reason"
