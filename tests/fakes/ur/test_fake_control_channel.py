"""Control channel of the fakes, and a wire with faults, in one event loop."""

import asyncio
import contextlib
import json

import pytest

from arcor2_fakes.control import MAX_LINE, ControlClient, ControlError, ControlServer, parse_address
from arcor2_fakes.wire import TcpWire, register_faults


@pytest.fixture
async def server():
    server = ControlServer()
    state = {"n": 0}
    server.source("truth", lambda: state)
    server.command("add", lambda by: state.update(n=state["n"] + by))
    await server.start()
    yield server
    await server.close()


async def raw(server, *lines):
    reader, writer = await asyncio.open_connection(*parse_address(server.address))
    answers = []
    for line in lines:
        writer.write(line + b"\n")
        answers.append(json.loads(await reader.readline()))
    await close(writer)
    return answers


async def close(writer):
    writer.close()
    with contextlib.suppress(ConnectionError):
        await writer.wait_closed()


async def test_invalid_requests_are_answered(server):
    answers = await raw(
        server,
        b"{nonsense",
        b"\xff\xfe",
        b"[1]",
        b'{"id":7}',
        b'{"id":8,"do":"no such"}',
        b'{"id":9,"do":"add"}',
        b'{"id":10,"do":"add","by":"x"}',
        b'{"id":11,"do":"subscribe","to":"lies"}',
        b'{"id":12,"do":"add","by":2}',
    )
    assert [a["ok"] for a in answers] == [False] * 8 + [True]
    assert [a["id"] for a in answers] == [0, 0, 0, 7, 8, 9, 10, 11, 12]
    assert "'by'" in answers[5]["error"]


async def test_an_endless_line_is_closed(server):
    reader, writer = await asyncio.open_connection(*parse_address(server.address))
    writer.write(b"x" * (MAX_LINE + 100_000))
    assert not json.loads(await reader.readline())["ok"]
    async with asyncio.timeout(30.0):
        with contextlib.suppress(ConnectionError):  # the rest of the line was never read: the end may be an RST
            assert await reader.read() == b""
    await close(writer)


async def test_subscription_at_a_rate_and_on_change(server):
    async with await ControlClient.connect(server.address) as client:
        seen, arrived = [], asyncio.Event()

        def listen(value):
            seen.append(value["n"])
            arrived.set()

        await client.subscribe(listen, rate=200)
        begin = asyncio.get_running_loop().time()
        while len(seen) < 20:
            await arrived.wait()
            arrived.clear()
        assert asyncio.get_running_loop().time() - begin > 0.08
        await client.do("unsubscribe", to="truth")
        await client.subscribe(listen)
        seen.clear()
        for by in (1, 2):
            await client.do("add", by=by)
            server.publish("truth")
        await client.do("truth")  # answers arrive in order, so both earlier events have arrived
        assert seen == [1, 3]


async def test_the_client_detects_the_end_of_the_fake(server):
    client = await ControlClient.connect(server.address)
    server.command("hang", asyncio.Event().wait)
    with pytest.raises(ControlError, match="no answer"):
        await client.do("hang", within=0.05)
    waiting = asyncio.create_task(client.do("hang"))
    await asyncio.sleep(0)
    await server.close()
    with pytest.raises(ControlError):
        await waiting
    await client.wait_closed()
    with pytest.raises(ControlError):
        await client.do("truth")
    await client.close()
    with pytest.raises(ControlError):
        await ControlClient.connect(server.address)


async def test_faults_of_a_wire(server):
    wire = TcpWire("echo", "127.0.0.1", 0, lambda c: setattr(c, "received", c.send))
    await wire.listen()
    register_faults(server, {"echo": wire})
    client = await ControlClient.connect(server.address)

    async def open_and_ask(within=30.0):
        reader, writer = await asyncio.open_connection(*parse_address(wire.address))
        writer.write(b"frame")
        try:
            async with asyncio.timeout(within):
                return await reader.readexactly(5)
        except TimeoutError:
            return bytes(reader._buffer)
        finally:
            await close(writer)

    assert await open_and_ask() == b"frame"
    await client.do("silence", wire="echo")
    assert await open_and_ask(0.15) == b""
    await client.do("heal")
    await client.do("half_frame", wire="echo")
    assert await open_and_ask(0.5) == b"fr"
    await client.do("heal")
    assert await open_and_ask() == b"frame"
    await client.do("garbage")
    assert await open_and_ask(0.5) != b"frame"
    await client.do("heal")
    await client.do("slow", seconds=0.05)
    begin = asyncio.get_running_loop().time()
    assert await open_and_ask() == b"frame"
    assert asyncio.get_running_loop().time() - begin >= 0.05
    await client.do("heal")

    reader, writer = await asyncio.open_connection(*parse_address(wire.address))
    writer.write(b"frame")
    await reader.readexactly(5)
    await client.do("reset", wire="echo")
    with pytest.raises(ConnectionResetError):
        await reader.read()
    await close(writer)
    await client.do("refuse", wire="echo")
    with pytest.raises(ConnectionRefusedError):
        await asyncio.open_connection(*parse_address(wire.address))
    await client.do("heal", wire="echo")
    assert await open_and_ask() == b"frame"
    with pytest.raises(ControlError, match="wire 'other' does not exist"):
        await client.do("silence", wire="other")
    await client.close()
    wire.close()


async def test_slow_frames_keep_their_order(server):
    connections = []
    wire = TcpWire("device", "127.0.0.1", 0, connections.append)
    await wire.listen()
    reader, writer = await asyncio.open_connection(*parse_address(wire.address))
    while not connections:
        await asyncio.sleep(0.001)
    (connection,) = connections
    await wire.fault("slow", 0.05)
    connection.send(b"1")
    await asyncio.sleep(0.02)
    connection.send(b"2")
    await wire.fault("slow", 0.0)
    connection.send(b"3")
    assert await reader.readexactly(3) == b"123"
    await wire.fault("slow", 60.0)
    connection.send(b"4")
    await wire.fault("heal")
    connection.send(b"5")
    assert await reader.readexactly(2) == b"45"
    await close(writer)
    wire.close()


@pytest.mark.parametrize("text", ["", "host", ":1", "a:b", "a:70000"])
def test_invalid_addresses(text):
    with pytest.raises(ValueError):
        parse_address(text)
