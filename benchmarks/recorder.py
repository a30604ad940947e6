"""The recorder of the cell host: its share of a core while the demo runs, compared with runs without it."""

import asyncio
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import psutil

from benchmarks.metrics import Metric, Report, median

BOARDS: Final = 4
PAIRS, LONG_PAIRS = 2, 6
WINDOW: Final = 30.0
"""The last seconds of the program, which are measured, s. They have the same boards in each run."""
ENDS_WITHIN: Final = 400.0
PERIOD: Final = 0.1
HOST: Final = "arcor2_hw.runtime.host"


async def run(report: Report, folder: Path, long: bool) -> None:
    """Measure everything in this group."""
    shares: dict[bool, list[float]] = {True: [], False: []}
    pairs = LONG_PAIRS if long else PAIRS
    for number in range(2 * pairs):
        records = number % 4 in (0, 3)  # with, without, without, with: a slow drift of the machine cancels out
        shares[records].append(await _share(folder / f"recorder-{number}", records))
    cost = median(shares[True]) - median(shares[False])
    with_it, without = (", ".join(f"{each:.2f}" for each in shares[records]) for records in (True, False))
    report.add(Metric("recorder_core_percent", cost, pairs, f"host with it {with_it} %, without it {without} %"))


async def _share(directory: Path, records: bool) -> float:
    """Run the demo; return the processor time of the program's host per time, in percent of a core."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-c", f"from benchmarks.recorder import demo; demo({records})"),
        *("demo", "--once", "--port", "0", "--boards", str(BOARDS), "--seed", "1", "--data-dir", str(directory)),
        stdout=asyncio.subprocess.DEVNULL,
    )
    samples: dict[int, list[tuple[float, float]]] = {}
    try:
        async with asyncio.timeout(ENDS_WITHIN):
            while process.returncode is None:
                await asyncio.to_thread(_sample, process.pid, samples)
                await asyncio.sleep(PERIOD)
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()
    if process.returncode:
        raise RuntimeError("The demo failed.")
    # The host of the program has used the most time; the others opened the scene or waited.
    program = max(samples.values(), key=lambda each: each[-1][1])
    end, used = program[-1]
    start, before = next(each for each in program if each[0] >= end - WINDOW)
    return 100.0 * (used - before) / (end - start)


def _sample(pid: int, samples: dict[int, list[tuple[float, float]]]) -> None:
    """Add the processor times of all hosts."""
    try:
        children = psutil.Process(pid).children(recursive=True)
    except psutil.Error:
        return
    for child in children:
        try:
            if HOST in child.cmdline():
                times = child.cpu_times()
                samples.setdefault(child.pid, []).append((time.monotonic(), times.user + times.system))
        except psutil.Error:  # it has ended
            continue


def demo(records: bool) -> None:
    """Run the command line; without the recorder, hosts are started without a ring."""
    from arcor2_server.child_process import ChildProcess
    from arcor2_server.cli.main import main

    start = ChildProcess.start

    async def start_without_ring(
        command: Sequence[str], connection: Any, environment: Mapping[str, str], **_: Any
    ) -> ChildProcess:
        if "--ring" in command:
            command = command[: command.index("--ring")]
        return await start(command, connection, environment)

    if not records:
        ChildProcess.start = start_without_ring  # type: ignore[method-assign, assignment]
    main()
