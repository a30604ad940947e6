"""A process that answers messages, over NATS or a TLS socket.

`python -m benchmarks.node_echo FOLDER nats|socket PORT`
"""

import asyncio
import ssl
import sys
from pathlib import Path
from typing import cast

import nats
import uvloop
from nats.aio.msg import Msg

from arcor2_hw import framing

SUBJECT = "echo"
SIZE = 1 << 20
"""Maximum size of a message on the socket, bytes."""


def context(folder: Path, *, server: bool) -> ssl.SSLContext:
    """Return a context of one end. The client checks that the local authority issued the server's certificate."""
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER if server else ssl.PROTOCOL_TLS_CLIENT)
    if server:
        made.load_cert_chain(folder / "chain.pem", folder / "key.pem")
    else:
        made.load_verify_locations(folder / "authority.pem")
    return made


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
    else:
        loop = asyncio.get_running_loop()
        server = await loop.create_server(Frames, "127.0.0.1", 0, ssl=context(folder, server=True))
        print(server.sockets[0].getsockname()[1], flush=True)
    await asyncio.Event().wait()


if __name__ == "__main__":
    uvloop.run(main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])))
