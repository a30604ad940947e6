"""Records of units over REST: search by serial number, export as CSV, steps and calibrations."""

import csv
import io

import httpx
import pytest
from msgspec.structs import replace

from arcor2_hw.data.units import UnitRecord, UnitState, UnitStep, UsedCalibration
from arcor2_server.app import Server
from arcor2_server.storage.units import UnitStore
from tests.server.rest.rest_client import granted

pytestmark = pytest.mark.asyncio(loop_scope="module")

AT = "2026-01-01T08:00:00.000000+00:00"
STEP = UnitStep(1, 3, "act_test", "test", AT, 1.5, results=["true"])
CAMERA = UsedCalibration("cal_1", "obj_camera", "camera", "camera_pose", AT)
GOOD = UnitRecord(
    1, "A-1", "scn_1", 1, UnitState.GOOD, AT, AT, True, "O-1", runs=[1], steps=[STEP], calibrations=[CAMERA]
)


async def test_units_are_found_exported_and_read(http: httpx.AsyncClient, services: Server) -> None:
    bad = replace(GOOD, number=2, serial="B-2", part=2, state=UnitState.BAD, verdict=False, steps=[], calibrations=[])
    await UnitStore(services.storage).put([GOOD, bad])
    assert [one["serial"] for one in granted(await http.get("/api/units"))] == ["B-2", "A-1"]
    (found,) = granted(await http.get("/api/units", params={"serial": "a-"}))
    assert (found["serial"], found["state"], "steps" in found) == ("A-1", "good", False)
    exported = await http.get("/api/units/export", params={"state": "bad"})
    assert exported.headers["content-type"].startswith("text/csv")
    assert [(row["serial"], row["verdict"]) for row in csv.DictReader(io.StringIO(exported.text))] == [
        ("B-2", "failed")
    ]
    record = granted(await http.get("/api/units/1"))
    assert [(step["name"], step["results"]) for step in record["steps"]] == [("test", ["true"])]
    assert [(one["object_name"], one["id"]) for one in record["calibrations"]] == [("camera", "cal_1")]
    for number in ("7", "first"):
        answer = await http.get(f"/api/units/{number}")
        assert (answer.status_code, "no record of a unit" in answer.text) == (404, True)
