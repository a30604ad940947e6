"""The endpoint and its handlers: order of events and answer, partial success, unexpected errors."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest
import structlog
from litestar.datastructures import Address

from arcor2_hw.exceptions import DeviceTimeout
from arcor2_server.app import Server, running_server
from arcor2_server.app.application import endpoints
from arcor2_server.errors import RequestRefused
from arcor2_server.settings import ServerSettings
from arcor2_server.web.websocket_transport import EXTENSION
from arcor2_server.websocket.request import Context, Handler


class Protocol:
    """The part of WireProtocol that the endpoint uses."""

    def __init__(self) -> None:
        self.sent: list[dict[str, Any]] = []

    def send_text_now(self, message: bytes) -> bool:
        self.sent.append(json.loads(message))
        return True

    async def send_text(self, message: bytes) -> None:
        self.send_text_now(message)

    async def ping(self) -> None: ...

    def admit(self) -> None: ...

    def abort(self) -> None: ...


class Socket:
    """The part of a websocket that the endpoint uses; messages come from a queue."""

    def __init__(self) -> None:
        self.protocol = Protocol()
        self.scope: dict[str, Any] = {"extensions": {EXTENSION: self.protocol}, "server": ("127.0.0.1", 6789)}
        self.client = Address("127.0.0.1", 1)
        self.headers: dict[str, str] = {}
        self.query_params: dict[str, str] = {}
        self.incoming: asyncio.Queue[dict[str, Any]] = asyncio.Queue()

    async def accept(self) -> None: ...

    async def receive(self) -> dict[str, Any]:
        return await self.incoming.get()

    async def send(self, message: dict[str, Any]) -> None: ...

    def send_in(self, **message: Any) -> None:
        self.incoming.put_nowait({"type": "websocket.receive", "text": json.dumps(message)})

    def disconnect(self) -> None:
        self.incoming.put_nowait({"type": "websocket.disconnect"})

    async def received(self, count: int) -> list[dict[str, Any]]:
        async with asyncio.timeout(30):
            while len(self.protocol.sent) < count:
                await asyncio.sleep(0.001)
        return self.protocol.sent


@pytest.fixture
async def services(tmp_path: Path) -> AsyncIterator[Server]:
    async with running_server(ServerSettings(data_dir=tmp_path, requests_in_flight=2)) as running:
        yield running


@asynccontextmanager
async def connecting(services: Server) -> AsyncIterator[Callable[[], Socket]]:
    """Connect to an endpoint whose routes a test may change with `handle`."""
    tasks: list[asyncio.Task[None]] = []
    sockets: list[Socket] = []
    endpoint = endpoints(services)[0]

    def make() -> Socket:
        socket: Any = Socket()
        sockets.append(socket)
        tasks.append(asyncio.create_task(endpoint.serve(socket)))
        return socket  # type: ignore[no-any-return]

    make.routes = endpoint.service.routes  # type: ignore[attr-defined]
    yield make
    for socket in sockets:
        socket.disconnect()
    await asyncio.gather(*tasks)
    await endpoint.close()


def handle(connect: Any, name: str, handler: Handler | None = None, **fields: Any) -> None:
    """Replace the handler of a request, or other fields of its route."""
    if handler is not None:
        fields["handler"] = handler
    connect.routes[name] = msgspec.structs.replace(connect.routes[name], **fields)


async def test_events_are_sent_before_or_after_the_answer_as_declared(
    services: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with connecting(services) as connect:

        async def handler(context: Context, args: None) -> set[str]:
            context.emit("SceneSaved")
            context.emit_first("ProjectSaved")
            return {"x"}

        handle(connect, "SaveScene", handler)
        ann, bob = connect(), connect()
        await bob.received(1)
        ann.send_in(id=1, request="SaveScene")
        received = await ann.received(4)
        assert [one.get("event") or one["response"] for one in received[1:]] == [
            "ProjectSaved",
            "SaveScene",
            "SceneSaved",
        ]
        assert received[2] == {"id": 1, "response": "SaveScene", "result": True, "data": ["x"]}
        assert [one["event"] for one in (await bob.received(3))[1:]] == ["ProjectSaved", "SceneSaved"]


async def test_a_refusal_drops_events_unless_something_was_done(
    services: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with connecting(services) as connect:

        async def refused(context: Context, args: None) -> None:
            context.emit("SceneSaved")
            raise RequestRefused("not now")

        async def partly(context: Context, args: None) -> None:
            context.emit_first("ProjectSaved")
            raise RequestRefused("not all", ["a"])

        handle(connect, "SaveScene", refused)
        handle(connect, "SaveProject", partly)
        ann = connect()
        ann.send_in(id=1, request="SaveScene")
        await ann.received(2)
        ann.send_in(id=2, request="SaveProject")
        assert (await ann.received(4))[1:] == [
            {"id": 1, "response": "SaveScene", "result": False, "messages": ["not now"]},
            {"event": "ProjectSaved"},
            {"id": 2, "response": "SaveProject", "result": False, "messages": ["not all"], "data": ["a"]},
        ]


async def test_typed_errors_become_the_message(services: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    async with connecting(services) as connect:

        async def handler(context: Context, args: None) -> None:
            raise DeviceTimeout("robot at 10.0.0.1 did not answer", detail="register 7")

        handle(connect, "SaveScene", handler)
        ann = connect()
        ann.send_in(id=1, request="SaveScene")
        assert (await ann.received(2))[1]["messages"] == ["robot at 10.0.0.1 did not answer"]


async def test_unexpected_errors_refer_to_the_log(services: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    async with connecting(services) as connect:

        async def handler(context: Context, args: None) -> Any:
            return 1 / 0

        async def not_encodable(context: Context, args: None) -> Any:
            return object()

        def no_cached_answer() -> Any:
            raise ZeroDivisionError

        handle(connect, "SaveScene", handler)
        handle(connect, "SaveProject", not_encodable)
        handle(connect, "SystemInfo", cached=no_cached_answer)
        ann = connect()
        with structlog.testing.capture_logs() as logged:
            monkeypatch.setattr("arcor2_server.websocket.dispatch.log", structlog.get_logger())
            for number, name in enumerate(("SaveScene", "SaveProject", "SystemInfo"), 1):
                ann.send_in(id=number, request=name)
            answers = {one["id"]: one for one in (await ann.received(4))[1:]}
        references = {entry["request"]: entry["reference"] for entry in logged if entry["event"] == "request failed"}
        assert set(references) == {"SaveScene", "SaveProject"}
        for number, name in ((1, "SaveScene"), (2, "SaveProject")):
            assert answers[number]["result"] is False
            assert references[name] in answers[number]["messages"][0]
        assert answers[3]["result"] is True


async def test_bounded_number_in_flight(services: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    async with connecting(services) as connect:
        started: list[int] = []
        go_on = asyncio.Event()

        async def handler(context: Context, args: None) -> None:
            started.append(1)
            await go_on.wait()

        handle(connect, "SaveScene", handler)
        ann = connect()
        for number in range(10):
            ann.send_in(id=number, request="SaveScene")
        await ann.received(1)
        await asyncio.sleep(0.02)
        assert len(started) == 2
        # Another client is not delayed by it.
        bob = connect()
        bob.send_in(id=1, request="SystemInfo")
        await bob.received(2)
        go_on.set()
        assert len(await ann.received(11)) == 11
        assert len(started) == 10


async def test_a_request_is_completed_after_its_client_left(services: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    async with connecting(services) as connect:
        entered, go_on, done = asyncio.Event(), asyncio.Event(), asyncio.Event()

        async def handler(context: Context, args: None) -> None:
            entered.set()
            await go_on.wait()
            done.set()

        handle(connect, "SaveScene", handler)
        ann = connect()
        ann.send_in(id=1, request="SaveScene")
        await entered.wait()
        ann.disconnect()
        go_on.set()
        async with asyncio.timeout(30):
            await done.wait()


async def test_an_oversized_name_is_refused_without_events(services: Server) -> None:
    async with connecting(services) as connect:
        ann, bob = connect(), connect()
        await bob.received(1)
        ann.send_in(id=1, request="RegisterUser", args={"user_name": "x" * 15_000_000}, codes=True)
        answer = (await ann.received(2))[-1]
        assert (answer["result"], answer["code"]) == (False, "text_too_long")
        assert "user_name has 15000000 characters; at most 200 are allowed" in answer["messages"][0]
        ann.send_in(id=2, request="RegisterUser", args={"user_name": "x" * 200})
        assert (await ann.received(3))[2]["result"]
        assert len(bob.protocol.sent) == 1


async def test_a_refusal_contains_its_translation_data_if_codes_are_requested(services: Server) -> None:
    async def handler(context: object, args: object) -> None:
        raise RequestRefused("The scene {name!r} is open.", name="s1")

    async with connecting(services) as connect:
        handle(connect, "SaveScene", handler)
        ann = connect()
        ann.send_in(id=1, request="SaveScene", codes=True)
        ann.send_in(id=2, request="SaveScene")
        first, second = [each for each in await ann.received(3) if each.get("response") == "SaveScene"]
        assert first["messages"] == second["messages"] == ["The scene 's1' is open."]
        assert (first["key"], first["values"]) == ("The scene {name} is open.", {"name": "'s1'"})
        assert second.keys().isdisjoint({"code", "key", "values"})
