"""The part inventory under faults: the demo cell with random faults, and an operator who resolves each of them.

The truth is that of the simulated world and of the simulated planning service, never the inventory. The operator
sends only the requests that the operator's screen sends, and acts at the simulated cell by hand: removes a cause, takes
a board out, opens a door.
"""

import asyncio
import os
import shutil
import sys
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from benchmarks.metrics import Metric, Report
from benchmarks.parts.checks import Result
from benchmarks.parts.trial import Trial

SEEDS: Final = 10
BOARDS: Final = 20
FAULTS: Final = 50


@dataclass(frozen=True)
class Size:
    """Number of seeds, and size of the run of each seed."""

    seeds: int = SEEDS
    boards: int = BOARDS
    faults: int = FAULTS


async def run(report: Report, folder: Path, size: Size) -> None:
    """Measure everything in this group: one seed at a time on each core.

    Raises:
        RuntimeError: a seed did not end. The others are measured and reported.
    """
    free = asyncio.Semaphore(len(os.sched_getaffinity(0)))
    results: list[Result] = []
    broken: list[int] = []

    async def measure(seed: int) -> None:
        async with free:
            began, to = time.monotonic(), folder / f"inventory-{seed}"
            try:
                result = await trial(to, seed, size.boards, size.faults)
            except Exception:  # noqa: BLE001 - the other seeds are measured
                broken.append(seed)
                sys.stderr.write(f"Seed {seed} failed:\n{traceback.format_exc()}")
            else:
                results.append(result)
                took = time.monotonic() - began
                sys.stderr.write(
                    f"Seed {seed} took {took:.0f} s: {result.faults.total()} faults, {result.kills} kills, "
                    f"{result.holds} decisions, {len(result.problems())} problems. "
                    f"{len(results) + len(broken)} of {size.seeds} seeds are done.\n"
                )
            await asyncio.to_thread(shutil.rmtree, to, ignore_errors=True)

    async with asyncio.TaskGroup() as seeds:
        for seed in range(1, size.seeds + 1):
            seeds.create_task(measure(seed))
    if results:
        _report(report, results)
    if broken:
        raise RuntimeError(f"These seeds did not end: {', '.join(map(str, sorted(broken)))}.")


def _report(report: Report, results: list[Result]) -> None:
    n = len(results)
    faults = sum(result.faults.total() for result in results)
    kills, decisions = sum(result.kills for result in results), sum(result.holds for result in results)
    note = f"{faults} faults, {kills} of them kills; {decisions} decisions"
    found = "; ".join([note, *(problem for result in results for problem in result.problems())])
    report.add(Metric("parts_unaccounted", sum(len(each.unaccounted) for each in results), n, found))
    report.add(Metric("parts_results_not_once", sum(len(each.not_once) for each in results), n))
    report.add(Metric("parts_moved_alone", sum(len(each.moved) for each in results), n))
    report.add(Metric("parts_unresolved", sum(len(each.unresolved) for each in results), n))


async def trial(folder: Path, seed: int, boards: int, faults: int) -> Result:
    """Run one seed; its log is on standard error."""
    await asyncio.to_thread(folder.mkdir, parents=True)
    began = time.monotonic()

    def say(text: str) -> None:
        sys.stderr.write(f"{seed:3} {time.monotonic() - began:7.2f} {text}\n")

    return await Trial(folder, seed, boards, faults, say).run()
