"""Measure all metrics: JSON lines on standard output, a table on standard error (`make bench`).

`python -m benchmarks [--long] [GROUP ...]` measures the named groups, or all. `--long` increases the number of samples:
recovery 50 cycles (3 without it), stops 500 for each driver in a busy process (100), demo 5 runs (1), calibration 2,000
pictures of each kind (200), robot_pose 300 views (30). The group `parts` runs 10 seeds if it is named, otherwise one;
`--seeds`, `--boards` and `--faults` change this. The exit code is 1 if a group failed, or if a metric with the goal
"<= 0", which counts errors, misses it.
"""

import argparse
import asyncio
import sys
import tempfile
import traceback
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from benchmarks import (
    analysing,
    backup,
    building,
    buses,
    calibration,
    camera,
    computing,
    databases,
    demo,
    documents,
    dry_run,
    fleet,
    fleet_reports,
    history,
    kinematics,
    listeners,
    meshes,
    mqtt,
    nodes,
    opcua,
    operation,
    parts,
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
from benchmarks.parts import Size


@dataclass(frozen=True)
class Options:
    """The options of the command line."""

    long: bool = False
    parts: Size = field(default_factory=Size)


def measurements(options: Options) -> dict[str, Callable[[Report, Path], Awaitable[None]]]:
    """Return the measuring function of each group."""
    return {
        "requests": requests.run,
        "documents": documents.run,
        "databases": databases.run,
        "backup": backup.run,
        "restart": restart.run,
        "listeners": listeners.run,
        "operation": operation.run,
        "running": running.run,
        "building": lambda report, _: building.build(report),
        "analysing": lambda report, _: analysing.analyse(report),
        "robot": robot.run,
        "buses": buses.run,
        "opcua": opcua.run,
        "mqtt": mqtt.run,
        "history": history.run,
        "camera": camera.run,
        "calibration": lambda report, _: calibration.run(report, options.long),
        "robot_pose": lambda report, _: asyncio.to_thread(robot_pose.run, report, options.long),
        "computing": lambda report, _: computing.run(report),
        "meshes": lambda report, _: meshes.run(report),
        "unresponsive_devices": unresponsive_devices.run,
        "nodes": nodes.run,
        "fleet": fleet.run,
        "fleet_reports": lambda report, folder: asyncio.to_thread(fleet_reports.run, report, folder),
        "kinematics": lambda report, _: kinematics.run(report),
        "stops": lambda report, _: stops.run(report, options.long),
        "demo": lambda report, folder: demo.run(report, folder, options.long),
        "parts": lambda report, folder: parts.run(report, folder, options.parts),
        "dry_run": dry_run.run,
        "recorder": recorder.run,
        "recovery": lambda report, _: recovery.run(report, options.long),
    }


GROUPS: Final = tuple(measurements(Options()))


async def main(groups: list[str], options: Options) -> bool:
    """Measure the named groups, or all; return whether a group failed or a metric that counts errors is not 0."""
    report = Report()
    broken = False
    with tempfile.TemporaryDirectory(prefix="arcor2-hw-bench-", ignore_cleanup_errors=True) as name:
        for group, measure in measurements(options).items():
            if not groups or group in groups:
                try:
                    await measure(report, Path(name))
                except Exception:  # noqa: BLE001 - a failed group must not stop the others
                    broken = True
                    sys.stderr.write(f"Measuring group {group} failed:\n{traceback.format_exc()}")
    report.table()
    return broken or report.errors()


def arguments() -> tuple[list[str], Options]:
    """Return the named groups and the options of the command line."""
    parser = argparse.ArgumentParser(prog="benchmarks")
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=f"{', '.join(GROUPS)}; default: all")
    parser.add_argument("--long", action="store_true", help="take more samples")
    in_parts = parser.add_argument_group("group parts")
    in_parts.add_argument("--seeds", type=int, help=f"default: {parts.SEEDS} if the group is named, otherwise 1")
    in_parts.add_argument("--boards", type=int, default=parts.BOARDS, help="boards of a seed (%(default)s)")
    in_parts.add_argument("--faults", type=int, default=parts.FAULTS, help="faults of a seed (%(default)s)")
    parsed = parser.parse_args()
    if unknown := set(parsed.groups) - set(GROUPS):
        parser.error(f"Unknown group: {', '.join(sorted(unknown))}. Choose from: {', '.join(GROUPS)}.")
    seeds = parsed.seeds or (parts.SEEDS if parsed.long or "parts" in parsed.groups else 1)
    return parsed.groups, Options(parsed.long, Size(seeds, parsed.boards, parsed.faults))


if __name__ == "__main__":
    sys.exit(asyncio.run(main(*arguments())))
