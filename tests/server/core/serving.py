"""A real server process for tests, and bare websockets to it."""

import asyncio
import contextlib
import json
import os
import signal
import sys
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

from websockets.asyncio.client import ClientConnection, connect

COMMAND = [sys.executable, "-m", "arcor2_server.cli.main"]
READY_WITHIN = 60.0
WITHIN = 30.0
"""Time in s for which a test waits for what must come; long, as it passes only when a test fails."""


class ServerProcess:
    """`arcor2-hw serve` as a child."""

    def __init__(self, data_dir: Path, *arguments: str, **environment: str) -> None:
        self.data_dir = data_dir
        self.url = ""
        self._arguments = arguments
        self._environment = os.environ | environment
        self._process: asyncio.subprocess.Process | None = None
        self.log = data_dir.with_suffix(".log")

    @property
    def process(self) -> asyncio.subprocess.Process:
        assert self._process is not None
        return self._process

    async def start(self) -> None:
        with self.log.open("wb") as log:
            self._process = await asyncio.create_subprocess_exec(
                *COMMAND,
                *("serve", "--port", "0", "--data-dir", str(self.data_dir), *self._arguments),
                stdout=asyncio.subprocess.PIPE,
                stderr=log,
                env=self._environment,
            )
        try:
            self.url = await self._ready()
        except BaseException:  # nobody will stop what has not started
            if self._process.returncode is None:
                self._process.kill()
            await self._process.communicate()
            raise

    async def _ready(self) -> str:
        assert self.process.stdout is not None
        try:
            async with asyncio.timeout(READY_WITHIN):
                line = (await self.process.stdout.readline()).decode()
        except TimeoutError:
            raise TimeoutError(f"not ready within {READY_WITHIN:g} s; its log: {self.log.read_text()}") from None
        assert line.startswith("ready "), self.log.read_text()
        return line.split()[1]

    async def stop(self) -> int:
        if self.process.returncode is None:
            self.process.send_signal(signal.SIGTERM)
        async with asyncio.timeout(30):
            await self.process.communicate()
        assert self.process.returncode is not None
        return self.process.returncode


@contextlib.asynccontextmanager
async def running(data_dir: Path, *arguments: str, **environment: str) -> AsyncIterator[ServerProcess]:
    server = ServerProcess(data_dir, *arguments, **environment)
    await server.start()
    try:
        yield server
    finally:
        await server.stop()


class Talker:
    """One bare connection. It stores received messages in order, answers separate from events."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.events: list[dict[str, Any]] = []
        self._number = 1000

    async def receive(self, within: float = WITHIN) -> dict[str, Any]:
        async with asyncio.timeout(within):
            message: dict[str, Any] = json.loads(await self.socket.recv())
        return message

    async def raw(self, text: str | bytes) -> dict[str, Any]:
        """Send as it is and give the answer."""
        await self.socket.send(text)
        while "event" in (message := await self.receive()):
            self.events.append(message)
        return message

    async def request(self, name: str, args: Any = None, **more: Any) -> dict[str, Any]:
        self._number += 1
        message = {"id": self._number, "request": name} | ({} if args is None else {"args": args}) | more
        answer = await self.raw(json.dumps(message))
        assert (answer["id"], answer["response"]) == (self._number, name), answer
        return answer

    async def granted(self, name: str, args: Any = None) -> Any:
        answer = await self.request(name, args)
        assert answer["result"] is True, answer
        assert "messages" not in answer
        return answer.get("data")

    async def refused(self, name: str, args: Any = None) -> str:
        answer = await self.request(name, args)
        assert answer["result"] is False, answer
        (message,) = answer["messages"]
        return str(message)

    async def event(self, name: str, within: float = WITHIN) -> dict[str, Any]:
        """Give the next event, which must be of that name."""
        message = self.events.pop(0) if self.events else await self.receive(within)
        assert message.get("event") == name, message
        return message

    async def nothing_more(self) -> None:
        """Make sure that no event is under way: all that was sent before comes before this answer."""
        await self.request("SystemInfo")
        assert self.events == []


@contextlib.asynccontextmanager
async def talking(url: str, user: str | None = None, **options: Any) -> AsyncIterator[Talker]:
    """Connect, take the greeting, log in."""
    async with connect(url, compression=None, max_size=None, **options) as socket:
        talker = Talker(socket)
        await talker.event("ShowMainScreen")
        if user is not None:
            await talker.granted("RegisterUser", {"user_name": user})
        yield talker


async def until(condition: Any, within: float = WITHIN) -> None:
    """Poll with a deadline."""
    deadline = time.monotonic() + within
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        await asyncio.sleep(0.01)
