"""A process that echoes messages over NATS, a TLS socket or Zenoh.

`python -m benchmarks.node_echo FOLDER nats|socket|zenoh PORT`
"""

import asyncio
import importlib
import json
import ssl
import sys
from pathlib import Path
from typing import Any, cast

import nats
import uvloop
from nats.aio.msg import Msg

from arcor2_hw import framing

SUBJECT = "echo"
SIZE = 1 << 20
"""Maximum size of a message on the socket, bytes."""


def context(folder: Path, *, server: bool) -> ssl.SSLContext:
    """Return a context of one end. The client checks that the local authority issued the server's certificate."""
    created = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER if server else ssl.PROTOCOL_TLS_CLIENT)
    if server:
        created.load_cert_chain(folder / "chain.pem", folder / "key.pem")
    else:
        created.load_verify_locations(folder / "authority.pem")
    return created


def zenoh_session(folder: Path, port: int, *, server: bool) -> Any:
    """Open a session of Zenoh over TLS: one end listens, the other connects, and none searches the network."""
    zenoh = importlib.import_module("zenoh")  # not among our dependencies
    config = zenoh.Config()
    settings: dict[str, object] = {
        "mode": "peer",
        "scouting/multicast/enabled": False,
        "listen/endpoints": [f"tls/localhost:{port}"] if server else [],
        "connect/endpoints": [] if server else [f"tls/localhost:{port}"],
        "transport/link/tls/root_ca_certificate": str(folder / "authority.pem"),
    }
    if server:
        settings["transport/link/tls/listen_certificate"] = str(folder / "chain.pem")
        settings["transport/link/tls/listen_private_key"] = str(folder / "key.pem")
    for name, value in settings.items():
        config.insert_json5(name, json.dumps(value))
    return zenoh.open(config)


class Frames(asyncio.Protocol):
    """Splits a stream into messages."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast("asyncio.Transport", transport)

    def data_received(self, data: bytes) -> None:
        self._buffer += data
        while len(self._buffer) >= framing.PREFIX_SIZE:
            end = framing.PREFIX_SIZE + framing.body_length(bytes(self._buffer[: framing.PREFIX_SIZE]), SIZE)
            if len(self._buffer) < end:
                return
            body = bytes(self._buffer[framing.PREFIX_SIZE : end])
            del self._buffer[:end]
            self.received(body)

    def send(self, body: bytes) -> None:
        assert self._transport is not None
        self._transport.write(framing.framed(body))

    def received(self, body: bytes) -> None:
        """Answer with the same message."""
        self.send(body)


async def main(folder: Path, kind: str, port: int) -> None:
    if kind == "nats":
        client = await nats.connect(f"tls://localhost:{port}", tls=context(folder, server=False))

        async def answer(message: Msg) -> None:
            await message.respond(message.data)

        await client.subscribe(SUBJECT, cb=answer)
        await client.flush()
        print("ready", flush=True)
    elif kind == "zenoh":
        session = zenoh_session(folder, port, server=True)
        answering = session.declare_queryable(SUBJECT, lambda query: query.reply(SUBJECT, query.payload))
        print(answering.key_expr, flush=True)
    else:
        loop = asyncio.get_running_loop()
        server = await loop.create_server(Frames, "127.0.0.1", 0, ssl=context(folder, server=True))
        print(server.sockets[0].getsockname()[1], flush=True)
    await asyncio.Event().wait()


if __name__ == "__main__":
    uvloop.run(main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])))
