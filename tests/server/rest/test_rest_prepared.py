"""Display meshes over REST: they are converted once, cached and announced; invalid names are refused."""

import asyncio
import contextlib
import os
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import pytest_asyncio
import trimesh

from arcor2_hw.collision.description import StoredFile
from arcor2_hw.compute.mesh_tasks import CONVERSION, PrepareAsset
from arcor2_hw.compute.task import ComputeStopped
from arcor2_hw.data.editor import TaskKind
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message
from arcor2_server.app import Server
from arcor2_server.collaboration.tasks import Task
from arcor2_server.workspace import display_models as prepared_module
from tests.server.rest.rest_client import granted, refused

pytestmark = pytest.mark.asyncio(loop_scope="module")

BALL = trimesh.creation.icosphere(subdivisions=5, radius=0.05).export(file_type="stl")
assert isinstance(BALL, bytes)
SHOWN = "/api/assets/{}/shown"


@pytest_asyncio.fixture(autouse=True, scope="module", loop_scope="module")
async def worker(services: Server) -> None:
    """Start the mesh worker before the tests."""
    with contextlib.suppress(InvalidData):
        await services.compute.run(PrepareAsset(StoredFile("/nonexistent", "none.stl")))


@pytest.fixture
def runs(services: Server, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Record the names of the meshes that the worker prepares."""
    names: list[str] = []
    run = services.compute.run

    async def counted(task: Any, **more: Any) -> Any:
        if isinstance(task, PrepareAsset):
            names.append(task.file.name)
        return await run(task, **more)

    monkeypatch.setattr(services.compute, "run", counted)
    return names


async def put(http: httpx.AsyncClient, key: str, content: bytes, name: str = "", **query: Any) -> None:
    files = {"assetData": (name or key, content)}
    granted(await http.post("/assets", params={"id": key, **query}, files=files))


def with_header(content: bytes, mark: bytes) -> bytes:
    """Return the same mesh with another header, which has no meaning in a binary STL but changes the digest."""
    return mark.ljust(80) + content[80:]


async def test_simultaneous_requests_share_one_conversion(
    http: httpx.AsyncClient, services: Server, runs: list[str]
) -> None:
    await put(http, "ball.stl", BALL)
    answers = await asyncio.gather(*(http.get(SHOWN.format("ball.stl")) for _ in range(5)))
    assert [answer.status_code for answer in answers] == [200] * 5
    assert len({answer.content for answer in answers}) == 1
    assert runs == ["ball.stl"]
    content = answers[0].content
    assert content.startswith(b"glTF")
    assert len(content) < 0.4 * len(BALL)
    assert answers[0].headers["content-type"] == "model/gltf-binary"
    assert (await http.get(SHOWN.format("ball.stl"))).content == content
    # The same mesh under another name is not converted again, not even after a restart.
    await put(http, "same.stl", BALL)
    assert (await http.get(SHOWN.format("same.stl"))).content == content
    anew = prepared_module.DisplayModels(
        services.assets, services.compute, services.tasks, services.settings.prepared_dir
    )
    assert (await anew.get("ball.stl")).plain.read_bytes() == content
    assert runs == ["ball.stl"]


async def test_assets_are_cached_and_compressed_by_http_headers(http: httpx.AsyncClient) -> None:
    await put(http, "tagged.stl", with_header(BALL, b"tagged"))
    plain = await http.get(SHOWN.format("tagged.stl"), headers={"Accept-Encoding": "identity"})
    packed = await http.get(SHOWN.format("tagged.stl"))
    assert packed.headers["content-encoding"] == "gzip"
    assert "content-encoding" not in plain.headers
    assert int(packed.headers["content-length"]) < 0.9 * int(plain.headers["content-length"])
    assert packed.content == plain.content
    assert packed.headers["etag"] != plain.headers["etag"]
    known = {"If-None-Match": f'"other", W/{packed.headers["etag"]}'}
    again = await http.get(SHOWN.format("tagged.stl"), headers=known)
    assert (again.status_code, again.content) == (304, b"")
    # Another mesh under the same id results in another answer.
    await put(http, "tagged.stl", with_header(BALL, b"newer"), upsert=True)
    assert (await http.get(SHOWN.format("tagged.stl"), headers=known)).status_code == 200


async def test_a_broken_mesh_is_refused_after_one_attempt(http: httpx.AsyncClient, runs: list[str]) -> None:
    await put(http, "asset_1", b"solid nothing", "bracket.stl")
    for _ in range(2):
        refused(await http.get(SHOWN.format("asset_1")), 400, "Argument", "bracket.stl")
    assert runs == ["bracket.stl"]
    await put(http, "asset_1", with_header(BALL, b"repaired"), "bracket.stl", upsert=True)
    assert (await http.get(SHOWN.format("asset_1"))).status_code == 200
    refused(await http.get(SHOWN.format("asset_2")), 404, "NotFound", "asset_2")


async def test_a_long_conversion_is_announced_as_a_task(
    http: httpx.AsyncClient, services: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    titles: list[str] = []
    begin = services.tasks.begin

    def recorded_begin(kind: TaskKind, title: Message) -> Task:
        titles.append(title.text)
        return begin(kind, title)

    monkeypatch.setattr(services.tasks, "begin", recorded_begin)
    await put(http, "quick.stl", with_header(BALL, b"quick"), "quick one.stl")
    monkeypatch.setattr(prepared_module, "SHOWN_AFTER", 60.0)
    await http.get(SHOWN.format("quick.stl"))
    assert titles == []
    monkeypatch.setattr(prepared_module, "SHOWN_AFTER", 0.0)
    await put(http, "slow.stl", with_header(BALL, b"slow"), "slow one.stl")
    await http.get(SHOWN.format("slow.stl"))
    assert titles == ["Preparing slow one.stl for the editor"]
    assert services.tasks.running_events() == []


async def test_a_crashed_worker_fails_one_request_without_blaming_the_mesh(
    http: httpx.AsyncClient, services: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    await put(http, "unlucky.stl", with_header(BALL, b"unlucky"))
    with monkeypatch.context() as patched:

        async def stopped(*_: Any, **__: Any) -> None:
            raise ComputeStopped("The compute worker was killed by SIGKILL while it worked on a mesh for the editor.")

        patched.setattr(services.compute, "run", stopped)
        refused(await http.get(SHOWN.format("unlucky.stl")), 503, "General", "SIGKILL")
    assert (await http.get(SHOWN.format("unlucky.stl"))).status_code == 200


async def test_a_cancelled_request_does_not_affect_others(
    http: httpx.AsyncClient, services: Server, runs: list[str]
) -> None:
    await put(http, "shared.stl", with_header(BALL, b"shared"))
    leaver = asyncio.create_task(services.display_models.get("shared.stl"))
    stayer = asyncio.create_task(services.display_models.get("shared.stl"))
    while not runs:
        await asyncio.sleep(0.001)
    leaver.cancel()
    assert (await stayer).plain.is_file()
    assert runs == ["shared.stl"]


async def test_outdated_and_unused_assets_are_removed(
    http: httpx.AsyncClient, services: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder: Path = services.settings.prepared_dir
    await put(http, "first.stl", with_header(BALL, b"first"))
    first = await services.display_models.get("first.stl")
    old = folder / f"{'0' * 64}.{CONVERSION - 1}.stl.glb"
    old.write_bytes(b"glTF")
    os.utime(first.plain, (1, 1))
    remaining = {file for file in folder.glob("*.glb") if file not in (first.plain, old)}
    size = sum(file.stat().st_size for file in (*remaining, first.plain))
    monkeypatch.setattr(prepared_module, "MAX_SIZE", size + 1000)
    await put(http, "second.stl", with_header(BALL, b"second"))
    second = await services.display_models.get("second.stl")
    assert set(folder.glob("*.glb")) == remaining | {second.plain}
    assert first.packed is not None
    assert not first.packed.exists()
    # It is converted again on request.
    assert (await services.display_models.get("first.stl")).plain.is_file()


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def robots(services: Server) -> AsyncIterator[list[str]]:
    yield sorted(
        {str(robot.urdf_package_filename) for robot in services.types.robot_metas() if robot.urdf_package_filename}
    )


async def test_every_robot_of_an_installed_driver_can_be_shown(http: httpx.AsyncClient, robots: list[str]) -> None:
    assert "ur5e.zip" in robots
    for name in robots:
        answer = await http.get(SHOWN.format(name))
        assert answer.status_code == 200, answer.text
        assert b'"problems":{}' in answer.content
