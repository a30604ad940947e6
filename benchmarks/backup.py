"""Backups of a server that is saving: duration of saves during a backup, and speed of the backup."""

import asyncio
import random
import sys
import time
from pathlib import Path

from benchmarks import server_process
from benchmarks.documents import Author
from benchmarks.metrics import Metric, Report, median

FILES, FILE_SIZE = 40, 5 * 1024 * 1024
"""Files of random bytes, such as meshes and pictures: 200 MiB."""
BACKUPS = 3
SAVES = 100


async def run(report: Report, folder: Path) -> None:
    """Measure saves of a project of 1,000 actions with and without a backup at the same time."""
    data = folder / "backup"
    files = data / "device-files"
    files.mkdir(parents=True)
    for number in range(FILES):
        (files / str(number)).write_bytes(random.Random(number).randbytes(FILE_SIZE))
    async with server_process.server(data) as (url, _), server_process.socket(url) as socket:
        author = Author(socket)
        project, point = await author.project(await author.scene(), "large")
        await author.actions(point, range(1_000))
        alone = [await _save(author, project, number) for number in range(SAVES)]
        meanwhile: list[float] = []
        durations: list[float] = []
        for number in range(BACKUPS):
            begin = time.perf_counter()
            command = [sys.executable, "-m", "arcor2_server.cli.main", "backup", str(folder / f"{number}.zip")]
            backup = await asyncio.create_subprocess_exec(
                *command, "--data-dir", str(data), stdout=asyncio.subprocess.DEVNULL
            )
            ended = asyncio.create_task(backup.wait())
            while not ended.done():
                meanwhile.append(await _save(author, project, len(meanwhile)))
            assert await ended == 0
            durations.append(time.perf_counter() - begin)
            (folder / f"{number}.zip").unlink()
    added = (max(meanwhile) - median(alone)) * 1e3
    note = f"slowest save during {BACKUPS} backups minus the median of {SAVES} without, {median(alone) * 1e3:.1f} ms"
    report.add(Metric("backup_save_delay_ms", added, len(meanwhile), note))
    report.add(Metric("backup_s", median(durations), BACKUPS, f"{FILES * FILE_SIZE >> 20} MiB of random bytes"))


async def _save(author: Author, project: str, number: int) -> float:
    """Edit and save the project; return the duration of the save, s."""
    await author.ask("UpdateProjectDescription", project_id=project, new_description=str(number))
    return await author.timed("SaveProject")
