"""Measure this checkout and another revision in alternation, and print both results (`make bench-compare`).

`python -m benchmarks.compare REVISION [--rounds N] [GROUP ...]` measures every named group (default: all) in both
checkouts in each round; the order alternates. The table shows the medians over the rounds and their ratio.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import msgspec
from rich.console import Console
from rich.table import Table

from benchmarks.__main__ import GROUPS
from benchmarks.metrics import GOALS

ROOT = Path(__file__).parents[1]
FOLDERS = (".", "drivers", "fakes", "server")


def write_metadata(checkout: Path) -> None:
    """Write the package metadata of a checkout: its version and entry points, which may have moved."""
    project = tomllib.loads((checkout / "pyproject.toml").read_text())["project"]
    info = checkout / f"arcor2_hw-{project['version']}.dist-info"
    info.mkdir(exist_ok=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: arcor2-hw\nVersion: {project['version']}\n")
    groups = project["entry-points"] | {"console_scripts": project["scripts"]}
    lines = [
        line
        for group, entries in groups.items()
        for line in (f"[{group}]", *(f"{name} = {target}" for name, target in entries.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")


def measure(checkout: Path, group: str) -> dict[str, float]:
    """Measure one group with the code of a checkout; return its results by name."""
    path = os.pathsep.join(str(checkout / folder) for folder in FOLDERS)
    process = subprocess.run(
        [sys.executable, "-m", "benchmarks", group],
        cwd=checkout,
        env=os.environ | {"PYTHONPATH": path},
        stdout=subprocess.PIPE,
        check=False,
    )
    results = [msgspec.json.decode(line) for line in process.stdout.splitlines()]
    return {result["name"]: result["value"] for result in results}


def compare(other: Path, groups: list[str], rounds: int) -> None:
    """Measure both checkouts in alternation and print the table."""
    found: dict[str, dict[Path, list[float]]] = {}
    for number in range(rounds):
        for group in groups:
            for checkout in (other, ROOT) if number % 2 == 0 else (ROOT, other):
                for name, value in measure(checkout, group).items():
                    found.setdefault(name, {other: [], ROOT: []})[checkout].append(value)
    table = Table("metric", "before", "after", "after / before", "unit", "goal")
    for name, values in found.items():
        before, after = (statistics.median(values[each]) if values[each] else None for each in (other, ROOT))
        ratio = "" if not before or after is None else f"{after / before:.2f}"
        shown = ["" if value is None else f"{value:.4g}" for value in (before, after)]
        table.add_row(name, *shown, ratio, *GOALS.get(name, ("", "")))
    Console(width=120).print(table)


def main() -> None:
    """Read the command line, check the other revision out, and compare."""
    parser = argparse.ArgumentParser(prog="benchmarks.compare")
    parser.add_argument("revision", help="commit to compare with")
    parser.add_argument("groups", nargs="*", help="groups to measure; default: all")
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="arcor2-hw-compare-") as folder:
        other = Path(folder) / "other"
        git = ("git", "-C", str(ROOT), "worktree")
        subprocess.run([*git, "add", "--quiet", "--detach", str(other), arguments.revision], check=True)
        try:
            write_metadata(other)
            compare(other, arguments.groups or list(GROUPS), arguments.rounds)
        finally:
            subprocess.run([*git, "remove", "--force", str(other)], check=True)


if __name__ == "__main__":
    main()
