"""The session over a real websocket: a server killed during edits, and the state that clients then receive."""

import asyncio
import signal
from pathlib import Path

import pytest

from arcor2_hw.client.connection import Client, RequestFailed
from arcor2_hw.data.events import OpenProjectData
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.project import ActionParameter, Flow
from arcor2_hw.data.rpc import (
    AddActionArgs,
    AddActionPointArgs,
    AddObjectToSceneArgs,
    CloseProjectArgs,
    NewProjectArgs,
    NewSceneArgs,
    WriteLockArgs,
)
from arcor2_hw.exceptions import ConnectionLost
from tests.server.core.serving import ServerProcess, running

EDITORS = 4


async def test_acknowledged_edits_survive_a_kill_of_the_server(tmp_path: Path) -> None:
    data = tmp_path / "data"
    server = ServerProcess(data)
    await server.start()
    acknowledged: list[str] = []
    try:
        async with Client(server.url, "owner") as owner:
            scene = await _scene(owner)
            await owner.call("NewProject", NewProjectArgs(scene.id, "project"))
            await owner.next_event("OpenProject")
            points = []
            for number in range(EDITORS):
                await owner.call("AddActionPoint", AddActionPointArgs(f"p{number}", Position()))
                points.append((await owner.next_event("ActionPointChanged")).data.id)
            await owner.call("WriteLock", WriteLockArgs(scene.objects[0].id))
            editors = [
                asyncio.create_task(_edit(server.url, n, points[n], scene, acknowledged)) for n in range(EDITORS)
            ]
            while len(acknowledged) < 60:
                await asyncio.sleep(0.005)
                assert not any(task.done() for task in editors)
            server.process.send_signal(signal.SIGKILL)
            await asyncio.gather(*editors)
    finally:
        await server.stop()

    async with running(data) as again, Client(again.url, "owner") as owner:
        event = await owner.next_event()
        assert event.event == "OpenProject"
        assert isinstance(event.data, OpenProjectData)
        restored = [action.name for point in event.data.project.action_points for action in point.actions]
        assert set(acknowledged) <= set(restored)
        assert len(restored) <= len(acknowledged) + EDITORS
        state = await owner.next_event()
        assert (state.event, state.data.state) == ("SceneState", "stopped")
        # Locks are not restored, unsaved changes are.
        with pytest.raises(RequestFailed, match="unsaved changes"):
            await owner.call("CloseProject", CloseProjectArgs())
        await owner.call("SaveProject")
        await owner.call("CloseProject", CloseProjectArgs())
        saved = await owner.call("GetProject", {"id": event.data.project.id})
        assert [action.name for point in saved.action_points for action in point.actions] == restored


async def _scene(owner: Client):  # type: ignore[no-untyped-def]
    await owner.call("NewScene", NewSceneArgs("scene"))
    await owner.call("AddObjectToScene", AddObjectToSceneArgs("time", "TimeActions"))
    await owner.call("SaveScene")
    listed = await owner.call("ListScenes")
    return await owner.call("GetScene", {"id": listed[0].id})


async def _edit(url: str, number: int, point: str, scene, acknowledged: list[str]) -> None:  # type: ignore[no-untyped-def]
    seconds = [ActionParameter("seconds", "double", "0.5")]
    try:
        async with Client(url, f"editor{number}", reconnect=False) as client:
            for count in range(1_000_000):
                name = f"e{number}_{count}"
                action = AddActionArgs(point, name, f"{scene.objects[0].id}/sleep", seconds, [Flow()])
                await client.call("AddAction", action)
                acknowledged.append(name)
    except ConnectionLost:
        pass
