"""The client with the real server: typed answers and errors, tokens, and a server that is killed."""

import asyncio
import contextlib
import os
import signal
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from arcor2_hw.client import (
    AnswerLost,
    BadRequest,
    Client,
    EventsMissed,
    Forbidden,
    LockedByOther,
    NotAdmitted,
    NotOffered,
    RequestFailed,
    ResourceNotFound,
    Rest,
    StateConflict,
)
from arcor2_hw.data.events import ChangeType, SceneStateData
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box
from arcor2_hw.data.project import ActionParameter, Flow
from arcor2_hw.data.role import Role
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Conflict, ConnectionLost, NotFound
from arcor2_server.access.tokens import TokenFile
from tests.server.core.serving import COMMAND, READY_TIMEOUT, ServerProcess, running


@pytest.fixture
async def server(tmp_path: Path) -> AsyncIterator[ServerProcess]:
    quick = {"ARCOR2_ARSERVER_LOCK_RETRIES": "1", "ARCOR2_ARSERVER_LOCK_RETRY_WAIT": "0.05"}
    async with running(tmp_path / "data", **quick) as server:
        yield server


async def test_a_project_is_edited_by_methods_with_typed_events(server: ServerProcess) -> None:
    async with Client(server.url, "ann") as ann, Client(server.url, "bob") as bob:
        with bob.follow("ActionPointChanged") as points, ann.follow("SceneState") as states:
            await ann.new_scene("bench")
            await ann.add_object_to_scene(name="time", type="TimeActions")
            timer = (await ann.next_event("SceneObjectChanged")).data
            await ann.save_scene()
            (listed,) = await ann.list_scenes()
            scene = await ann.get_scene(listed.id)
            assert (scene.name, scene.objects) == ("bench", [timer])
            await ann.new_project(scene_id=scene.id, name="wait a little")
            project = (await ann.next_event("OpenProject")).data.project
            await ann.add_action_point(name="here", position=Position(0.1, 0.2, 0.3))
            event = await anext(points)
            assert (event.change_type, event.data.name, event.data.position) == (
                *(ChangeType.ADD, "here"),
                Position(0.1, 0.2, 0.3),
            )
            await ann.add_action(
                action_point_id=event.data.id,
                name="wait",
                type=f"{timer.id}/sleep",
                parameters=[ActionParameter("seconds", "double", "0.01")],
                flows=[Flow()],
            )
            action = (await ann.next_event("ActionChanged")).data
            await ann.start_scene()
            while (state := (await anext(states)).data).state != "started":
                assert isinstance(state, SceneStateData)
            await ann.execute_action(action.id)
            assert (await ann.next_event("ActionResult")).data.action_id == action.id
            await ann.stop_scene()
            while (await anext(states)).data.state != "stopped":
                pass
            await ann.add_logic_item(start="START", end=action.id)
            await ann.add_logic_item(start=action.id, end="END", dry_run=True)
            await ann.save_project()
            saved = await ann.get_project(project.id)
            assert [item.end for item in saved.logic] == [action.id]  # a dry run adds nothing

            # Refusals state their kind.
            with pytest.raises(ResourceNotFound, match="nowhere") as missing:
                await ann.get_scene("nowhere")
            assert isinstance(missing.value, NotFound)
            assert missing.value.reason == "not_found"
            await bob.write_lock(event.data.id)
            with pytest.raises(LockedByOther):
                await ann.rename_action_point(action_point_id=event.data.id, new_name="there")
            with pytest.raises(NotOffered):
                await ann.call("Abracadabra")
            with pytest.raises(BadRequest, match="arguments of GetScene"):
                await ann.call("GetScene", {"id": 1})
            async with Client(server.url) as nobody:
                with pytest.raises(Forbidden, match="RegisterUser"):
                    await nobody.write_lock(event.data.id)
            with pytest.raises(RequestFailed):
                await Client(server.url, "ann").open()


async def test_documents_assets_and_packages_are_exchanged_over_http(server: ServerProcess, tmp_path: Path) -> None:
    async with Client(server.url, "ann") as client, Rest(server.url) as rest:
        mesh = os.urandom(300_000)
        source = tmp_path / "part.stl"
        source.write_bytes(mesh)
        asset = await rest.upload_asset("part mesh", source)
        assert (asset.id, asset.file_name) == ("part mesh", "part.stl")
        with pytest.raises(StateConflict):
            await rest.upload_asset("part mesh", b"other")
        await rest.download_asset("part mesh", tmp_path / "back.stl")
        assert (tmp_path / "back.stl").read_bytes() == mesh
        with pytest.raises(ResourceNotFound):
            await rest.download_asset("none", tmp_path / "none.stl")
        assert not (tmp_path / "none.stl").exists()
        assert [one.id for one in await rest.assets()] == ["part mesh"]

        await rest.put_model(Box("Crate", 0.1, 0.2, 0.3))
        (name,) = await rest.models()
        assert await rest.model(name) == Box("Crate", 0.1, 0.2, 0.3)
        crate = (
            "from arcor2_hw.objects import CollisionObject\n\n\nclass Crate(CollisionObject):\n    _ABSTRACT = False\n"
        )
        await rest.put_object_type("Crate", crate, Box("Crate", 0.1, 0.2, 0.3))
        assert (await rest.object_type("Crate")).source == crate

        await client.new_scene("store")
        await client.add_object_to_scene(name="crate", type="Crate", pose=Pose())
        await client.save_scene()
        scene_id = (await client.list_scenes())[0].id
        await client.new_project(scene_id=scene_id, name="stored", has_logic=False)
        await client.save_project()
        project_id = (await client.list_projects())[0].id
        await rest.put_project_script(project_id, "def main():\n    pass\n")
        assert await rest.project_script(project_id) == "def main():\n    pass\n"
        await rest.publish(project_id, tmp_path / "package.zip", "first")
        await rest.put_project_script(project_id, "def main():\n    print()\n")
        await client.close_project()
        with pytest.raises(StateConflict, match="overwriteProjectSources"):
            await rest.import_package(tmp_path / "package.zip", overwrite_project=True)
        ids = await rest.import_package(tmp_path / "package.zip", overwrite_project_sources=True)
        assert await rest.project_script(project_id) == "def main():\n    pass\n"
        assert (ids.scene_id, ids.project_id) == (scene_id, project_id)
        await rest.upload_package("pkg_one", tmp_path / "package.zip")
        assert [one.id for one in await client.list_packages()] == ["pkg_one"]
        await rest.download_package("pkg_one", tmp_path / "again.zip")
        assert (tmp_path / "again.zip").read_bytes()[:2] == b"PK"
        scene = await rest.scene(scene_id)
        assert await client.get_scene(scene_id) == scene
        await rest.put_scene(Scene("empty", id="scn_1"))
        assert {one.name for one in await rest.scenes()} == {"store", "empty"}
        with pytest.raises(ResourceNotFound):
            await rest.scene("a/b?c")
    async with Rest("ws://127.0.0.1:9") as nobody:
        with pytest.raises(ConnectionLost, match=r"127\.0\.0\.1:9"):
            await nobody.scenes()
    assert issubclass(StateConflict, Conflict)


async def test_a_token_grants_only_its_role(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = tmp_path / "data"
    data.mkdir()
    _, secret = TokenFile(data).add("line control", Role.OPERATOR)
    async with running(data) as server:
        with pytest.raises(NotAdmitted):
            await Client(server.url, token="wrong").open()
        with pytest.raises(Forbidden, match="token"):
            await Client(server.url, "ann").open()
        monkeypatch.setenv("ARCOR2_HW_TOKEN", secret)
        async with Client(server.url, "ann") as client:
            assert await client.list_scenes() == []
            with pytest.raises(Forbidden, match="technician"):
                await client.new_scene("s")
            assert await client.rest.scenes() == []
            with pytest.raises(Forbidden, match="technician"):
                await client.rest.put_scene(Scene("s", id="scn_1"))
        async with Rest(server.url, token="wrong") as rest:
            with pytest.raises(Forbidden):
                await rest.scenes()


class RestartableServer:
    """A server that a test kills and starts again on the same port."""

    def __init__(self, data: Path) -> None:
        self.data = data
        self.port = "0"
        self.process: asyncio.subprocess.Process | None = None

    async def start(self) -> str:
        self.process = await asyncio.create_subprocess_exec(
            *COMMAND,
            *("serve", "--port", self.port, "--data-dir", str(self.data)),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
        )
        assert self.process.stdout is not None
        async with asyncio.timeout(READY_TIMEOUT):
            url = (await self.process.stdout.readline()).decode().split()[1]
        self.port = url.rpartition(":")[2]
        return url

    async def end(self, sent: signal.Signals = signal.SIGKILL) -> None:
        assert self.process is not None
        with contextlib.suppress(ProcessLookupError):
            self.process.send_signal(sent)
        await self.process.communicate()


async def test_a_killed_server_loses_at_most_one_answer(tmp_path: Path) -> None:
    server = RestartableServer(tmp_path / "data")
    url = await server.start()
    try:
        async with Client(url, "ann") as client:
            await client.new_scene("bench")
            await client.save_scene()
            await client.new_project(scene_id=(await client.list_scenes())[0].id, name="points")
            acknowledged: list[str] = []
            unknown: list[str] = []

            async def edit() -> None:
                number = 0
                while len(acknowledged) < 60:
                    number += 1
                    name = f"p{number}"
                    try:
                        await client.add_action_point(name=name, position=Position(0.0, 0.0, 0.0))
                        acknowledged.append(name)
                    except AnswerLost:
                        unknown.append(name)

            editing = asyncio.create_task(edit())
            while len(acknowledged) < 20:
                await asyncio.sleep(0.001)
            await server.end()
            await server.start()
            await editing
            project = (await _next_open_project(client)).data.project
            # No acknowledged edit is lost or duplicated; edits of unknown outcome may exist.
            await client.save_project()
            names = [point.name for point in (await client.get_project(project.id)).action_points]
            assert len(names) == len(set(names))
            assert set(acknowledged) <= set(names) <= set(acknowledged) | set(unknown)
            assert len(unknown) <= 1
    finally:
        await server.end(signal.SIGTERM)


async def _next_open_project(client: Client):  # type: ignore[no-untyped-def]
    """Read the stream up to the gap and the initial events after it."""
    missed = None
    while missed is None:
        try:
            await client.next_event(timeout=30.0)
        except EventsMissed as error:
            missed = error
    assert missed.rejoined
    return await client.next_event("OpenProject", timeout=30.0)
