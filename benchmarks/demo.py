"""The demo on a busy computer: `arcor2-hw demo --once` next to computing processes, without raised priorities."""

import asyncio
import ctypes
import resource
import sys
import tempfile
from pathlib import Path
from typing import Final

from benchmarks.metrics import Metric, Report

BUSY: Final = 8
"""Number of processes that compute continuously."""
RUNS, LONG_RUNS = 1, 5
BOARDS: Final = 5
END_TIMEOUT: Final = 400.0
_PR_CAPBSET_DROP, _CAP_SYS_NICE = 24, 23


def _without_priority() -> None:
    """Prevent the started process and its children from raising their priority, even as root."""
    ctypes.CDLL(None).prctl(_PR_CAPBSET_DROP, _CAP_SYS_NICE, 0, 0, 0)
    resource.setrlimit(resource.RLIMIT_NICE, (0, 0))


async def _demo(folder: Path) -> str:
    """Run the demo; return the end of its output if it failed, otherwise an empty string."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "arcor2_server.cli.main", "demo", "--once", "--port", "0"),
        *("--boards", str(BOARDS), "--data-dir", str(folder)),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
        preexec_fn=_without_priority,
    )
    try:
        output, _ = await asyncio.wait_for(process.communicate(), END_TIMEOUT)
    except TimeoutError:
        process.terminate()
        await process.wait()
        return f"did not end within {END_TIMEOUT:g} s"
    return "" if process.returncode == 0 else " ".join(output.decode().split()[-40:])


async def run(report: Report, folder: Path, long: bool) -> None:
    """Measure everything in this group."""
    runs = LONG_RUNS if long else RUNS
    busy = [
        await asyncio.create_subprocess_exec(sys.executable, "-c", "while True: pass", start_new_session=True)
        for _ in range(BUSY)
    ]
    try:
        problems = [await _demo(Path(tempfile.mkdtemp(dir=folder))) for _ in range(runs)]
    finally:
        for process in busy:
            process.kill()
            await process.wait()
    failed = [problem for problem in problems if problem]
    report.add(Metric("busy_demo_completed", 100.0 * (runs - len(failed)) / runs, runs, "; ".join(failed)))
