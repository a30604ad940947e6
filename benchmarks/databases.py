"""Saving a project on SQLite and on PostgreSQL, both flushing to the same disk, in turn."""

import contextlib
import os
import statistics
import tempfile
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Final

from sqlalchemy import URL

from arcor2_server.settings import DATABASE_URL
from benchmarks import server_process
from benchmarks.documents import Author
from benchmarks.metrics import Metric, Report
from tests import postgresql

ACTIONS: Final = 100
SAVES: Final = 500
WARM_UP: Final = 20


@contextlib.contextmanager
def database() -> Iterator[str]:
    """Start a PostgreSQL server that flushes to the disk; yield the URL of an empty database."""
    with tempfile.TemporaryDirectory(prefix="arcor2-hw-bench-postgresql-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        url = URL.create("postgresql+psycopg", "hub", query={"host": name})
        postgresql.start(folder, os.getpid(), postgresql.DURABLE)
        try:
            postgresql.execute(
                "CREATE DATABASE bench TEMPLATE template0 ENCODING 'UTF8' LOCALE 'C.UTF-8'",
                url.set(database="postgres"),
            )
            yield url.set(database="bench").render_as_string(hide_password=False)
        finally:
            postgresql.stop(folder)


@contextlib.asynccontextmanager
async def author_on(directory: Path, database_url: str) -> AsyncIterator[Author]:
    """Run a server with a database; yield a client that has opened a saved project."""
    async with contextlib.AsyncExitStack() as stack:
        if database_url:
            os.environ[DATABASE_URL] = database_url
        try:
            url, _ = await stack.enter_async_context(server_process.server(directory))
        finally:
            os.environ.pop(DATABASE_URL, None)
        author = Author(await stack.enter_async_context(server_process.socket(url)))
        scene = await author.scene()
        await author.ask("CloseScene")
        author.opened, point = await author.project(scene, "large")
        await author.actions(point, range(ACTIONS))
        await author.ask("SaveProject")
        yield author


async def run(report: Report, folder: Path) -> None:
    """Run the group."""
    with database() as url:
        async with (
            author_on(folder / "save-sqlite", "") as on_sqlite,
            author_on(folder / "save-postgresql", url) as on_postgresql,
        ):
            took: dict[str, list[float]] = {"sqlite": [], "postgresql": []}
            for number in range(WARM_UP + SAVES):
                for name, author in (("sqlite", on_sqlite), ("postgresql", on_postgresql)):
                    await author.ask("UpdateProjectDescription", project_id=author.opened, new_description=str(number))
                    took[name].append(1e3 * await author.timed("SaveProject"))
    for name, samples in took.items():
        measured = samples[WARM_UP:]
        note = f"SaveProject of {ACTIONS} actions after an edit"
        report.add(Metric(f"save_{name}_ms", statistics.median(measured), SAVES, note))
        report.add(Metric(f"save_{name}_p99_ms", statistics.quantiles(measured, n=100)[98], SAVES))
