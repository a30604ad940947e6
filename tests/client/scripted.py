"""A minimal server whose answers and faults are scripted by the test. It records the requests."""

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

Answer = Callable[["ScriptedServer", ServerConnection, dict[str, Any]], Any]


async def granted(server: "ScriptedServer", socket: ServerConnection, request: dict[str, Any]) -> None:
    await server.answer(socket, request)


async def cut(server: "ScriptedServer", socket: ServerConnection, request: dict[str, Any]) -> None:
    """Break the connection without a close frame, like an unplugged cable."""
    socket.transport.abort()


class ScriptedServer:
    """Answer requests by `script[name]`, a list of functions for that request. Other requests succeed."""

    def __init__(self) -> None:
        self.asked: list[list[str]] = []
        """The requests of each connection."""
        self.args: list[Any] = []
        self.tokens: list[str] = []
        self.script: dict[str, list[Answer]] = {}
        self.data: dict[str, Any] = {}
        self.sockets: list[ServerConnection] = []
        self.url = ""
        self.greeting: list[dict[str, Any]] = [{"event": "ShowMainScreen", "data": {"what": "ScenesList"}}]
        self.accepts_token = True

    async def answer(
        self, socket: ServerConnection, request: dict[str, Any], result: bool = True, text: str = "", code: str = ""
    ) -> None:
        answer = {"id": request["id"], "response": request["request"], "result": result}
        if text:
            answer["messages"] = [text]
        if code:
            answer["code"] = code
        if result and request["request"] in self.data:
            answer["data"] = self.data[request["request"]]
        await socket.send(json.dumps(answer))

    async def send_event(self, **event: Any) -> None:
        await self.sockets[-1].send(json.dumps(event))

    async def _serve(self, socket: ServerConnection) -> None:
        mine: list[str] = []
        self.asked.append(mine)
        self.sockets.append(socket)
        assert socket.request is not None
        self.tokens.append(socket.request.headers.get("Authorization", ""))
        if not self.accepts_token:
            await socket.close(4401, "the token is not valid")
            return
        for event in self.greeting:
            await socket.send(json.dumps(event))
        with contextlib.suppress(ConnectionClosed):
            async for text in socket:
                request = json.loads(text)
                mine.append(request["request"])
                self.args.append(request.get("args"))
                steps = self.script.get(request["request"], [])
                await (steps.pop(0) if steps else granted)(self, socket, request)

    @contextlib.asynccontextmanager
    async def running(self, port: int = 0) -> AsyncIterator["ScriptedServer"]:
        async with serve(self._serve, "127.0.0.1", port, compression=None) as server:
            self.url = f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}"
            yield self
            await asyncio.sleep(0)


@contextlib.asynccontextmanager
async def scripted() -> AsyncIterator[ScriptedServer]:
    async with ScriptedServer().running() as server:
        yield server
