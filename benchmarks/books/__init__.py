"""The books of parts under faults: the demo cell with random faults, and an operator who resolves each of them.

The truth is that of the simulated world and of the simulated planning service, never that of the books. The operator
sends only the requests that the operator's screen sends, and acts at the simulated cell by hand: removes a cause, takes
a board out, opens a door.
"""

import asyncio
import sys
import time
from pathlib import Path

from benchmarks.books.checks import Result
from benchmarks.books.trial import Trial
from benchmarks.metrics import Metric, Report

SEEDS, LONG_SEEDS = 1, 10
BOARDS, FAULTS = 20, 50


async def run(report: Report, folder: Path, long: bool) -> None:
    """Measure everything in this group."""
    seeds = range(1, (LONG_SEEDS if long else SEEDS) + 1)
    results = [await trial(folder / f"books-{seed}", seed, BOARDS, FAULTS) for seed in seeds]
    found = "; ".join(problem for result in results for problem in result.problems())
    n = len(results)
    report.add(Metric("books_unaccounted", sum(len(each.unaccounted) for each in results), n, found))
    report.add(Metric("books_results_not_once", sum(len(each.not_once) for each in results), n))
    report.add(Metric("books_moved_alone", sum(len(each.moved) for each in results), n))
    report.add(Metric("books_unresolved", sum(len(each.unresolved) for each in results), n))


async def trial(folder: Path, seed: int, boards: int, faults: int) -> Result:
    """Run one seed; its log is on standard error."""
    await asyncio.to_thread(folder.mkdir, parents=True)
    began = time.monotonic()

    def say(text: str) -> None:
        sys.stderr.write(f"{time.monotonic() - began:7.2f} {text}\n")

    return await Trial(folder, seed, boards, faults, say).run()
