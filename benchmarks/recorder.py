"""The recorder of the cell host: its processor time while the demo runs."""

import asyncio
import os
import sys
from pathlib import Path
from typing import Final

from benchmarks.metrics import Metric, Report

BOARDS: Final = 4
WINDOW: Final = 30.0
"""The last seconds of the program, which are measured, s."""
END_TIMEOUT: Final = 400.0
MEASURED_HOST: Final = ("-P", str(Path(__file__).with_name("recorder_host.py")))


async def run(report: Report, folder: Path) -> None:
    """Measure everything in this group."""
    times = folder / "recorder-times"
    times.mkdir()
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-c", "from benchmarks.recorder import demo; demo()"),
        *("demo", "--once", "--port", "0", "--boards", str(BOARDS), "--seed", "1"),
        *("--data-dir", str(folder / "recorder")),
        env=os.environ | {"ARCOR2_HW_RECORDER_TIMES": str(times)},
        stdout=asyncio.subprocess.DEVNULL,
    )
    try:
        async with asyncio.timeout(END_TIMEOUT):
            await process.wait()
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    if process.returncode:
        raise RuntimeError("The demo failed.")
    # The host of the program has recorded the most values; the other hosts opened the scene or waited.
    hosts = [[tuple(map(float, line.split())) for line in file.read_text().splitlines()] for file in times.iterdir()]
    if not hosts:
        raise RuntimeError("No host has recorded anything.")
    program = max(hosts, key=lambda lines: lines[-1][1])
    end, used, reading, process_time = program[-1]
    start, used_before, reading_before, process_before = next(line for line in program if line[0] >= end - WINDOW)
    cost, own, whole = (
        100.0 * value / (end - start)
        for value in (used - used_before, reading - reading_before, process_time - process_before)
    )
    note = f"the whole host uses {whole:.1f} %; reading the clock, {own:.3f} %, is subtracted"
    report.add(Metric("recorder_core_percent", cost - own, 1, note))


def demo() -> None:
    """Run the command line; the server of the demo runs this module in a separate process."""
    from arcor2_server.cli.main import main
    from arcor2_server.demo import run as demo_run
    from arcor2_server.demo.processes import python_module

    def replaced(name: str, *arguments: str) -> list[str]:
        return python_module(__name__ if name == "arcor2_server.cli.main" else name, *arguments)

    vars(demo_run)["python_module"] = replaced
    main()


def serve() -> None:
    """Run the command line; a server starts hosts that measure their recorder."""
    from arcor2_server.cli.main import main
    from arcor2_server.hosts import process

    process.COMMAND = MEASURED_HOST  # type: ignore[misc, assignment]
    main()


if __name__ == "__main__":
    serve()
