"""Every message is answered, valid or not."""

import asyncio
import contextlib
import json
import socket
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from arcor2_hw.data.rpc import RPCS
from tests.server.core.serving import ServerProcess, running, talking, until

MIB = 1024 * 1024


@pytest.mark.parametrize(
    ("text", "number", "name"),
    [
        ("", 0, "Error"),
        ("{", 0, "Error"),
        ("nonsense", 0, "Error"),
        ("null", 0, "Error"),
        ("[]", 0, "Error"),
        ("7", 0, "Error"),
        ("{}", 0, "Error"),
        ('{"request": "SystemInfo"}', 0, "Error"),
        ('{"id": "1", "request": "SystemInfo"}', 0, "Error"),
        ('{"id": null, "request": "SystemInfo"}', 0, "Error"),
        ('{"id": 1.5, "request": "SystemInfo"}', 0, "Error"),
        ('{"id": true, "request": "SystemInfo"}', 0, "Error"),
        ('{"event": "ShowMainScreen"}', 0, "Error"),
        ('{"id": 5}', 5, "Error"),
        ('{"id": 5, "request": 5}', 5, "Error"),
        ('{"id": 5, "request": "SystemInfo", "dry_run": 1}', 5, "SystemInfo"),
        ('{"id": 5, "request": "NoSuchThing"}', 5, "NoSuchThing"),
        ('{"id": 5, "request": "ListMeshes"}', 5, "ListMeshes"),
        ('{"id": 5, "request": "WriteLock"}', 5, "WriteLock"),
        ('{"id": 5, "request": "WriteLock", "args": null}', 5, "WriteLock"),
        ('{"id": 5, "request": "WriteLock", "args": []}', 5, "WriteLock"),
        ('{"id": 5, "request": "WriteLock", "args": {}}', 5, "WriteLock"),
        ('{"id": 5, "request": "WriteLock", "args": {"object_id": 3}}', 5, "WriteLock"),
        ('{"id": 5, "request": "CloseScene", "args": {"force": null}}', 5, "CloseScene"),
        ('{"id": 5, "request": "\\ud800"}', 0, "Error"),
        ('{"id": 5, "request": "RegisterUser", "args": {"user_name": "\\udfff"}}', 0, "Error"),
        ('{"id": 5, "request": "' + "x" * 300 + '"}', 5, "Error"),
        ('{"id": 123456789012345678901234567890, "request": "NoSuchThing"}', None, None),
        (b'{"id": 5, "request": "SystemInfo"}', 0, "Error"),
    ],
)
async def test_invalid_messages_are_answered(
    server: ServerProcess, text: str | bytes, number: int | None, name: str | None
) -> None:
    async with talking(server.url) as talker:
        answer = await talker.raw(text)
        assert answer["result"] is False
        assert len(answer["messages"]) == 1
        assert number is None or answer["id"] == number
        assert name is None or answer["response"] == name
        assert "data" not in answer
        await talker.granted("SystemInfo")


async def test_deeply_nested_json(server: ServerProcess) -> None:
    deep = "[" * 50_000 + "]" * 50_000
    async with talking(server.url) as talker:
        for text in (deep, '{"id": 5, "request": "SystemInfo", "x": ' + deep + "}", '{"a":' * 50_000):
            assert "id" in await talker.raw(text)
        answer = await talker.raw('{"id": 5, "request": "WriteLock", "args": ' + deep + "}")
        assert answer["result"] is False
        await talker.granted("SystemInfo")


def meaningless(kind: Any) -> Any:
    """Return valid arguments that name no existing item."""
    info = msgspec.inspect
    match msgspec.inspect.type_info(kind) if not isinstance(kind, info.Type) else kind:
        case info.StructType() as struct:
            return {field.encode_name: meaningless(field.type) for field in struct.fields if field.required}
        case info.StrType():
            return "no_such_thing"
        case info.IntType():
            return 0
        case info.FloatType():
            return 1.0
        case info.BoolType():
            return False
        case info.ListType() | info.SetType():
            return []
        case info.DictType():
            return {"no_such_thing": None}
        case info.EnumType() as choice:
            return next(iter(choice.cls)).value
        case info.LiteralType() as literal:
            return literal.values[0]
        case info.UnionType() as union:
            return meaningless(union.types[0])
        case other:
            raise AssertionError(other)


@pytest.mark.parametrize("user", [None, "ann"])
async def test_every_request_is_answered(server: ServerProcess, user: str | None) -> None:
    """All requests are sent at once over one connection: each gets exactly one answer, with its id and name."""
    assert len(RPCS) >= 118
    async with talking(server.url, user) as talker:
        sent = {}
        for number, (name, declared) in enumerate(RPCS.items(), 1):
            if name == "RegisterUser":
                continue
            message = {"id": number, "request": name}
            if declared.args is not None:
                message["args"] = meaningless(declared.args)
            if declared.dry_run:
                message["dry_run"] = True
            sent[number] = name
            await talker.socket.send(json.dumps(message))
        answers: dict[int, dict[str, Any]] = {}
        while len(answers) < len(sent):
            message = await talker.receive()
            if "event" not in message:
                assert message["id"] not in answers
                answers[message["id"]] = message
        assert {number: answer["response"] for number, answer in answers.items()} == sent
        for answer in answers.values():
            if not answer["result"]:
                (text,) = answer["messages"]
                assert "inside the server" not in text, answer


async def test_every_request_of_the_protocol_is_served(server: ServerProcess) -> None:
    async with talking(server.url) as talker:
        assert set((await talker.granted("SystemInfo"))["supported_rpc_requests"]) == set(RPCS)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=10), inner, max_size=4),
    max_leaves=12,
)
ENVELOPE = st.fixed_dictionaries(
    {},
    optional={
        "id": st.integers(min_value=0, max_value=2**40) | JSON,
        "request": st.sampled_from(sorted(set(RPCS) - {"RegisterUser"})) | JSON,
        "args": JSON,
        "dry_run": st.just(True) | JSON,
    },
)
MESSAGES = st.text(max_size=200) | JSON.map(json.dumps) | ENVELOPE.map(json.dumps) | st.binary(max_size=50)


@pytest.fixture(scope="module")
def batches() -> list[list[str | bytes]]:
    """Batches of messages, drawn outside of the event loop."""
    drawn: list[list[str | bytes]] = []

    @settings(max_examples=40, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(st.lists(MESSAGES, min_size=10, max_size=30))
    def draw(batch: list[str | bytes]) -> None:
        drawn.append([text for text in batch if isinstance(text, bytes) or _encodable(text)])

    draw()
    return drawn


def _encodable(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


async def test_any_message_is_answered_once(server: ServerProcess, batches: list[list[str | bytes]]) -> None:
    async with talking(server.url) as talker:
        for batch in batches:
            for text in batch:
                await talker.socket.send(text)
            answers = 0
            while answers < len(batch):
                message = await talker.receive()
                if "event" not in message:
                    answers += 1
                    assert set(message) <= {"id", "response", "result", "messages", "data"}
                    assert not any("inside the server" in text for text in message.get("messages", [])), message
        await talker.nothing_more()


# ------------------------------------------------------------------------------------------------ sizes
def padded(size: int, number: int = 7) -> str:
    head = f'{{"id": {number}, "request": "WriteLock", "args": {{"object_id": "'
    tail = '"}}'
    return head + "x" * (size - len(head) - len(tail)) + tail


async def test_messages_are_accepted_refused_or_closed_by_size(server: ServerProcess) -> None:
    """Up to 16 MiB served, up to 32 MiB read and refused, beyond that closed with 1009."""
    async with talking(server.url, "sizes") as talker:
        served = await talker.raw(padded(16 * MIB))
        assert (served["id"], served["response"], served["result"]) == (7, "WriteLock", False)
        assert "longer" not in served["messages"][0]
        drained = await talker.raw(padded(16 * MIB + 1))
        assert (drained["id"], drained["response"], drained["result"]) == (7, "WriteLock", False)
        assert str(16 * MIB) in drained["messages"][0]
        assert (await talker.raw(padded(32 * MIB)))["result"] is False
        await talker.granted("SystemInfo")
        with pytest.raises(ConnectionClosed) as closed:
            await talker.raw(padded(32 * MIB + 1))
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1009
    async with talking(server.url) as talker:
        await talker.granted("SystemInfo")


async def test_requests_overtake_a_waiting_request(server: ServerProcess) -> None:
    """Each request is a task of its own: a request that waits for a lock does not delay the next."""
    async with talking(server.url, "holder") as holder, talking(server.url, "waiter") as waiter:
        await holder.granted("WriteLock", {"object_id": "ADDING_OBJECT"})
        waiting = {"type": "Thing", "base": "Generic"}
        await waiter.socket.send(json.dumps({"id": 1, "request": "NewObjectType", "args": waiting}))
        await waiter.socket.send(json.dumps({"id": 2, "request": "SystemInfo"}))
        answers = [message for _ in range(3) if "event" not in (message := await waiter.receive())]
        if len(answers) < 2:
            answers.append(await waiter.receive())
        assert [answer["id"] for answer in answers] == [2, 1]
        await holder.granted("WriteUnlock", {"object_id": "ADDING_OBJECT"})


# ------------------------------------------------------------------------------------------------ slow clients
async def test_a_client_that_does_not_read_is_closed_without_delaying_others(tmp_path: Path) -> None:
    limit = {"ARCOR2_HW_OUTGOING_BYTES": "1000000", "ARCOR2_HW_OUTGOING_AGE": "60"}
    loop = asyncio.get_running_loop()
    async with running(tmp_path / "data", **limit) as server, talking(server.url, "quick") as quick:
        plain = socket.create_connection(("127.0.0.1", int(server.url.rpartition(":")[2])))
        try:
            plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            plain.sendall(HANDSHAKE)
            plain.setblocking(False)
            # Masked with zeros, so that the payload is unchanged.
            text = b'{"id": 1, "request": "GetObjectTypes"}'
            frame = bytes([0x81, 0x80 | len(text), 0, 0, 0, 0]) + text
            deadline = loop.time() + 60
            while b"4008" not in server.log.read_bytes():
                assert loop.time() < deadline, "the slow client was not closed"
                with contextlib.suppress(BlockingIOError, ConnectionError):
                    plain.send(frame * 50)
                await quick.granted("SystemInfo")
            # The connection is dropped, although the client does not read the close frame either.
            await until(lambda: b'"client disconnected"' in server.log.read_bytes())
        finally:
            plain.close()


HANDSHAKE = (
    b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


async def test_a_broken_connection_is_removed(server: ServerProcess) -> None:
    for _ in range(20):
        broken = await connect(server.url, compression=None)
        await broken.send('{"id": 1, "request": "SystemInfo"}')
        broken.transport.abort()
    async with talking(server.url) as talker:
        await talker.granted("SystemInfo")


async def test_compression_is_declined(server: ServerProcess) -> None:
    async with connect(server.url, compression="deflate") as offering:
        assert offering.response is not None
        assert "Sec-WebSocket-Extensions" not in offering.response.headers


async def test_the_websocket_is_available_at_any_path(server: ServerProcess) -> None:
    for path in ("", "/", "/anything", "/a/b?c=d"):
        async with talking(server.url + path) as talker:
            await talker.granted("SystemInfo")
