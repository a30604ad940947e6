"""`make bench`: all figures, as JSON lines on standard output and a table on standard error.

`python -m benchmarks [--long] [ROOM ...]`: all rooms, or those named. `--long` is for recovery (50 cycles, not 3), for
stops (500 for each driver in a busy process, not 100), for demo (5 runs, not 1), for calibration (2,000 pictures of
each kind, not 200) and for robot_pose (300 views, not 30).
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
    building,
    buses,
    calibration,
    camera,
    computing,
    demo,
    documents,
    hung,
    kinematics,
    listeners,
    meshes,
    operation,
    recovery,
    requests,
    restart,
    robot,
    robot_pose,
    running,
    stops,
)
from benchmarks.figures import Report

LONG: Final = "--long"
ROOMS: Final[dict[str, Callable[[Report, Path], Awaitable[None]]]] = {
    "requests": requests.run,
    "documents": documents.run,
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
    "hung": hung.run,
    "kinematics": lambda report, _: kinematics.run(report),
    "stops": lambda report, _: stops.run(report, LONG in sys.argv),
    "demo": lambda report, folder: demo.run(report, folder, LONG in sys.argv),
    "recovery": lambda report, _: recovery.run(report, LONG in sys.argv),
}


async def main(rooms: list[str]) -> int:
    """Measure the named rooms, or all; give how many could not be measured to the end."""
    report = Report()
    broken = 0
    with tempfile.TemporaryDirectory(prefix="arcor2-hw-bench-", ignore_cleanup_errors=True) as name:
        for room, measure in ROOMS.items():
            if not rooms or room in rooms:
                try:
                    await measure(report, Path(name))
                except Exception:  # noqa: BLE001 - the other rooms are measured all the same
                    broken += 1
                    sys.stderr.write(f"the room {room} could not be measured:\n{traceback.format_exc()}")
    report.table()
    return broken


if __name__ == "__main__":
    named = [argument for argument in sys.argv[1:] if argument != LONG]
    if unknown := set(named) - set(ROOMS):
        sys.exit(f"no room {', '.join(sorted(unknown))}; there are {', '.join(ROOMS)}")
    sys.exit(1 if asyncio.run(main(named)) else 0)
