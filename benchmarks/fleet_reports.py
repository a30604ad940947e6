"""The views of stored results, with as many units as the server of the fleet stores, and 100,000 alarms."""

import contextlib
import functools
import os
import random
import sqlite3
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import msgspec
from msgspec.structs import replace

from arcor2_hw.data.alarms import AlarmCategory, AlarmRecord, Priority
from arcor2_hw.data.recipes import RecipeState, UsedRecipe
from arcor2_hw.data.units import UnitState
from arcor2_server.fleet.columns import COUNT_ALL, INDEX_ALL, PUT_RESULT, columns_of
from arcor2_server.fleet.file import FILE, MAX_RESULTS, FleetFile
from arcor2_server.fleet.reports import FleetReports, Period
from arcor2_server.fleet.summaries import Columns
from benchmarks.fleet_cells import PROGRAMS, name_of
from benchmarks.metrics import Metric, Report, percentile
from tests.server.fleet.cells import unit

CELLS: Final = 50
ALARMS: Final = 100_000
SPAN: Final = 7 * 86400
"""Time in which all results were made, s."""
REPEATED: Final = 9
FOUND: Final = "900123"
"""Part of the serial number of one unit."""


def fill(path: Path, units: int = MAX_RESULTS - ALARMS, alarms: int = ALARMS) -> None:
    """Store units and alarms of the last 7 days. Some 3 % of the units are bad.

    Counts and the index for searching are filled afterwards, as in a file of an older version.
    """
    FleetFile(path).close()
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as connection:
        for setting in ("journal_mode=off", "synchronous=off", "cache_size=-65536"):
            connection.execute(f"pragma {setting}")
        triggers = connection.execute("select name, sql from sqlite_master where type = 'trigger'").fetchall()
        connection.execute("begin")
        for name, _ in triggers:
            connection.execute(f"drop trigger {name}")
        connection.executemany(PUT_RESULT, _rows(units, alarms))
        for statement in (COUNT_ALL, INDEX_ALL, *(sql for _, sql in triggers)):
            connection.execute(statement)
        connection.execute("commit")
        connection.execute("pragma journal_mode=wal")


def _rows(units: int, alarms: int) -> Iterator[tuple[object, ...]]:
    """Yield the results of `fill` as rows of its table."""
    chance, end, total = random.Random(1), time.time(), units + alarms
    every = total // alarms if alarms else total + 1
    for number in range(total):
        seconds = end - SPAN * (1 - number / total)
        at, stamp = time.strftime("%Y-%m-%dT%H:%M:%S+00:00", time.gmtime(seconds)), int(seconds * 1e6)
        cell = number % CELLS
        if number % every == every - 1:
            kind, document = "alarm", msgspec.json.encode(_alarm(number, chance.randrange(CELLS), at, chance))
            columns = columns_of(kind, stamp, document)
        else:
            state = UnitState.GOOD if chance.random() > 0.03 else chance.choice((UnitState.BAD, UnitState.REJECTED))
            kind, (document, columns) = "unit", _unit(number, cell, state, at)
            columns = columns._replace(at=int(seconds))
        yield name_of(cell), f"{cell:032x}", kind, number, at, stamp, document, *columns


def _unit(number: int, cell: int, state: UnitState, at: str) -> tuple[bytes, Columns]:
    """Return the record of a unit and its columns except the time. Encoding each one would take a minute."""
    document, columns = _template(cell, state, number % 4)
    values = {b"number": number, b"at": at.encode()}
    return document % values, columns._replace(label=f"SN-{number:06}", summary=columns.summary % values)


@functools.cache
def _template(cell: int, state: UnitState, product: int) -> tuple[bytes, Columns]:
    number, at = 987_654_321, "2001-01-01T00:00:00+00:00"
    record = unit(number, 1, state)
    steps = [replace(record.steps[0], results=["true" if state is UnitState.GOOD else "false"])]
    recipe = UsedRecipe(f"rcp_{product}", f"PCB-{product}", 1, RecipeState.RELEASED, "")
    program = PROGRAMS[cell % len(PROGRAMS)]
    record = replace(record, entered=at, left=at, steps=steps, recipe=recipe, package_name=program)

    def marked(text: bytes) -> bytes:
        text = text.replace(b"%", b"%%").replace(b"SN-%d" % number, b"SN-%(number)06d")
        return text.replace(b"%d" % number, b"%(number)d").replace(at.encode(), b"%(at)s")

    document = msgspec.json.encode(record)
    columns = columns_of("unit", 0, document)
    return marked(document), columns._replace(summary=marked(columns.summary))


TEXTS: Final = (
    "The gripper found no part.",
    "The door was opened.",
    "The feeder is empty.",
    "No answer from the camera.",
)


def _alarm(number: int, cell: int, at: str, chance: random.Random) -> AlarmRecord:
    which = min(int(chance.expovariate(1.0)), len(TEXTS) - 1)
    return AlarmRecord(
        number, f"device-{which}", f"fault_{which}", chance.choice(list(Priority)), AlarmCategory.DEVICE, TEXTS[which],
        at, number, object_id=f"obj_{cell}", object_name=("Gripper", "Guard", "Feeder", "Camera")[which],
        active=False, cleared=at[:17] + "59+00:00",
    )  # fmt: skip


def run(report: Report, directory: Path) -> None:
    """Measure the queries of the views over all stored results."""
    path = directory / FILE
    fill(path)
    reports = FleetReports(path)
    present = int(time.time())
    week = Period(present - SPAN - 3600, present + 3600)
    of_cell = Period(week.since, week.until, name_of(3))
    queries: dict[str, Callable[[], object]] = {
        "production": lambda: reports.production(week),
        "bad_units": lambda: reports.bad_units(week, None, 50),
        "bad_units_of_cell": lambda: reports.bad_units(of_cell, None, 50),
        "search": lambda: reports.find_units(FOUND, "", None, 50),
        "search_in_cell": lambda: reports.find_units(FOUND, name_of(int(FOUND) % CELLS), None, 50),
        "alarms": lambda: reports.alarms(week, None, 50),
        "causes": lambda: reports.causes(week),
    }
    for name, query in queries.items():
        walls, used = [], []
        for _ in range(REPEATED):
            begin, before = time.perf_counter(), time.thread_time()
            query()
            walls.append((time.perf_counter() - begin) * 1e3)
            used.append((time.thread_time() - before) * 1e3)
        note = f"processor time {percentile(used, 50):.1f} ms"
        report.add(Metric(f"fleet_{name}_ms", percentile(walls, 50), REPEATED, note))
    reports.close()
    for name, cell in (("search", ""), ("search_in_cell", name_of(int(FOUND) % CELLS))):
        walls = [_first_search(path, cell) for _ in range(REPEATED)]
        report.add(Metric(f"fleet_{name}_cold_ms", percentile(walls, 50), REPEATED, f"longest {max(walls):.0f} ms"))


def _first_search(path: Path, cell: str) -> float:
    """Return the duration of a search if no part of the file is in memory, ms."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    with contextlib.closing(FleetReports(path)) as reports:
        begin = time.perf_counter()
        assert len(reports.find_units(FOUND, cell, None, 50)) == 1
        return (time.perf_counter() - begin) * 1e3
