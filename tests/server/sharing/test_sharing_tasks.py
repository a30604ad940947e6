"""Tasks from the clients' view, on a complete server without a socket; obstacles while an object is disabled."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.data.editor import TaskKind
from arcor2_hw.exceptions import StorageError
from arcor2_hw.messages import Message
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.websocket.hub import Hub
from tests.server.protocol.in_process_server import Actor, open_stage, refused, until, until_event
from tests.server.protocol.test_protocol_temporary import project
from tests.server.session.session_server import Refused


def tasks(person: Actor) -> list[dict[str, Any]]:
    return [event["data"] for event in person.events() if event["event"] == "TaskState"]


async def test_starting_and_stopping_a_scene_are_tasks(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Arm", "DumbArm") as stage:
        alice, bob = await stage.person("alice"), await stage.person("bob")
        await stage.place(alice, arm="Arm", second="DumbArm")
        await bob.ask("SubscribeEvents", events=["TaskState"])
        bob.take()
        await alice.ask("StartScene")
        started = await until_event(bob, "TaskState", kind="scene_start")
        assert (started["state"], started["title"], started["started_by"]) == (
            "running",
            "Starting the scene scene",
            "alice",
        )
        late = await stage.newcomer()
        await late.ask("SubscribeEvents", events=["TaskState"])
        running_ids = [event["data"]["id"] for event in late.events() if event["event"] == "TaskState"]
        ended = await until_event(bob, "TaskState", state="finished")
        assert ended["id"] == started["id"]
        assert ended["progress"] == 1
        assert running_ids == [started["id"]]  # two imports and two connections take longer than this
        progress = [task["progress"] for task in tasks(bob) if "progress" in task]
        assert progress == sorted(progress)
        await until_event(alice, "SceneState", state="started")
        await bob.ask("StopScene")
        ended = await until_event(bob, "TaskState", state="finished", kind="scene_stop")
        assert ended["started_by"] == "bob"
        assert "TaskState" not in alice.names()
        assert stage.services.tasks.running_events() == []


async def test_the_tasks_of_a_run_name_the_user_who_requested_it(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        alice, bob = await stage.person("alice"), await stage.person("bob")
        await project(stage, alice)
        await stage.start(alice)
        await bob.ask("SubscribeEvents", events=["TaskState"])
        bob.take()
        await bob.ask("TemporaryPackage", start_paused=True)
        assert (await until_event(bob, "TaskState", kind="scene_stop"))["started_by"] == "bob"
        await until_event(bob, "PackageState", state="paused")
        await refused(alice, "StartScene")
        await bob.ask("StopPackage")
        assert (await until_event(bob, "TaskState", kind="scene_start"))["started_by"] == "bob"
        await until_event(bob, "SceneState", state="started")
        await stage.stop(alice)


async def test_a_failed_scene_start_is_a_failed_task(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Eye", "BlindEye") as stage:
        alice = await stage.person("alice")
        await stage.place(alice, eye="BlindEye")
        await alice.ask("SubscribeEvents", events=["TaskState"])

        async def broken(*_: Any) -> Message:
            return Message.of("The camera is not there.")

        stage.services.online._go_online = broken  # type: ignore[method-assign, assignment]
        await alice.ask("StartScene")
        failed = await until_event(alice, "TaskState", kind="scene_start", state="failed")
        assert failed["message"] == "The camera is not there."
        await until_event(alice, "TaskState", kind="scene_stop", state="finished")
        await until_event(alice, "SceneState", state="stopped")


async def test_a_build_is_a_task_that_can_fail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with open_stage(tmp_path) as stage:
        alice = await stage.person("alice")
        await project(stage, alice)
        key = stage.services.session.require_project().id
        await alice.ask("SubscribeEvents", events=["TaskState"])
        alice.take()
        await alice.ask("BuildProject", project_id=key, package_name="first")
        states = [(task["kind"], task["state"], task["title"], task["started_by"]) for task in tasks(alice)]
        title = "Building the package first"
        assert states == [("build", "running", title, "alice"), ("build", "finished", title, "alice")]

        async def full(*_: Any) -> str:
            raise StorageError("The disk is full.")

        monkeypatch.setattr(stage.services.build, "build", full)
        with pytest.raises(Refused, match="The disk is full"):
            await alice.ask("BuildProject", project_id=key, package_name="second")
        assert [(task["state"], task.get("message")) for task in tasks(alice)] == [
            ("running", None),
            ("failed", "The disk is full."),
        ]
        with pytest.raises(Refused):
            await alice.ask("UploadPackage", id="pkg_x", data="no base64!")
        assert [(task["kind"], task["state"]) for task in tasks(alice)] == [("upload", "running"), ("upload", "failed")]
        assert stage.services.tasks.running_events() == []


async def test_task_progress_is_throttled_except_its_end() -> None:
    sent: list[bytes] = []
    hub = Hub()
    hub.stream_to_subscribers = lambda name, key, message, besides=None: sent.append(message)  # type: ignore[method-assign, assignment]
    board = Tasks(hub)
    task = board.begin(TaskKind.COMPUTATION, Message.of("Counting"))
    for number in range(500):
        task.at(number / 499 * 2, f"step {number}")  # values above 1 count as 1
        if number % 50 == 0:
            await asyncio.sleep(0.001)
    assert len(sent) < 50
    task.finish("counted")
    assert b'"progress":1.0' in sent[-1]
    assert b"counted" in sent[-1]
    before = len(sent)
    task.at(0.5)
    task.fail("too late")
    with pytest.raises(asyncio.CancelledError), board.running(TaskKind.CALIBRATION, Message.of("Looking")):
        raise asyncio.CancelledError
    assert len(sent) == before + 2
    assert b'"cancelled"' in sent[-1]
    with pytest.raises(ZeroDivisionError), board.running(TaskKind.CALIBRATION, Message.of("Looking")):
        1 / 0  # noqa: B018
    assert b"inside the server" in sent[-1]
    assert board.running_events() == []
    board.close()


async def test_a_disabled_object_is_not_an_obstacle(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Part", "Plain") as stage:
        alice = await stage.person("alice")
        await stage.place(alice, part="Part", plain="Plain")
        await stage.start(alice)
        services, part = stage.services, stage.ids["part"]
        assert set(services.scene_collisions.online_obstacles()) == {part}  # the other object has no model
        await services.online.call(part, "set_enabled", {"state": False})
        await until(lambda: services.scene_collisions.online_obstacles() == {})
        await services.online.call(part, "set_enabled", {"state": True})
        await until(lambda: set(services.scene_collisions.online_obstacles()) == {part})
        await services.online.call(part, "set_enabled", {"state": False})
        await stage.stop(alice)
        await stage.start(alice)  # a new instance is enabled
        assert set(services.scene_collisions.online_obstacles()) == {part}
        await stage.stop(alice)
