"""Reference for round trips: Litestar and uvicorn as in the server, answering every message with N bytes."""

import asyncio
import signal
import socket as sockets
import sys
from typing import Any

import uvicorn
import uvloop
from litestar import Litestar, WebSocket, websocket


def application(size: int) -> Litestar:
    """Return an application that answers every message with `size` bytes."""
    answer = "x" * size

    @websocket("/")
    async def respond(socket: WebSocket[Any, Any, Any]) -> None:
        await socket.accept()
        while (message := await socket.receive())["type"] == "websocket.receive":
            assert message
            await socket.send_text(answer)

    return Litestar([respond], openapi_config=None, logging_config=None)


class AnnouncingServer(uvicorn.Server):
    """Server that prints its address when it is ready."""

    async def startup(self, sockets: list[Any] | None = None) -> None:
        """Start, then print the address."""
        await super().startup(sockets=sockets)
        if sockets:
            sys.stdout.write(f"ready ws://127.0.0.1:{sockets[0].getsockname()[1]}\n")
            sys.stdout.flush()


async def main(size: int) -> None:
    """Serve until SIGTERM."""
    listener = sockets.socket()
    listener.bind(("127.0.0.1", 0))
    config = uvicorn.Config(
        application(size), ws="websockets-sansio", log_config=None, access_log=False, ws_per_message_deflate=False
    )
    server = AnnouncingServer(config)

    def end() -> None:
        server.should_exit = True

    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, end)
    await server.serve(sockets=[listener])


if __name__ == "__main__":
    uvloop.run(main(int(sys.argv[1])))
