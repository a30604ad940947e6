"""Fifty clients, ten of which never read: the others get every message in order, and the queues are bounded."""

import asyncio
import contextlib
import socket
from pathlib import Path

import psutil

from tests.server.core.serving import RawConnection, running, talking, until

READERS, DEAF = 40, 10
EVENTS = 700
TEXT = "x" * 9_900
BOUND = 500_000
"""Bytes that may be queued for a client. The other events do not fit into the buffers of the operating system."""
COST_MIB = 50
"""Largest permitted growth of the server's memory, MiB."""


async def _deaf(url: str) -> socket.socket:
    """Return an open websocket that has a small receive buffer and is never read."""
    host, _, port = url.partition("://")[2].strip("/").partition(":")
    deaf = socket.socket()
    deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    deaf.setblocking(False)
    loop = asyncio.get_running_loop()
    await loop.sock_connect(deaf, (host, int(port)))
    await loop.sock_sendall(
        deaf,
        f"GET / HTTP/1.1\r\nHost: {host}:{port}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode(),
    )
    assert (await loop.sock_recv(deaf, 12)).startswith(b"HTTP/1.1 101")
    return deaf


async def _descriptions(talker: RawConnection) -> list[str]:
    """Wait until a client has received all descriptions, and return their numbers."""
    found: list[str] = []
    while len(found) < EVENTS:
        message = await talker.receive(60.0)
        if message.get("event") == "SceneChanged":
            found.append(message["data"]["description"].partition(" ")[0])
    return found


async def test_clients_that_never_read_are_closed_without_delaying_others(tmp_path: Path) -> None:
    async with (
        running(tmp_path / "data", ARCOR2_HW_OUTGOING_BYTES=str(BOUND), ARCOR2_HW_OUTGOING_AGE="60") as server,
        contextlib.AsyncExitStack() as stack,
    ):
        author = await stack.enter_async_context(talking(server.url, "author"))
        readers = [await stack.enter_async_context(talking(server.url)) for _ in range(READERS - 1)]
        deaf = [await _deaf(server.url) for _ in range(DEAF)]
        stack.callback(lambda: [each.close() for each in deaf])
        await author.granted("NewScene", {"name": "scene"})
        scene = (await author.event("OpenScene"))["data"]["scene"]["id"]
        process = psutil.Process(server.process.pid)
        before = process.memory_full_info().pss
        listening = [asyncio.create_task(_descriptions(reader)) for reader in readers]
        for number in range(EVENTS):
            args = {"scene_id": scene, "new_description": f"{number} {TEXT}"}
            await author.granted("UpdateSceneDescription", args)
        expected = [str(number) for number in range(EVENTS)]
        assert all(received == expected for received in await asyncio.gather(*listening))
        cost = (process.memory_full_info().pss - before) / 2**20
        assert cost <= COST_MIB
        # The clients were closed because of the number of queued bytes, not because of their age.
        await until(lambda: server.log.read_text().count("too slow") >= DEAF)
        await author.granted("SystemInfo")
