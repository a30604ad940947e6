"""Measure all metrics: JSON lines on standard output, a table on standard error (`make bench`).

`python -m benchmarks [--long] [GROUP ...]` measures the named groups, or all. `--long` increases the number of samples:
recovery 50 cycles (3 without it), recorder 6 pairs of runs (2), stops 500 for each driver in a busy process (100), demo
5 runs (1), books 10 seeds (1), calibration 2,000 pictures of each kind (200), robot_pose 300 views (30).
"""

import asyncio
import sys
import tempfile
import traceback
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Final

from benchmarks import (
    analysing,
    backup,
    books,
    building,
    buses,
    calibration,
    camera,
    computing,
    demo,
    documents,
    dry_run,
    kinematics,
    listeners,
    meshes,
    operation,
    recorder,
    recovery,
    requests,
    restart,
    robot,
    robot_pose,
    running,
    stops,
    unresponsive_devices,
)
from benchmarks.metrics import Report

LONG: Final = "--long"
GROUPS: Final[dict[str, Callable[[Report, Path], Awaitable[None]]]] = {
    "requests": requests.run,
    "documents": documents.run,
    "backup": backup.run,
    "restart": restart.run,
    "listeners": listeners.run,
    "operation": operation.run,
    "running": running.run,
    "building": lambda report, _: building.build(report),
    "analysing": lambda report, _: analysing.analyse(report),
    "robot": robot.run,
    "buses": buses.run,
    "camera": camera.run,
    "calibration": lambda report, _: calibration.run(report, LONG in sys.argv),
    "robot_pose": lambda report, _: asyncio.to_thread(robot_pose.run, report, LONG in sys.argv),
    "computing": lambda report, _: computing.run(report),
    "meshes": lambda report, _: meshes.run(report),
    "unresponsive_devices": unresponsive_devices.run,
    "kinematics": lambda report, _: kinematics.run(report),
    "stops": lambda report, _: stops.run(report, LONG in sys.argv),
    "demo": lambda report, folder: demo.run(report, folder, LONG in sys.argv),
    "books": lambda report, folder: books.run(report, folder, LONG in sys.argv),
    "dry_run": dry_run.run,
    "recorder": lambda report, folder: recorder.run(report, folder, LONG in sys.argv),
    "recovery": lambda report, _: recovery.run(report, LONG in sys.argv),
}


async def main(groups: list[str]) -> int:
    """Measure the named groups, or all; return the number of groups that failed."""
    report = Report()
    broken = 0
    with tempfile.TemporaryDirectory(prefix="arcor2-hw-bench-", ignore_cleanup_errors=True) as name:
        for group, measure in GROUPS.items():
            if not groups or group in groups:
                try:
                    await measure(report, Path(name))
                except Exception:  # noqa: BLE001 - a failed group must not stop the others
                    broken += 1
                    sys.stderr.write(f"Measuring group {group} failed:\n{traceback.format_exc()}")
    report.table()
    return broken


if __name__ == "__main__":
    named = [argument for argument in sys.argv[1:] if argument != LONG]
    if unknown := set(named) - set(GROUPS):
        sys.exit(f"Unknown group: {', '.join(sorted(unknown))}. Choose from: {', '.join(GROUPS)}.")
    sys.exit(1 if asyncio.run(main(named)) else 0)
