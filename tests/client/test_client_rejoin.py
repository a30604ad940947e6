"""Reconnecting of the client, against a scripted server."""

import asyncio
from typing import Any

import pytest
from websockets.asyncio.server import ServerConnection

from arcor2_hw.client import (
    AnswerLost,
    AnswerTimeout,
    Client,
    DeviceFailed,
    EventsMissed,
    LockedByOther,
    NotAdmitted,
    RequestFailed,
)
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.rpc import RobotEventKind
from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, InvalidData, NotConnected
from tests.client.scripted import ScriptedServer, cut, scripted


async def disconnect(server: ScriptedServer, client: Client) -> None:
    """Break the connection and wait until the client has noticed."""
    server.sockets[-1].transport.abort()
    async with asyncio.timeout(30.0):
        while client.connected:
            await asyncio.sleep(0.001)


INFO = {"version": "1", "api_version": "1"}


async def test_an_edit_without_an_answer_is_not_repeated() -> None:
    async with scripted() as server, Client(server.url, "ann") as client:
        server.script["AddActionPoint"] = [cut]
        with pytest.raises(AnswerLost, match="may or may not have been executed") as unknown:
            await client.add_action_point(name="a", position=Position(0.0, 0.0, 0.0))
        assert unknown.value.request == "AddActionPoint"
        await client.save_project()  # waits for the connection
        assert server.asked == [["RegisterUser", "AddActionPoint"], ["RegisterUser", "SaveProject"]]


async def test_reads_and_dry_runs_are_repeated() -> None:
    async with scripted() as server, Client(server.url, "ann") as client:
        server.data["SystemInfo"] = INFO
        server.script = {"SystemInfo": [cut, cut], "SaveProject": [cut]}
        assert (await client.system_info()).version == "1"
        await client.save_project(dry_run=True)
        flat = [name for asked in server.asked for name in asked]
        assert (flat.count("SystemInfo"), flat.count("SaveProject"), flat.count("RegisterUser")) == (3, 2, 4)


async def test_the_client_registers_again_before_other_requests() -> None:
    async with scripted() as server, Client(server.url, "ann", token="secret") as client:
        for name in ("RegisterForRobotEvent",):
            server.data[name] = []
        await client.subscribe_events({"ObjectState", "TaskState"})
        await client.subscribe_events({"TaskState"}, send=False)
        await client.register_for_robot_event(robot_id="r1", what=RobotEventKind.JOINTS, send=True)
        await client.register_for_robot_event(robot_id="r2", what=RobotEventKind.JOINTS, send=True)
        await client.register_for_robot_event(robot_id="r2", what=RobotEventKind.JOINTS, send=False)
        before = len(server.args)
        await disconnect(server, client)
        await client.save_project()
        assert server.asked[-1] == ["RegisterUser", "SubscribeEvents", "RegisterForRobotEvent", "SaveProject"]
        assert server.args[before:-1] == [
            {"user_name": "ann"},
            {"events": ["ObjectState"], "send": True},
            {"robot_id": "r1", "what": "joints", "send": True},
        ]
        assert server.tokens == ["Bearer secret"] * 2


async def test_streams_report_the_gap_after_a_reconnect() -> None:
    async def refuse(server: ScriptedServer, socket: ServerConnection, request: dict[str, Any]) -> None:
        await server.answer(socket, request, False, "The scene is offline.", "request_refused")

    async with scripted() as server, Client(server.url) as client:
        server.data["RegisterForRobotEvent"] = []
        await client.register_for_robot_event(robot_id="r1", what=RobotEventKind.EEF_POSE, send=True)
        followed = client.follow("ShowMainScreen")
        assert (await client.next_event()).event == "ShowMainScreen"
        server.script["RegisterForRobotEvent"] = [refuse]
        server.sockets[-1].transport.abort()
        for stream in (client.events(), followed):
            with pytest.raises(EventsMissed) as missed:
                await anext(stream)
            assert missed.value.rejoined
            assert 0.0 < missed.value.seconds < 60.0
            assert missed.value.not_resumed == ("eef_pose of r1",)
            assert (await anext(stream)).event == "ShowMainScreen"
        server.sockets[-1].transport.abort()
        with pytest.raises(EventsMissed):
            await anext(followed)
        assert server.asked[-1] == []  # a refused subscription is not repeated


async def test_registering_is_repeated_until_the_name_is_free() -> None:
    async def refuse_name(server: ScriptedServer, socket: ServerConnection, request: dict[str, Any]) -> None:
        await server.answer(socket, request, False, "The name is taken.", "request_refused")

    async with scripted() as server, Client(server.url, "ann") as client:
        server.script["RegisterUser"] = [refuse_name, refuse_name]
        await disconnect(server, client)
        await client.save_scene()
        assert [asked[-1] for asked in server.asked] == ["RegisterUser"] * 3 + ["SaveScene"]
        assert (await client.next_event()).event == "ShowMainScreen"
        with pytest.raises(EventsMissed):
            await client.next_event()
        # One gap and one greeting, not three.
        assert (await client.next_event()).event == "ShowMainScreen"
        with pytest.raises(DeviceTimeout):
            await client.next_event(timeout=0.05)
        server.script["RegisterUser"] = [refuse_name]
        with pytest.raises(RequestFailed, match="taken"):
            await Client(server.url, "ann").open()


async def test_a_revoked_token_closes_the_client() -> None:
    async with scripted() as server, Client(server.url, token="old") as client:
        server.accepts_token = False
        await server.sockets[-1].close(4401, "the token is no longer valid")
        await client.next_event("ShowMainScreen")
        for _ in range(2):
            with pytest.raises(NotAdmitted, match="no longer valid"):
                await client.next_event()
            with pytest.raises(NotAdmitted):
                await client.save_scene()
        with pytest.raises(NotAdmitted):
            await anext(client.follow("SceneState", "SceneSaved"))
        assert len(server.asked) == 1
        with pytest.raises(NotAdmitted, match="not valid"):
            await Client(server.url, token="old").open()


async def test_without_reconnect_the_first_loss_closes_the_client() -> None:
    async with scripted() as server, Client(server.url, reconnect=False) as client:
        server.script["SystemInfo"] = [cut]
        with pytest.raises(AnswerLost):
            await client.system_info()
        with pytest.raises(ConnectionLost, match="closed"):
            await client.system_info()
        assert [event.event async for event in client.events()] == ["ShowMainScreen"]
        assert not client.connected
        assert len(server.asked) == 1


async def test_time_limits_hold_for_late_answers_and_missing_servers() -> None:
    async def silent(server: ScriptedServer, socket: ServerConnection, request: dict[str, Any]) -> None:
        requests.append(request)

    requests: list[dict[str, Any]] = []
    server = ScriptedServer()
    async with server.running():
        client = Client(server.url, timeout=30.0)
        await client.open()
        server.data = {"SystemInfo": INFO, "GetEndEffectors": ["a"]}
        server.script["GetEndEffectors"] = [silent]
        with pytest.raises(AnswerTimeout, match=r"GetEndEffectors within 0\.1 s"):
            await client.get_end_effectors("r", timeout=0.1)
        # The late answer is not used for another request.
        await server.answer(server.sockets[-1], requests[0])
        assert (await client.system_info()).version == "1"
    try:
        with pytest.raises(NotConnected, match=r"within 0\.2 s: SaveScene was not sent"):
            await client.save_scene(timeout=0.2)
        async with server.running(int(server.url.rpartition(":")[2])):
            await client.save_scene()
    finally:
        await client.close()
    with pytest.raises(ConnectionLost):
        await client.save_scene()


async def test_the_client_waits_for_a_server_that_starts_late() -> None:
    server = ScriptedServer()
    async with server.running():
        pass
    with pytest.raises(ConnectionLost, match="does not answer"):
        await Client(server.url).open()
    client = Client(server.url, connect_within=20.0)
    opening = asyncio.create_task(client.open())
    await asyncio.sleep(0.15)
    async with server.running(int(server.url.rpartition(":")[2])):
        await opening
        await client.close()


async def test_an_invalid_message_does_not_end_the_connection() -> None:
    async with scripted() as server, Client(server.url) as client:
        await client.next_event()
        await server.send_event(event="SceneState", data={"state": "upside down"})
        await server.sockets[-1].send("no JSON")
        await server.send_event(event="SomethingNew", data={"any": 1})
        with pytest.raises(EventsMissed):
            await client.next_event()
        event = await client.next_event()
        assert (event.event, event.data) == ("SomethingNew", {"any": 1})
        server.data["SystemInfo"] = {"version": 1}
        with pytest.raises(InvalidData, match="SystemInfo"):
            await client.system_info()


@pytest.mark.parametrize(
    ("code", "kind"),
    [("locked", LockedByOther), ("safety_stop", DeviceFailed), ("of_the_future", RequestFailed), ("", RequestFailed)],
)
async def test_the_code_of_a_refusal_selects_the_error_class(code: str, kind: type[RequestFailed]) -> None:
    async def refuse(server: ScriptedServer, socket: ServerConnection, request: dict[str, Any]) -> None:
        await server.answer(socket, request, False, "No.", code)

    async with scripted() as server, Client(server.url) as client:
        server.script["SaveScene"] = [refuse]
        with pytest.raises(RequestFailed, match=r"^No\.$") as failed:
            await client.save_scene()
        assert (type(failed.value), failed.value.reason, failed.value.request) == (kind, code, "SaveScene")


async def test_close_ends_waiting_requests() -> None:
    async def silent(server: ScriptedServer, socket: ServerConnection, request: dict[str, Any]) -> None:
        pass

    async with scripted() as server:
        client = Client(server.url)
        await client.open()
        server.script["SaveScene"] = [silent]
        waiting = asyncio.create_task(client.save_scene())
        following = asyncio.create_task(anext(client.follow("SceneSaved")))
        await asyncio.sleep(0.05)
        await client.close()
        with pytest.raises(ConnectionLost):
            await waiting
        with pytest.raises(StopAsyncIteration):
            await following
        await client.close()


async def test_streams_can_be_opened_and_closed() -> None:
    async with scripted() as server, Client(server.url) as client:
        with client.follow("SceneSaved") as saved, client.follow("SceneSaved", limit=1) as narrow:
            for _ in range(2):
                await server.send_event(event="SceneSaved")
            await server.send_event(event="SceneClosed")
            await client.save_scene()
            assert [(await anext(saved)).event for _ in range(2)] == ["SceneSaved"] * 2
            with pytest.raises(EventsMissed) as missed:
                await anext(narrow)
            assert missed.value.dropped == 1
        assert len(client._streams) == 1


async def test_an_unexpected_error_is_raised_in_waiting_requests(monkeypatch: pytest.MonkeyPatch) -> None:
    async def broken(*args: Any) -> Any:
        raise ZeroDivisionError("a bug")

    async with scripted() as server, Client(server.url) as client:
        await client.next_event()
        monkeypatch.setattr("arcor2_hw.client.wire.Wire.open", broken)
        waiting = asyncio.create_task(client.next_event(timeout=30.0))
        await disconnect(server, client)
        with pytest.raises(ZeroDivisionError):
            await waiting
        with pytest.raises(ZeroDivisionError):
            await client.save_scene()
