"""Restart of a killed server with a large open project, next to busy processes; first ListProjects after a start."""

import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from benchmarks import server_process
from benchmarks.documents import Author
from benchmarks.metrics import Metric, Report, median, percentile

ACTIONS: Final = 1000
"""Actions in the project that is open when the server is killed."""
UNSAVED: Final = 100
"""Number of these actions that are only in the journal."""
PROJECTS: Final = 200
ROUNDS: Final = 12
BUSY: Final = (2, 8)


@contextlib.contextmanager
def busy(processes: int) -> Iterator[None]:
    """Run processes that compute continuously."""
    running = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"], start_new_session=True)  # as a separate service
        for _ in range(processes)
    ]
    try:
        yield
    finally:
        for process in running:
            process.kill()
        for process in running:
            process.wait()


async def fill(directory: Path) -> None:
    """Save many projects, and leave a large one open with unsaved edits."""
    async with server_process.server(directory) as (url, _), server_process.socket(url) as socket:
        author = Author(socket)
        scene = await author.scene()
        await author.ask("CloseScene")
        small, point = await author.project(scene, "small")
        await author.actions(point, range(10))
        await author.ask("SaveProject")
        await author.ask("CloseProject")
        for number in range(PROJECTS - 2):
            await author.ask("CopyProject", source_id=small, target_name=f"copy {number}")
        _, point = await author.project(scene, "large")
        await author.actions(point, range(ACTIONS - UNSAVED))
        await author.ask("SaveProject")
        await author.actions(point, range(ACTIONS - UNSAVED, ACTIONS))


async def start_and_kill(directory: Path) -> float:
    """Return the time from starting the server until a client has the open project, s; then kill the server."""
    begin = time.perf_counter()
    async with server_process.server(directory) as (url, process):
        async with server_process.socket(url) as socket:
            await socket.send(json.dumps({"id": 1, "request": "RegisterUser", "args": {"user_name": "bench"}}))
            while '"OpenProject"' not in str(await socket.recv())[:200]:
                pass
            taken = time.perf_counter() - begin
        process.kill()
    return taken


async def run(report: Report, directory: Path) -> None:
    """Measure everything in this group."""
    data = directory / "restart"
    await fill(data)
    for processes in BUSY:
        with busy(processes):
            samples = [await start_and_kill(data) for _ in range(ROUNDS)]
        note = f"median {median(samples):.2f} s, worst {max(samples):.2f} s"
        report.add(Metric(f"restart_{processes}_busy_p95_s", percentile(samples, 95), ROUNDS, note))
    first, second = [], []
    for _ in range(5):
        async with server_process.server(data) as (url, _process), server_process.socket(url) as socket:
            author = Author(socket)
            first.append(await author.timed("ListProjects"))
            second.append(await author.timed("ListProjects"))
    note = f"second {median(second) * 1e3:.2f} ms"
    report.add(Metric("list_projects_200_first_ms", median(first) * 1e3, len(first), note))
