"""Records of units: steps, results, destination of each part, state after a crash, and the time of the cell."""

import asyncio
import csv
import io
import os
import signal
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.calibration.records import CalibrationKind, CalibrationRecord
from arcor2_hw.data.project import ProjectParameter
from arcor2_hw.data.units import CellActivity, Effectiveness, UnitState
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.production.cell_time import CellTime, effectiveness
from arcor2_server.production.export import units_as_csv
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from arcor2_server.storage.units import UnitStore

from .production import SCRIPT, production
from .test_execution_history import subscribe

STEPS = ["scan", "pick", "insert", "test", "take", "into_box"]
SERIAL = {"name": "serial", "value": '"A-1"'}


async def test_a_run_yields_the_record_of_each_unit(tmp_path: Path) -> None:
    async with production(tmp_path) as cell:
        cell.package()
        calibration = CalibrationRecord(CalibrationKind.BY_HAND, "", "obj_camera", "camera", "world", "")
        await cell.services.units._calibrations.put(calibration)
        recipe = await cell.released_recipe(planned_rate=60.0)
        subscribe(cell.server, "UnitChanged")
        async with cell.services.units._describing:  # the unit leaves before its package is described
            await cell.ask("RunPackage", {"id": "pkg_1", "recipe_id": recipe.id, "order": "O-1"})
            gone = await cell.client.event("UnitChanged", lambda data: data["state"] != "in_cell")
        assert (gone["serial"], gone["state"], "steps" in gone) == ("A-1", "good", False)
        await cell.client.state("stopped", "PackageState")
        (unit,) = (await cell.ask("ListUnits", {})).units
        while not (record := await cell.ask("GetUnit", {"number": unit.number})).package_name:
            await asyncio.sleep(0.01)
        assert (record.serial, record.state, record.verdict, record.order) == ("A-1", UnitState.GOOD, True, "O-1")
        assert (record.recipe.revision, record.package_name, record.package_hash) == (1, "demo", recipe.package_hash)
        assert record.recipe.values == {}
        assert [(one.object_name, one.kind) for one in record.calibrations] == [("camera", "by_hand")]
        assert [step.name for step in record.steps] == STEPS
        assert [step.results for step in record.steps if step.name in ("scan", "test")] == [['"A-1"'], ["true"]]
        assert (record.runs, record.started_by, record.entered < record.left) == ([1], "alice", True)


async def test_units_are_found_by_serial_number_and_exported(tmp_path: Path) -> None:
    async with production(tmp_path) as cell:
        cell.package()
        failing = SCRIPT.replace('"A-1"', '"B_1"').replace("test(True", "test(False").partition("arm.pick(i")[0]
        cell.package("pkg_2", failing, [ProjectParameter("serial", "string", '"B_1"', id="prm_serial")])
        await cell.run()
        await cell.run("pkg_2", order="=1+1")
        for query, expected in (
            ({"serial": "A"}, ["A-1"]),
            ({"serial": "b"}, ["B_1"]),
            ({"serial": "_"}, []),
            ({"serial": "B_"}, ["B_1"]),
            ({"serial": "%"}, []),
            ({"run": 2}, ["B_1"]),
            ({"order": "=1+1"}, ["B_1"]),
            ({"state": "in_cell"}, ["B_1"]),
            ({"limit": 1}, ["B_1"]),
            ({"before": 2}, ["A-1"]),
            ({"since": "2000-01-01T00:00:00+00:00", "until": "2000-01-02T00:00:00+00:00"}, []),
        ):
            found = (await cell.ask("ListUnits", query)).units
            assert [unit.serial for unit in found] == expected, query
        lines = list(csv.DictReader(io.StringIO(units_as_csv((await cell.ask("ListUnits", {})).units).decode())))
        assert [(each["serial"], each["verdict"], each["order"]) for each in lines] == [
            ("B_1", "failed", "'=1+1"),
            ("A-1", "passed", ""),
        ]
        with pytest.raises(NotFound, match="no record of a unit with the number 7"):
            await cell.ask("GetUnit", {"number": 7})


async def test_a_unit_survives_the_end_of_the_program_and_of_the_server(tmp_path: Path) -> None:
    (tmp_path / "hang").touch()
    async with production(tmp_path) as cell:
        cell.package()
        recipe = await cell.released_recipe(values=[SERIAL])
        subscribe(cell.server, "PartsChanged")
        await cell.ask("RunPackage", {"id": "pkg_1", "on_error": "hold", "recipe_id": recipe.id, "order": "O-1"})
        await cell.client.event("PartsChanged", lambda data: data["parts"] and "moving_to" in data["parts"][0])
        os.kill(cell.services.execution._host.host.pid, signal.SIGKILL)
        await cell.client.state("stopped", "PackageState")
    (tmp_path / "hang").unlink()
    async with production(tmp_path) as cell:
        subscribe(cell.server, "PartsChanged", "Held")
        await cell.ask("ConfirmParts", {"scene_id": "scn_1", "parts": [{"number": 1, "place": "obj_arm"}]})
        await cell.ask("RunPackage", {"id": "pkg_1", "on_error": "hold", "continues": True})
        held = await cell.client.event("Held")
        await cell.ask("DecideHeld", {"number": held["number"], "choice": "skip"})
        await cell.client.state("stopped", "PackageState")
        (unit,) = (await cell.ask("ListUnits", {})).units
        record = await cell.ask("GetUnit", {"number": unit.number})
        assert (record.state, record.order, record.recipe.revision, record.runs) == (UnitState.GOOD, "O-1", 1, [1, 2])
        assert [step.name for step in record.steps if not isinstance(step.error, str)][-4:] == STEPS[2:]
        run = (await cell.ask("ListRuns", {})).runs[0]
        assert (run.recipe.id, run.order) == (recipe.id, "O-1")  # it continues with the recipe


async def test_a_part_that_a_person_takes_out_is_rejected(tmp_path: Path) -> None:
    async with production(tmp_path) as cell:
        cell.package(script=SCRIPT.partition("arm.pick(i")[0])
        await cell.run()
        await cell.ask("ConfirmParts", {"scene_id": "scn_1", "parts": [{"number": 1, "place": ""}]})
        (unit,) = (await cell.ask("ListUnits", {})).units
        assert (unit.serial, unit.state) == ("A-1", UnitState.REJECTED)


async def test_the_production_report_contains_times_counts_and_effectiveness(tmp_path: Path) -> None:
    async with production(tmp_path) as cell:
        cell.package()
        recipe = await cell.released_recipe(planned_rate=3600.0)
        await cell.run(recipe_id=recipe.id)
        found = await cell.ask("GetProduction", None)
        assert (found.counts.good, found.counts.bad, found.counts.in_cell) == (1, 0, 0)
        assert found.seconds[CellActivity.RUNNING] > 0.0
        assert sum(found.seconds.values()) == pytest.approx(8 * 3600.0, abs=0.1)
        assert found.seconds[CellActivity.OFF] > 7 * 3600.0
        assert found.effectiveness.quality == 1.0
        assert isinstance(found.effectiveness.oee, float)
        await cell.run()  # without a planned rate
        found = await cell.ask("GetProduction", {"since": found.since})
        assert not isinstance(found.effectiveness.oee, float)
        with pytest.raises(InvalidData, match="has to start before it ends"):
            await cell.ask("GetProduction", {"since": "2999-01-01T00:00:00+00:00"})


async def test_times_are_split_at_the_ends_of_a_period(tmp_path: Path) -> None:
    storage = await Storage.open(ServerSettings(data_dir=tmp_path))
    clock: dict[str, Any] = {"time": 1000.0, "activity": CellActivity.IDLE}
    times = CellTime(UnitStore(storage), lambda: clock["activity"], lambda: clock["time"])
    for time, activity in ((1010.0, CellActivity.RUNNING), (1040.0, CellActivity.HELD), (1050.0, CellActivity.IDLE)):
        clock.update(time=time, activity=activity)
        times.changed()
    clock["time"] = 1060.0
    args: Any = type("Period", (), {"since": "1970-01-01T00:17:00+00:00", "until": "1970-01-01T00:17:25+00:00"})
    found = await times.production(args)  # 1020 to 1045
    assert {key.value: value for key, value in found.seconds.items() if value} == {"running": 20.0, "held": 5.0}
    await times.close()
    await storage.close()


def test_effectiveness_is_availability_times_performance_times_quality() -> None:
    left = [(UnitState.GOOD, 120.0, 80), (UnitState.BAD, 120.0, 10), (UnitState.REJECTED, 60.0, 10)]
    # ISO 22400-2: 90 units at 30 s and 10 at 60 s are 3300 s of planned time.
    assert effectiveness(8000.0, 6000.0, left) == Effectiveness(0.75, 0.55, 0.8, 0.33)
    without = effectiveness(8000.0, 6000.0, [(UnitState.GOOD, None, 1)])
    assert without == Effectiveness(availability=0.75, quality=1.0)
    assert effectiveness(100.0, 0.0, []) == Effectiveness(availability=0.0)
