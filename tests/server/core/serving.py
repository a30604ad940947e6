"""A real server process for tests, and bare websockets to it."""

import asyncio
import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import IO, Any

from websockets.asyncio.client import ClientConnection, connect

from tests import forked_children
from tests.forking import Forked, Forker, ended, readable
from tests.postgresql import variables

COMMAND = [sys.executable, "-m", "arcor2_server.cli.main"]
READY_TIMEOUT = 60.0
WITHIN = 30.0
"""Time limit for expected messages, s. Long, because only a failing test waits for all of it."""


_forker = Forker()
_MAIN = "arcor2_server.cli.main"
_IMPORTS = (
    *("arcor2_server.cli.serve", "arcor2_server.app", "arcor2_server.web.http_server"),
    "sqlalchemy.dialects.sqlite.aiosqlite",
    "tests.server.core.without_spare",
    forked_children.__name__,
)
_ANALYSIS = "analysis.msgpack"
_analyses: list[bytes] = []
"""The stored analysis of the installed object types, once a server has made it."""


def fork_server(
    data_dir: Path, *arguments: str, stderr: IO[bytes] | int, environment: Mapping[str, str] | None = None
) -> Forked | subprocess.Popen[bytes]:
    """Start `arcor2-hw serve` on a data directory, forked from a process that has imported it.

    The analysis of the installed object types takes a third of a start. A data directory without an analysis gets that
    of an earlier server, if `keep_analysis` was called with it. The server checks that it is valid.
    """
    if _analyses and not (data_dir / _ANALYSIS).exists():
        data_dir.mkdir(0o700, parents=True, exist_ok=True)
        (data_dir / _ANALYSIS).write_bytes(_analyses[0])
    serve = ("serve", "--data-dir", str(data_dir), *arguments)
    environment = {**(os.environ if environment is None else environment), **forked_children.environment()}
    return _forker.start(_MAIN, serve, _IMPORTS, stderr, environment)


def keep_analysis(data_dir: Path) -> None:
    """Keep the analysis of a server that is ready, for the servers that `fork_server` starts."""
    if not _analyses:
        _analyses.append((data_dir / _ANALYSIS).read_bytes())


class ServerProcess:
    """`arcor2-hw serve` as a child, forked from a process that has imported it."""

    forked = True
    """Whether to fork a process that has imported the server. False starts the real command."""

    def __init__(self, data_dir: Path, *arguments: str, **environment: str) -> None:
        self.data_dir = data_dir
        self.url = ""
        self._arguments = arguments
        self._environment = os.environ | variables(data_dir) | environment
        self._process: Forked | subprocess.Popen[bytes] | None = None
        self.log = data_dir.with_suffix(".log")

    @property
    def process(self) -> Forked | subprocess.Popen[bytes]:
        assert self._process is not None
        return self._process

    async def start(self) -> None:
        fresh = self.forked and not self.data_dir.exists()
        with self.log.open("wb") as log:
            if self.forked:
                self._process = fork_server(
                    self.data_dir, "--port", "0", *self._arguments, stderr=log, environment=self._environment
                )
            else:
                command = [*COMMAND, "serve", "--port", "0", "--data-dir", str(self.data_dir), *self._arguments]
                self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, env=self._environment)
        try:
            self.url = await self._ready()
        except BaseException:  # a server that has not started would not be stopped later
            self._process.kill()
            await self.ended()
            raise
        if fresh:
            keep_analysis(self.data_dir)

    async def _ready(self) -> str:
        assert self.process.stdout is not None
        line = b""
        try:
            async with asyncio.timeout(READY_TIMEOUT):
                while not line.endswith(b"\n"):
                    await readable(self.process.stdout.fileno())
                    if not (part := os.read(self.process.stdout.fileno(), 4096)):
                        break
                    line += part
        except TimeoutError:
            raise TimeoutError(f"not ready within {READY_TIMEOUT:g} s; its log: {self.log.read_text()}") from None
        assert line.startswith(b"ready "), self.log.read_text()
        return line.decode().split()[1]

    async def ended(self) -> int:
        """Wait until the process has ended."""
        status = await ended(self.process)
        assert self.process.stdout is not None
        self.process.stdout.close()
        return status

    async def stop(self) -> int:
        self.process.send_signal(signal.SIGTERM)
        async with asyncio.timeout(30):
            return await self.ended()


@contextlib.asynccontextmanager
async def running(data_dir: Path, *arguments: str, **environment: str) -> AsyncIterator[ServerProcess]:
    server = ServerProcess(data_dir, *arguments, **environment)
    await server.start()
    try:
        yield server
    finally:
        await server.stop()


class RawConnection:
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
        """Send a message unchanged and return the answer."""
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
        """Return the next event, which must have this name."""
        message = self.events.pop(0) if self.events else await self.receive(within)
        assert message.get("event") == name, message
        return message

    async def nothing_more(self) -> None:
        """Assert that no event is pending: all events sent earlier arrive before the answer of this request."""
        await self.request("SystemInfo")
        assert self.events == []


@contextlib.asynccontextmanager
async def talking(url: str, user: str | None = None, **options: Any) -> AsyncIterator[RawConnection]:
    """Connect, read the first messages, register a user."""
    async with connect(url, compression=None, max_size=None, **options) as socket:
        talker = RawConnection(socket)
        await talker.event("ShowMainScreen")
        if user is not None:
            await talker.granted("RegisterUser", {"user_name": user})
        yield talker


async def until(condition: Any, within: float = WITHIN) -> None:
    """Wait until the condition holds, or fail after a time limit."""
    deadline = time.monotonic() + within
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        await asyncio.sleep(0.01)
