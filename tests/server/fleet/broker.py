"""Brokers of two sites: a hub, and a leaf whose link to the hub can be cut. Both store streams."""

import asyncio
import contextlib
import socket
import subprocess
from pathlib import Path

from tests.ports import free_port
from tests.server.nodes.conftest import NATS_SERVER
from tests.waiting import wait_for

USERS = """
authorization { users: [
  { user: fleet, password: f,
    permissions: { publish: ["$JS.>"], subscribe: ["arcor2hw.fleet.*.state", "_INBOX.>"] } }
  { user: cell, password: c,
    permissions: { publish: ["arcor2hw.fleet.press-3.>", "$JS.API.INFO", "$JS.API.STREAM.INFO.*"],
                   subscribe: ["_INBOX.>"] } }
] }
"""
"""The permissions of docs/how-to/fleet.md."""


class Server:
    """A nats-server with a stream store on a fixed port, so that it can be killed and started again.

    The server of the fleet and the cell press-3 have the permissions that they need, and no others.

    Args:
        folder: for its files.
        name: of the server and of its JetStream domain.
        leaf_port: port for leaf nodes; 0: none.
        hub_port: port of the hub to which it connects as a leaf node; 0: none.
        port: port for clients; 0: a free one.
    """

    def __init__(self, folder: Path, name: str, leaf_port: int = 0, hub_port: int = 0, port: int = 0) -> None:
        folder.mkdir(exist_ok=True)
        self.port = port or free_port()
        self.url = f"nats://cell:c@127.0.0.1:{self.port}"
        self.fleet_url = f"nats://fleet:f@127.0.0.1:{self.port}"
        allowed = "authorization { user: site, password: s }"  # NATS 2.15 refuses sites without a user
        leafs = [f'listen: "127.0.0.1:{leaf_port}"', allowed] if leaf_port else []
        if hub_port:
            leafs += ["reconnect: 1", f'remotes: [{{ url: "nats-leaf://site:s@127.0.0.1:{hub_port}" }}]']
        self._file = folder / "nats.conf"
        self._file.write_text(
            f'server_name: {name}\nlisten: "127.0.0.1:{self.port}"\n'
            f'jetstream {{ store_dir: "{folder / "store"}", domain: {name} }}\n'
            f"leafnodes {{ {chr(10).join(leafs)} }}\n{USERS}"
        )
        self.start()

    def start(self) -> None:
        command = (NATS_SERVER, "-c", str(self._file))
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_for(lambda: listens(self.port))

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


class Link:
    """A proxy that forwards connections to a port until it is cut."""

    def __init__(self, target: int) -> None:
        self._target = target
        self.port = free_port()
        self._server: asyncio.Server | None = None
        self._writers: set[asyncio.StreamWriter] = set()
        self._tasks: set[asyncio.Task[None]] = set()

    async def heal(self) -> None:
        self._server = await asyncio.start_server(self._forward, "127.0.0.1", self.port)

    async def cut(self) -> None:
        assert self._server is not None
        self._server.close()
        for writer in tuple(self._writers):
            writer.transport.abort()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._server = None

    async def _forward(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        with contextlib.suppress(OSError):
            other_reader, other_writer = await asyncio.open_connection("127.0.0.1", self._target)
            both = {writer, other_writer}
            self._writers |= both
            await asyncio.gather(_copy(reader, other_writer), _copy(other_reader, writer), return_exceptions=True)
            self._writers -= both


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    try:
        while data := await reader.read(65536):
            writer.write(data)
            await writer.drain()
    finally:
        writer.transport.abort()


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0
