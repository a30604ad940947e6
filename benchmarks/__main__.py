"""`make bench`: all figures, as JSON lines on standard output and a table on standard error."""

import asyncio
import sys
import tempfile
from pathlib import Path

from benchmarks import building, buses, camera, hung, operation, requests, robot
from benchmarks.figures import Report


async def main(rooms: list[str]) -> None:
    """Measure the named rooms, or all."""
    report = Report()
    with tempfile.TemporaryDirectory(prefix="arcor2-hw-bench-", ignore_cleanup_errors=True) as name:
        directory = Path(name)
        if not rooms or "requests" in rooms:
            await requests.run(report, directory)
        if not rooms or "operation" in rooms:
            await operation.run(report, directory)
        if not rooms or "building" in rooms:
            await building.build(report)
        if not rooms or "robot" in rooms:
            await robot.run(report, directory)
        if not rooms or "buses" in rooms:
            await buses.run(report, directory)
        if not rooms or "camera" in rooms:
            await camera.run(report, directory)
        if not rooms or "hung" in rooms:
            await hung.run(report, directory)
    report.table()


asyncio.run(main(sys.argv[1:]))
