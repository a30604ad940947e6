"""Build and Execution over REST: build and import a package; run, pause and stop it."""

import asyncio
import io
import json
import os
import time
import zipfile
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest

from arcor2_hw.client import Client
from arcor2_hw.data.base import Unset
from tests import commands
from tests.server.core.serving import RawConnection, ServerProcess, running, talking
from tests.server.rest.rest_client import granted, refused

COUNT = """
import time
from arcor2_hw.actions import action
from arcor2_hw.objects import Generic


class Counter(Generic):
    _ABSTRACT = False

    @action
    def count(self, *, an: str | None = None) -> None:
        time.sleep(0.02)
"""
CRATE = """
from arcor2_hw.objects import CollisionObject


class Crate(CollisionObject):
    _ABSTRACT = False
"""
CRATE_OBJECT = {"name": "crate", "type": "Crate", "id": "obj_k", "pose": {"position": {"x": 2, "y": 0, "z": 0}}}
OBJECT = {"name": "counter", "type": "Counter", "id": "obj_c"}
SCENE = {"id": "scn_c", "name": "count scene", "objects": [OBJECT, CRATE_OBJECT]}
PROJECT = {
    "id": "pro_c",
    "name": "count ß",
    "description": "counts",
    "sceneId": "scn_c",
    "actionPoints": [
        {
            "name": "point",
            "id": "acp_1",
            "position": {"x": 0, "y": 0, "z": 0},
            "actions": [{"name": "one", "id": "act_1", "type": "obj_c/count", "flows": [{}]}],
        }
    ],
    "logic": [
        {"id": "lit_1", "start": "START", "end": "act_1"},
        {"id": "lit_2", "start": "act_1", "end": "END"},
    ],
}


def base(server: ServerProcess) -> str:
    return server.url.replace("ws://", "http://")


async def prepare(http: httpx.AsyncClient) -> None:
    granted(await http.put("/object-types", json={"id": "Counter", "name": "Counter", "source": COUNT}))
    granted(await http.put("/models/box", json={"id": "Crate", "sizeX": 1, "sizeY": 1, "sizeZ": 1}))
    crate = {"id": "Crate", "name": "Crate", "source": CRATE, "model": {"id": "Crate", "type": "Box"}}
    granted(await http.put("/object-types", json=crate))
    granted(await http.put("/scenes", json=SCENE))
    granted(await http.put("/projects", json=PROJECT))


async def published(http: httpx.AsyncClient, **more: Any) -> bytes:
    answer = await http.get("/project/publish", params={"projectId": "pro_c"} | more)
    assert (answer.status_code, answer.headers["content-type"]) == (200, "application/zip"), answer.text
    return answer.content


def as_file(content: bytes) -> dict[str, Any]:
    return {"executionPackage": ("package.zip", content, "application/zip")}


async def until_state(http: httpx.AsyncClient, *wanted: str) -> dict[str, Any]:
    async with asyncio.timeout(20):
        while True:
            info: dict[str, Any] = granted(await http.get("/packages/state"))
            if info["state"] in wanted:
                return info
            await asyncio.sleep(0.02)


async def until_obstacles(http: httpx.AsyncClient, wanted: list[str]) -> None:
    async with asyncio.timeout(20):
        while granted(await http.get("/collisions")) != wanted:
            await asyncio.sleep(0.02)


async def next_of(talker: RawConnection, name: str, **data: Any) -> dict[str, Any]:
    """Return the next event with this name and content; skip others."""
    async with asyncio.timeout(20):
        while True:
            message = talker.events.pop(0) if talker.events else await talker.receive()
            if message.get("event") == name and data.items() <= message["data"].items():
                return message


async def test_a_project_is_built_and_imported_again(server: ServerProcess) -> None:
    async with httpx.AsyncClient(timeout=60, base_url=base(server)) as http:
        refused(await http.get("/project/publish", params={"projectId": "none"}), 404, "NotFound", "none")
        refused(await http.get("/project/publish"), 400, "Argument", "projectId")
        await prepare(http)
        answer = await http.get("/project/publish", params={"projectId": "pro_c", "packageName": "ö"})
        assert answer.headers["content-disposition"] == "attachment; filename*=UTF-8''%C3%B6_package.zip"
        with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
            assert {"script.py", "object_types/counter.py", "data/project.json"} <= set(archive.namelist())
            assert b"\xc3\xb6" in archive.read("package.json")
        package = answer.content

        # The published project equals the saved one: there is nothing to overwrite.
        assert granted(await http.put("/project/import", files=as_file(package))) == {
            "sceneId": "scn_c",
            "projectId": "pro_c",
        }
        granted(await http.put("/scenes", json=SCENE | {"description": "other"}))
        granted(await http.put("/projects", json=PROJECT | {"description": "other"}))
        message = refused(await http.put("/project/import", files=as_file(package)), 409, "Conflict", "overwriteScene")
        assert "overwriteProject" in message
        only_scene = {"overwriteScene": "true"}
        refused(await http.put("/project/import", params=only_scene, files=as_file(package)), 409, "Conflict")
        assert granted(await http.get("/scenes/scn_c"))["description"] == "other", "all or nothing"
        both = only_scene | {"overwriteProject": "true"}
        granted(await http.put("/project/import", params=both, files=as_file(package)))
        assert granted(await http.get("/scenes/scn_c"))["description"] == ""
        assert granted(await http.get("/projects/pro_c"))["description"] == "counts"

        for path in ("/projects/pro_c", "/scenes/scn_c", "/object-types/Counter"):
            granted(await http.delete(path))
        granted(await http.put("/project/import", files=as_file(package)))
        stored = granted(await http.get("/projects/pro_c"))
        assert [point["actions"][0]["name"] for point in stored["actionPoints"]] == ["one"]
        assert granted(await http.get("/object-types/Counter"))["source"] == COUNT
        for bad in (b"", b"no zip", package[:200]):
            refused(await http.put("/project/import", files=as_file(bad)), 400, "InvalidPackage")
        refused(
            await http.put("/project/import", params={"overwriteScene": "2"}, files=as_file(package)), 400, "Argument"
        )


async def test_a_package_is_uploaded_downloaded_and_deleted(server: ServerProcess) -> None:
    async with httpx.AsyncClient(timeout=60, base_url=base(server)) as http, talking(server.url) as talker:
        await prepare(http)
        package = await published(http, packageName="count it")
        granted(await http.post("/packages/pkg_a", files=as_file(package)))
        event = await next_of(talker, "PackageChanged", id="pkg_a")
        assert event["change_type"] == "add"
        (listed,) = [one for one in granted(await http.get("/packages")) if one["id"] == "pkg_a"]
        assert listed == {
            "id": "pkg_a",
            "name": "count it",
            "created": listed["created"],
            "project": {"id": "pro_c", "name": "count ß", "description": "counts"},
        }
        answer = await http.get("/packages/pkg_a")
        assert answer.headers["content-type"] == "application/zip"
        with zipfile.ZipFile(io.BytesIO(answer.content)) as back, zipfile.ZipFile(io.BytesIO(package)) as sent:
            assert {name: back.read(name) for name in back.namelist()} == {
                name: sent.read(name) for name in sent.namelist()
            }

        granted(await http.put("/packages/pkg_a/breakpoints", params={"breakpoints": ["acp_1", "acp_2", "acp_1"]}))
        assert granted(await http.get("/packages/pkg_a/breakpoints")) == ["acp_1", "acp_2"]
        granted(await http.delete("/packages/pkg_a"))
        event = await next_of(talker, "PackageChanged", id="pkg_a")
        assert event["change_type"] == "remove"
        for refusal in (
            await http.get("/packages/pkg_a"),
            await http.delete("/packages/pkg_a"),
            await http.get("/packages/pkg_a/breakpoints"),
            await http.put("/packages/pkg_a/breakpoints", params={"breakpoints": ["acp_1"]}),
            await http.put("/packages/pkg_a/start"),
            await http.put("/packages/pkg_a/debug"),
        ):
            refused(refusal, 404, "NotFound", "pkg_a")
        granted(await http.post("/packages/pkg_a", files=as_file(package)))
        assert granted(await http.get("/packages/pkg_a/breakpoints")) == [], "they were deleted with the old package"

        for bad in (b"no zip", zipped({"readme.txt": b""}), zipped({"../script.py": b""})):
            refused(await http.post("/packages/pkg_b", files=as_file(bad)), 400, "InvalidPackage")
        for key in ("..", "a%2Fb", ".hidden", "%00"):
            assert (await http.post(f"/packages/{key}", files=as_file(package))).status_code in (400, 404, 405)
        assert [one["id"] for one in granted(await http.get("/packages"))] == ["pkg_a"]


def zipped(files: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()


async def test_a_program_is_run_paused_stepped_and_stopped(server: ServerProcess, tmp_path: Path) -> None:
    async with httpx.AsyncClient(timeout=60, base_url=base(server)) as http:
        await prepare(http)
        granted(await http.post("/packages/pkg_r", files=as_file(await published(http))))
        for command in ("stop", "pause", "resume", "step"):
            refused(await http.put(f"/packages/{command}"), 409, "PackageRunState")
        granted(await http.put("/packages/pkg_r/start"))
        info = await until_state(http, "Running")
        assert info["activePackageId"] == "pkg_r"
        # Objects in the program's scene are obstacles as long as it runs.
        await until_obstacles(http, ["obj_k"])
        line = {"pt1": {"x": 0, "y": 0, "z": 0}, "pt2": {"x": 5, "y": 0, "z": 0}}
        assert granted(await http.put("/utils/line-safe", json=line)) == {"safe": False, "object_id": "obj_k"}
        refused(await http.put("/packages/pkg_r/start"), 409, "PackageRunState")
        refused(await http.delete("/packages/pkg_r"), 409, "PackageRunState")
        refused(await http.post("/packages/pkg_r", files=as_file(await published(http))), 409, "PackageRunState")
        granted(await http.put("/packages/pause"))
        await until_state(http, "Paused")
        granted(await http.put("/packages/step"))
        await until_state(http, "Paused")
        granted(await http.put("/packages/resume"))
        await until_state(http, "Running")
        granted(await http.put("/packages/stop"))
        await until_obstacles(http, [])
        assert await until_state(http, "Completed") == {"state": "Completed", "activePackageId": "pkg_r"}
        (listed,) = [one for one in granted(await http.get("/packages")) if one["id"] == "pkg_r"]
        assert listed["executed"] > listed["created"]

        granted(await http.put("/packages/pkg_r/debug", params={"breakOnFirstAction": "true"}))
        await until_state(http, "Paused")
        granted(await http.put("/packages/stop"))
        await until_state(http, "Completed")
        # A point that is not in the project: the program cannot start.
        granted(await http.put("/packages/pkg_r/breakpoints", params={"breakpoints": "acp_nowhere"}))
        granted(await http.put("/packages/pkg_r/debug"))
        info = await until_state(http, "Faulted")
        assert "acp_nowhere" in info["exceptionMessage"]

        # With onError=hold, a failed action pauses the program instead of ending it.
        failing = COUNT.replace("time.sleep(0.02)", 'raise RuntimeError("no board")')
        granted(await http.put("/object-types", json={"id": "Counter", "name": "Counter", "source": failing}))
        granted(await http.post("/packages/pkg_h", files=as_file(await published(http))))
        refused(await http.put("/packages/pkg_h/start", params={"onError": "wait"}), 400, "Argument")
        for command in ("start", "debug"):
            granted(await http.put(f"/packages/pkg_h/{command}", params={"onError": "hold"}))
            await until_state(http, "Paused")
            granted(await http.put("/packages/stop"))
            await until_state(http, "Completed")
        granted(await http.put("/packages/pkg_h/start"))
        await until_state(http, "Faulted")

        # Each run has its user and its result.
        runs = granted(await http.get("/api/runs", params={"package_id": "pkg_r", "limit": 2}))
        assert [(run["end"], run["start_paused"], run["project_id"]) for run in runs] == [
            ("failed", False, "pro_c"),
            ("stopped", True, "pro_c"),
        ]
        assert runs[0]["error"] == info["exceptionMessage"]
        older = granted(await http.get("/api/runs", params={"before": runs[-1]["number"]}))
        assert (older[0]["end"], older[0]["last_action"]["id"]) == ("stopped", "act_1")
        assert older[0]["actions"] >= 1
        assert granted(await http.get("/api/runs", params={"projectId": "pro_none"})) == []
        refused(await http.get("/api/runs", params={"limit": 501}), 400, "Argument", "limit")
        # The trace shows when each device executed which action.
        path = f"/api/runs/{older[0]['number']}"
        trace = granted(await http.get(path + "/trace"))
        span = trace["spans"][0]
        assert (span["action_id"], span["start"], trace["omitted"]) == ("act_1", 0, 0)
        (device,) = trace["devices"]
        assert (device["id"], device["busy"]) == (
            span["device"],
            pytest.approx(sum(one["duration"] for one in trace["spans"])),
        )
        summary = granted(await http.get(path + "/summary"))
        assert summary["devices"][0]["id"] == device["id"]
        exported = await http.get(path + "/chrome-trace")
        assert "attachment" in exported.headers["Content-Disposition"]
        assert span["name"] in [event["name"] for event in exported.json()["traceEvents"]]
        for unknown in ("0", "-1", "x", "9" * 30):
            refused(await http.get(f"/api/runs/{unknown}/trace"), 404, "NotFound")
    printed = await package_command(server, "trace", str(older[0]["number"]))
    assert span["name"] in printed[1]
    assert any(line.startswith("cycle: ") for line in printed)
    assert any(f"{device['name']}: busy" in line for line in printed)
    compared = await package_command(server, "compare", str(older[0]["number"]), str(older[0]["number"]))
    assert span["name"] in compared[1]
    assert "+0.000 s" in compared[1]
    file = tmp_path / "run.json"
    assert await package_command(server, "trace", str(older[0]["number"]), "--output", str(file)) == []
    assert json.loads(file.read_bytes()) == exported.json()
    newest, older, *_ = (await package_command(server, "runs", "pkg_r"))[1:]
    assert "failed" in newest
    assert "acp_nowhere" in newest
    assert "stopped" in older
    assert await package_command(server, "runs", "pkg_none") == ["There are no runs."]


async def package_command(server: ServerProcess, *arguments: str) -> list[str]:
    """Return the output of `arcor2-hw package`, for a terminal that is wide enough."""
    words = ("package", *arguments, "--url", server.url)
    done = await asyncio.to_thread(commands.run, commands.CLI, *words, env=os.environ | {"COLUMNS": "400"})
    assert done.returncode == 0
    return done.stdout.splitlines()


async def test_an_upload_of_a_hundred_megabytes_does_not_block_others(server: ServerProcess) -> None:
    mesh = bytes(100_000_000)
    content = zipped({"script.py": b"", "data/mesh.bin": mesh})  # not compressed
    async with httpx.AsyncClient(base_url=base(server), timeout=60) as http:
        # In a thread, because building a body of that size takes time.
        url = base(server) + "/packages/pkg_big"
        follower = Client(server.url)
        await follower.open()
        await follower.subscribe_events({"TaskState"})
        upload = asyncio.create_task(asyncio.to_thread(httpx.post, url, files=as_file(content), timeout=60))
        process = psutil.Process(server.process.pid)
        slowest, before, peak = 0.0, process.memory_info().rss, 0
        while not upload.done():
            started = time.monotonic()
            granted(await http.get("/packages/state"))
            slowest = max(slowest, time.monotonic() - started)
            peak = max(peak, process.memory_info().rss)
            await asyncio.sleep(0.02)
        granted(upload.result())
        assert slowest < 20.0
        assert peak - before < 40_000_000, "received data are written to the disk at once"
        states = await _upload_states(follower)
        assert {one.title for one in states} == {"Uploading the package pkg_big"}
        shares = [one.progress for one in states if not isinstance(one.progress, Unset)]
        assert shares == sorted(shares)
        assert len([share for share in shares if 0.05 < share < 0.9]) >= 2, "progress follows the received data"
        assert (states[-1].state, states[-1].progress) == ("finished", 1.0)
        # The task of a refused upload fails with the reason.
        answer = await http.post("/packages/pkg_bad", files=as_file(b"no zip"))
        assert answer.status_code == 400
        states = await _upload_states(follower)
        assert (states[-1].state, states[-1].message) == ("failed", answer.json()["message"])
        # A client that disconnects cancels the upload.
        _, writer = await asyncio.open_connection(*base(server).removeprefix("http://").split(":"))
        writer.write(
            b"POST /packages/pkg_cut HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5000000\r\n"
            b"Content-Type: multipart/form-data; boundary=cut\r\n\r\n--cut\r\n"
            b'Content-Disposition: form-data; name="executionPackage"; filename="a.zip"\r\n\r\n' + bytes(1_000_000)
        )
        await writer.drain()
        assert (await follower.next_event("TaskState", timeout=60)).data.state == "running"
        writer.close()
        await writer.wait_closed()
        states = await _upload_states(follower)
        assert states[-1].state == "cancelled"
        assert "disconnected" in states[-1].message
        await follower.close()
        with zipfile.ZipFile(io.BytesIO((await http.get("/packages/pkg_big")).content)) as back:
            assert back.getinfo("data/mesh.bin").file_size == len(mesh)
        granted(await http.delete("/packages/pkg_big"))


async def _upload_states(follower: Client) -> list[Any]:
    """Return the states of a task until it ends."""
    states: list[Any] = []
    while not states or states[-1].state == "running":
        states.append((await follower.next_event("TaskState", timeout=60)).data)
    return states


async def test_tokens_are_managed_over_rest(server: ServerProcess) -> None:
    async with httpx.AsyncClient(timeout=60, base_url=base(server)) as http:
        assert granted(await http.get("/tokens")) == []
        token = granted(await http.post("/tokens/create", params={"name": "line 1"}))
        assert (token["name"], token["access"]) == ("line 1", False)
        path = f"/tokens/{token['id']}"
        granted(await http.put(f"{path}/access", params={"access": "true"}))
        assert granted(await http.get(f"{path}/access")) is True
        assert granted(await http.get("/tokens")) == [token | {"access": True}]
        refused(await http.put(f"{path}/access"), 400, "Argument", "access")
        refused(await http.post("/tokens/create", params={"name": ""}), 400, "Argument")
        granted(await http.delete(path))
        for refusal in (
            await http.delete(path),
            await http.get(f"{path}/access"),
            await http.put(f"{path}/access", params={"access": "true"}),
        ):
            refused(refusal, 404, "NotFound")


PICTURE = {"image": ("picture.jpg", b"\xff\xd8\xff", "image/jpeg")}
CAMERA: dict[str, Any] = {"fx": 1, "fy": 1, "cx": 1, "cy": 1, "distCoefs": [0, 0, 0, 0, 0]}


@pytest.mark.parametrize("path", ["/calibrate/camera", "/markers/corners"])
async def test_calibration_refuses_data_that_is_not_a_picture(server: ServerProcess, path: str) -> None:
    async with httpx.AsyncClient(base_url=base(server), timeout=30.0) as http:
        if path == "/calibrate/camera":
            refused(await http.put(path, params=CAMERA, files=PICTURE), 404, "NotFound", "No markers are configured")
            marker = {"marker_id": 7, "pose": {}}
            granted(await http.put("/api/calibration/markers", json={"markers": [marker]}))
        refused(await http.put(path, params=CAMERA, files=PICTURE), 400, "Argument", "picture")
        refused(await http.put(path, params=CAMERA | {"distCoefs": [0]}, files=PICTURE), 400, "Argument", "distCoefs")
        refused(await http.put(path, params={"fx": 1}, files=PICTURE), 400, "Argument")
        refused(await http.put(path, params=CAMERA), 415, "Argument")


async def test_calibration_of_a_robot_needs_its_model(server: ServerProcess) -> None:
    async with httpx.AsyncClient(base_url=base(server), timeout=30.0) as http:
        args = (
            '{"robotJoints": [{"name": "j1", "value": 1}], "robotPose": {}, "cameraPose": {}, "urdfUri": "arm.zip",'
            ' "cameraParameters": {"fx": 1, "fy": 1, "cx": 1, "cy": 1, "distCoefs": [0, 0, 0, 0]}}'
        )
        refused(await http.put("/calibrate/robot", files=PICTURE, data={"args": args}), 404, "NotFound", "arm.zip")
        granted(await http.post("/assets", params={"id": "arm.zip"}, files={"assetData": ("arm.zip", b"PK no zip")}))
        refused(await http.put("/calibrate/robot", files=PICTURE, data={"args": args}), 400, "Argument", "depth image")
        as_a_file = PICTURE | {"args": ("args.json", args.encode(), "application/json")}
        refused(await http.put("/calibrate/robot", files=as_a_file), 400, "Argument", "depth image")
        by_address = args.replace("arm.zip", "http://127.0.0.1:10000/assets/arm.zip/data")
        refused(await http.put("/calibrate/robot", files=PICTURE, data={"args": by_address}), 400, "Argument")
        refused(await http.put("/calibrate/robot", files=PICTURE), 400, "Argument", "args")
        refused(await http.put("/calibrate/robot", files=PICTURE, data={"args": "{}"}), 400, "Argument", "robotJoints")


async def test_tokens_breakpoints_and_assets_survive_a_restart(tmp_path: Any) -> None:
    async with running(tmp_path / "data") as first, httpx.AsyncClient(timeout=60, base_url=base(first)) as http:
        await prepare(http)
        token = granted(await http.post("/tokens/create", params={"name": "x"}))
        granted(await http.post("/packages/pkg_a", files=as_file(await published(http))))
        granted(await http.put("/packages/pkg_a/breakpoints", params={"breakpoints": "acp_1"}))
        granted(await http.post("/assets?id=chair", files={"assetData": ("chair.stl", b"solid")}))
    async with running(tmp_path / "data") as second, httpx.AsyncClient(timeout=60, base_url=base(second)) as http:
        assert granted(await http.get("/tokens")) == [token]
        assert granted(await http.get("/packages/pkg_a/breakpoints")) == ["acp_1"]
        assert (await http.get("/assets/chair/data")).content == b"solid"
        assert [one["id"] for one in granted(await http.get("/object-types"))] == ["Counter", "Crate"]
