"""The history over REST: points of a device, their summary and values while rows are moved, and past runs."""

import csv
import io
from pathlib import Path

import httpx
import msgspec
import pytest

from arcor2_hw.data.device import Connection, Health
from arcor2_hw.data.editor import RunEnd
from arcor2_hw.data.events import Event
from arcor2_hw.data.points import LivePoint, ObjectPointsData, PointUse
from arcor2_hw.runtime.messages import DeviceChanged, StreamEvent
from arcor2_server.app import Server, running_server
from arcor2_server.execution.runs import RunStart
from arcor2_server.settings import ServerSettings
from tests.runtime.conftest import scene_object
from tests.server.rest.rest_client import granted, rest_client


def report(server: Server, value: float | str) -> None:
    """Let the host of the scene report the point of a device."""
    points = ObjectPointsData("obj_oven", 1.0, [LivePoint("temperature", PointUse.INPUT, value, "°C")])
    encoded = msgspec.json.encode(Event("ObjectPoints", data=points))
    server.scene_host.streams.publish(StreamEvent("ObjectPoints", "obj_oven", encoded, 10.0))


async def test_points_and_runs_are_read_before_and_after_they_are_moved(tmp_path: Path) -> None:
    clock = [1_760_000_000.0]
    settings = ServerSettings(data_dir=tmp_path, point_history=True, point_history_interval=0.1)
    async with running_server(settings) as server, rest_client(server) as http:
        server.history._clock = lambda: clock[0]
        board = server.scene_host.board
        board.show([scene_object("oven", "Oven")], {})
        board.changed(DeviceChanged("obj_oven", Connection.ONLINE, Health.NORMAL))
        for value in (20.0, 80.0, 50.0):
            report(server, value)
            clock[0] += 60.0
        board.clear()
        server.runs.end(server.runs.begin("pkg_1", RunStart(by="ann"), temporary=False), RunEnd.FINISHED)

        (point,) = granted(await http.get("/api/history/points", params={"object_id": "obj_oven"}))
        assert (point["object_name"], point["name"], point["unit"], point["digital"]) == (
            "oven", "temperature", "°C", False,
        )  # fmt: skip
        period = {"point": point["number"], "since": "2025-10-09T08:50:00Z", "until": "2025-10-09T09:10:00Z"}
        answers = []
        for moved in (False, True):
            if moved:
                clock[0] += 4000.0
                await server.history.maintain()
            answers.append(
                [
                    granted(await http.get("/api/history/summary", params={**period, "buckets": 1})),
                    granted(await http.get("/api/history/values", params=period)),
                ]
            )
        assert answers[0] == answers[1]
        summary, values = answers[0]
        assert (summary["lowest"], summary["highest"], summary["mean"]) == ([20.0], [80.0], [50.0])
        assert values["values"] == [20.0, 80.0, 50.0, None]
        exported = await http.get("/api/history/values/export", params=period)
        rows = list(csv.DictReader(io.StringIO(exported.text)))
        assert (rows[1]["value"], rows[1]["quality"], rows[3]["value"]) == ("80.0", "good", "")
        ever = {"since": "2025-01-01T00:00:00Z", "until": "2099-01-01T00:00:00Z"}
        (past,) = granted(await http.get("/api/history/runs", params=ever))
        assert (past["package_id"], past["end"], past["started_by"]) == ("pkg_1", "finished", "ann")
        exported = await http.get("/api/history/runs/export", params=ever)
        assert exported.headers["content-type"].startswith("text/csv")
        state = granted(await http.get("/api/history"))
        assert (state["recording"], state["files"], state["rows"]) == (True, 1, 4)

        for refused in ({"point": 99}, {**period, "until": period["since"]}, {"point": 1, "buckets": 9999}):
            assert (await http.get("/api/history/summary", params=refused)).status_code in (400, 404)


@pytest.mark.asyncio(loop_scope="module")
async def test_a_server_without_history_refuses_queries(http: httpx.AsyncClient) -> None:
    assert granted(await http.get("/api/history"))["recording"] is False
    answer = await http.get("/api/history/points")
    assert (answer.status_code, "--history" in answer.text) == (409, True)
