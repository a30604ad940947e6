"""The fleet: 50 cells on one page, a dead cell, and 10,000 results of a site without a connection."""

import asyncio
import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

import httpx
from playwright.async_api import CDPSession, Page, expect

from benchmarks.fleet_cells import name_of
from benchmarks.metrics import Metric, Report, percentile
from tests.editor.screen import chromium, running_browser
from tests.server.fleet.cells import unit
from tests.server.fleet.test_results import FleetProcess, two_sites
from tests.server.nodes.conftest import Broker

CELLS: Final = 50
OBSERVED: Final = 20.0
"""Time in which processor time is measured, s."""
CHANGES: Final = 20
DEATHS: Final = 5
RESULTS: Final = 10_000
PER_WRITE: Final = 100
"""Number of units that are stored in one transaction of the cell."""
WITHIN: Final = 300.0
_CHANGED: Final = """([name, part]) => {
  const read = () => {
    const cards = [...document.querySelectorAll(".fleet-card")];
    const card = cards.find((each) => each.querySelector(".fleet-name").textContent === name);
    return part === "level" ? card.dataset.level : card.querySelector(".fleet-facts").textContent;
  };
  const before = read();
  document.documentElement.dataset.waits = "";
  return new Promise((resolve) => {
    const check = () => {
      if (read() === before) return requestAnimationFrame(check);
      delete document.documentElement.dataset.waits;
      resolve();
    };
    check();
  });
}"""
"""Resolves when the text or the level on the card of a cell changes."""
_TICKS: Final = os.sysconf("SC_CLK_TCK")


class Cells:
    """A process with light cells."""

    def __init__(self, url: str) -> None:
        command = [sys.executable, "-m", "benchmarks.fleet_cells", url, str(CELLS)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == "ready\n"

    def ask(self, command: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{command}\n")
        self.process.stdin.flush()

    def end(self) -> None:
        self.process.kill()
        self.process.communicate()


def processor_time(pid: int) -> float:
    """Return the processor time of a process, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


async def _page(report: Report, fleet: FleetProcess, broker: Broker, cells: Cells) -> None:
    async with running_browser() as browser:
        page = await browser.new_page(viewport={"width": 1920, "height": 1080})
        begin = time.perf_counter()
        await page.goto(fleet.url)
        await expect(page.locator(".fleet-card")).to_have_count(CELLS)
        report.add(Metric("fleet_page_ms", (time.perf_counter() - begin) * 1e3, 1, f"{CELLS} cells, first visit"))
        measured = {"server": fleet.process.pid, "broker": broker.process.pid}
        before = {name: processor_time(pid) for name, pid in measured.items()}
        session = await page.context.new_cdp_session(page)
        await session.send("Performance.enable")
        tasks = await _task_duration(session)
        await asyncio.sleep(OBSERVED)
        for name, pid in measured.items():
            used = (processor_time(pid) - before[name]) / OBSERVED * 100
            report.add(Metric(f"fleet_{name}_core_percent", used, 1, f"{CELLS} cells, one page"))
        drawn = (await _task_duration(session) - tasks) / OBSERVED * 100
        report.add(Metric("fleet_page_core_percent", drawn, 1, "main thread of the page"))

        # Cells whose states the benchmark changes; the states of the other cells change by themselves.
        ready = [44, *range(40, 44)]
        durations = []
        for number in range(CHANGES):
            cell = ready[number % len(ready)]
            durations.append(await _until(page, cell, partial(cells.ask, f"change {cell}"), "good"))
        note = f"median {percentile(durations, 50) * 1e3:.0f} ms"
        report.add(Metric("fleet_update_p95_ms", percentile(durations, 95) * 1e3, CHANGES, note))
        deaths = [await _until(page, cell, partial(cells.ask, f"die {cell}"), "level") for cell in range(DEATHS)]
        report.add(Metric("fleet_dead_cell_s", max(deaths), DEATHS, "the longest, until the card is grey"))


async def _task_duration(session: CDPSession) -> float:
    """Return the time for which the main thread of the page has worked, s."""
    metrics = {each["name"]: each["value"] for each in (await session.send("Performance.getMetrics"))["metrics"]}
    return float(metrics["TaskDuration"])


async def _until(page: Page, cell: int, act: Callable[[], None], part: str) -> float:
    """Return the time from an action until the card of a cell shows another text or level, s."""
    changed = asyncio.create_task(page.evaluate(_CHANGED, [name_of(cell), part]))
    await expect(page.locator("html[data-waits]")).to_be_attached()
    begin = time.perf_counter()
    act()
    await changed
    return time.perf_counter() - begin


async def _results(report: Report, folder: Path) -> None:
    async with two_sites(folder) as (cell, link, site, fleet):
        await cell.units.put([unit(1)])
        await _wait(lambda: _count(fleet), 1)
        await link.cut()
        site.kill()
        begin = time.perf_counter()
        for first in range(2, RESULTS + 1, PER_WRITE):
            await cell.units.put([unit(number) for number in range(first, min(first + PER_WRITE, RESULTS + 1))])
        note = f"{await cell.outbox.count()} wait in the database of the cell"
        report.add(Metric("fleet_results_queued_s", time.perf_counter() - begin, RESULTS, note))
        begin = time.perf_counter()
        site.start()
        await cell.sent(WITHIN)
        report.add(
            Metric("fleet_results_at_site_s", time.perf_counter() - begin, RESULTS, "from the start of its broker")
        )
        fleet.kill()
        fleet.start()
        begin = time.perf_counter()
        await link.heal()
        await asyncio.sleep(1.0)
        fleet.kill()  # while results arrive
        fleet.start()
        await _wait(lambda: _count(fleet), RESULTS)
        report.add(
            Metric("fleet_results_arrived_s", time.perf_counter() - begin, RESULTS, "the server was killed once")
        )
        numbers = await asyncio.to_thread(_numbers, fleet)
        report.add(Metric("fleet_results_lost", len(set(range(1, RESULTS + 1)) - set(numbers)), RESULTS))
        report.add(Metric("fleet_results_doubled", len(numbers) - len(set(numbers)), RESULTS))


def _count(fleet: FleetProcess) -> int:
    newest = httpx.get(f"{fleet.url}/api/fleet/results", params={"limit": 1}, timeout=30).json()
    return int(newest[0]["id"]) if newest else 0


def _numbers(fleet: FleetProcess) -> list[int]:
    numbers: list[int] = []
    before = 0
    while found := httpx.get(
        f"{fleet.url}/api/fleet/results", params={"limit": 1000, "before": before}, timeout=30
    ).json():
        numbers += [each["record"]["number"] for each in found]
        before = found[-1]["id"]
    return numbers


async def _wait(read: Callable[[], int], expected: int) -> None:
    async with asyncio.timeout(WITHIN):
        while await asyncio.to_thread(read) < expected:  # noqa: ASYNC110 (another process counts)
            await asyncio.sleep(0.2)


async def run(report: Report, directory: Path) -> None:
    """Measure everything in this group. The page needs Chromium."""
    folder = directory / "fleet"
    folder.mkdir()
    broker = Broker(folder, options=("--jetstream", "--store_dir", str(folder / "store")))
    fleet = FleetProcess(broker.url, folder / "data")
    cells = Cells(broker.url)
    try:
        chromium()
        await _page(report, fleet, broker, cells)
    except FileNotFoundError as reason:
        print(reason, file=sys.stderr)
    finally:
        cells.end()
        fleet.kill()
        broker.end()
    results = folder / "results"
    results.mkdir()
    await _results(report, results)
