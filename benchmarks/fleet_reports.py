"""The views of stored results, with as many units as the server of the fleet stores, and 100,000 alarms."""

import random
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import msgspec
from msgspec.structs import replace

from arcor2_hw.data.alarms import AlarmCategory, AlarmRecord, Priority
from arcor2_hw.data.recipes import RecipeState, UsedRecipe
from arcor2_hw.data.units import UnitRecord, UnitState
from arcor2_server.fleet.columns import columns_of
from arcor2_server.fleet.file import FILE, MAX_RESULTS, FleetFile, ReceivedResult
from arcor2_server.fleet.reports import FleetReports, Period
from benchmarks.fleet_cells import PROGRAMS, name_of
from benchmarks.metrics import Metric, Report, percentile
from tests.server.fleet.cells import unit

CELLS: Final = 50
ALARMS: Final = 100_000
SPAN: Final = 7 * 86400
"""Time in which all results were made, s."""
REPEATED: Final = 9
_BATCH: Final = 20_000


def fill(path: Path, units: int = MAX_RESULTS - ALARMS, alarms: int = ALARMS) -> None:
    """Store units and alarms of the last 7 days. Some 3 % of the units are bad."""
    file, chance, end = FleetFile(path), random.Random(1), time.time()
    total = units + alarms
    every = total // alarms if alarms else total + 1
    batch: list[ReceivedResult] = []
    for number in range(total):
        at = time.strftime("%Y-%m-%dT%H:%M:%S+00:00", time.gmtime(end - SPAN * (1 - number / total)))
        cell = number % CELLS
        if number % every == every - 1:
            kind, document = "alarm", msgspec.json.encode(_alarm(number, chance.randrange(CELLS), at, chance))
        else:
            kind, document = "unit", msgspec.json.encode(_unit(number, cell, at, chance))
        stamp = int((end - SPAN * (1 - number / total)) * 1e6)
        columns = columns_of(kind, stamp, document)
        batch.append(ReceivedResult(name_of(cell), f"{cell:032x}", kind, number, at, stamp, document, columns))
        if len(batch) == _BATCH:
            file.put_results(batch)
            batch.clear()
    file.put_results(batch)
    file.close()


def _unit(number: int, cell: int, at: str, chance: random.Random) -> UnitRecord:
    state = UnitState.GOOD if chance.random() > 0.03 else chance.choice((UnitState.BAD, UnitState.REJECTED))
    record = unit(number, 1, state)
    steps = [replace(record.steps[0], results=["true" if state is UnitState.GOOD else "false"])]
    recipe = UsedRecipe(f"rcp_{number % 4}", f"PCB-{number % 4}", 1, RecipeState.RELEASED, "")
    program = PROGRAMS[cell % len(PROGRAMS)]
    return replace(record, entered=at, left=at, steps=steps, recipe=recipe, package_name=program)


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
        "search": lambda: reports.find_units("900123", "", None, 50),
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
