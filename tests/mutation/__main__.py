"""Mutate the journal, the lock table and the lane of a device; fail if tests notice less than 85 % of the mutants.

Runs in copies of the checkout, so that an interrupted run leaves no mutant behind. Prints the surviving mutants.
"""

import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cyclopts
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import TestOutcome, WorkerOutcome, WorkResult
from rich.console import Console

REPOSITORY = Path(__file__).resolve().parents[2]
SOURCES = (".", "drivers", "fakes", "server")
KILLED_SHARE = 0.85
"""Smallest share of killed mutants."""
TIMEOUT = 60.0
"""Time after which a mutant counts as killed, since its tests hang, s."""
IGNORED = ["core/ReplaceBinaryOperator_BitOr_.*"]
"""Nearly all `|` are unions of types, which have no effect at run time."""

console = Console()


@dataclass(frozen=True)
class Target:
    """Modules to mutate, and the tests that should notice."""

    name: str
    modules: Sequence[str]
    tests: Sequence[str]


TARGETS = (
    Target("lane", ["arcor2_hw/runtime/lane.py"], ["tests/runtime/test_lane.py"]),
    Target(
        "locks",
        ["server/arcor2_server/collaboration/lock_table.py"],
        ["tests/server/core/test_locks.py"],
    ),
    Target(
        "journal",
        [f"server/arcor2_server/documents/{name}.py" for name in ("journal", "journal_file", "journal_records")],
        [
            "tests/server/session/test_journal_file.py",
            "tests/server/session/test_journal_records.py",
            "tests/server/session/test_journal.py",
            "tests/server/session/test_journal_damage.py",
            "tests/server/session/test_session_journal.py",
        ],
    ),
)


@dataclass(frozen=True)
class Result:
    """Number of mutants, and the surviving mutants as differences of the source."""

    total: int
    survived: list[str]

    @property
    def share(self) -> float:
        """Return the share of killed mutants."""
        return 1 - len(self.survived) / self.total


def copy_checkout(folder: Path) -> None:
    """Copy the tracked and the new files of the checkout."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=REPOSITORY, check=True, capture_output=True, text=True,
    )  # fmt: skip
    for name in listed.stdout.split("\0"):
        if name and (REPOSITORY / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(REPOSITORY / name, folder / name)


def skip_all_but(sample: int, path: Path) -> None:
    """Skip all pending mutants of a session but a sample, which is the same in every run."""
    with use_db(str(path), WorkDB.Mode.open) as database:
        pending = sorted(database.pending_work_items, key=lambda item: repr(item.mutations))
        random.Random(len(pending)).shuffle(pending)
        for item in pending[sample:]:
            database.set_result(item.job_id, WorkResult(WorkerOutcome.SKIPPED))


def mutate(target: Target, sample: int) -> Result:
    """Run the tests of a target against its mutants, or against a sample of them unless it is 0."""
    with tempfile.TemporaryDirectory(prefix="mutation-") as name:
        folder = Path(name)
        copy_checkout(folder)
        modules = ", ".join(f'"{module}"' for module in target.modules)
        pytest = f"{sys.executable} -m pytest -x -q -p asyncio -p timeout -p no:cacheprovider {' '.join(target.tests)}"
        (folder / "mutation.toml").write_text(
            f"[cosmic-ray]\nmodule-path = [{modules}]\ntimeout = {TIMEOUT}\nexcluded-modules = []\n"
            f'test-command = "{pytest}"\n[cosmic-ray.distributor]\nname = "local"\n'
            f"[cosmic-ray.filters.operators-filter]\nexclude-operators = {IGNORED}\n"
        )
        environment = os.environ | {
            "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
            "PYTHONPATH": os.pathsep.join(str(folder / each) for each in SOURCES),
        }

        def run(*command: str) -> None:
            binary = Path(sys.executable).with_name(command[0])
            subprocess.run([binary, *command[1:]], cwd=folder, env=environment, check=True)

        run("cosmic-ray", "init", "mutation.toml", "mutation.sqlite")
        run("cr-filter-operators", "mutation.sqlite", "mutation.toml")
        if sample:
            skip_all_but(sample, folder / "mutation.sqlite")
        run("cosmic-ray", "--verbosity", "ERROR", "baseline", "mutation.toml")
        run("cosmic-ray", "exec", "mutation.toml", "mutation.sqlite")
        with use_db(str(folder / "mutation.sqlite"), WorkDB.Mode.open) as database:
            results = [result for _, result in database.results if result.test_outcome is not None]
        survived = [result.diff or "" for result in results if result.test_outcome == TestOutcome.SURVIVED]
        return Result(len(results), survived)


def main(*names: str, sample: int = 0) -> None:
    """Mutate the named targets, or all.

    Args:
        names: lane, locks or journal.
        sample: number of mutants of each target, drawn at random; 0: all.
    """
    targets = [target for target in TARGETS if not names or target.name in names]
    enough = True
    with ThreadPoolExecutor(2) as pool:
        for target, result in zip(targets, pool.map(lambda each: mutate(each, sample), targets), strict=True):
            for diff in result.survived:
                console.print(diff, markup=False, highlight=False)
            killed = result.total - len(result.survived)
            console.print(f"{target.name}: {killed} of {result.total} mutants killed, {result.share:.1%}")
            enough = enough and result.share >= KILLED_SHARE
    if not enough:
        sys.exit(1)


if __name__ == "__main__":
    cyclopts.run(main)
