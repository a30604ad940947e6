"""Connections that are not admitted are limited in number and time; admitted clients are not affected."""

import asyncio
import contextlib
import errno
import functools
import socket
import ssl
from collections.abc import AsyncIterator, Callable, Coroutine
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest
import uvloop
from websockets.asyncio.client import connect

from arcor2_server.access.authority import CERTIFICATE, Authority
from arcor2_server.access.connection_limits import OWN_FILES, Connection, ConnectionLimits
from arcor2_server.settings import ServerSettings
from arcor2_server.web import http_server
from arcor2_server.web.http_server import Server, configuration
from arcor2_server.web.websocket_transport import EXTENSION, MAX_UNADMITTED_MESSAGE
from tests.server.core.serving import RawConnection, running, talking, until

TIMEOUT = 0.3
BIG = b"x" * 8_000_000
HEAD = b"GET / HTTP/1.1\r\nHost: localhost\r\n"


def on_uvloop(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """Run a test on the event loop that the server uses."""

    @functools.wraps(test)
    def run(**fixtures: Any) -> None:
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.run(test(**fixtures))

    return run


# ------------------------------------------------------------------------------------------------ counting
class Opened:
    """Connections that a test opens, with the addresses of those that were dropped."""

    def __init__(self, limits: ConnectionLimits) -> None:
        self.limits = limits
        self.dropped: list[Connection] = []

    def open(self, address: str = "10.0.0.7") -> Connection:
        connection = self.limits.open(address)
        assert connection is not None
        connection.drop = lambda: self.dropped.append(connection)
        return connection


def test_the_oldest_connection_of_an_address_is_closed_first() -> None:
    opened = Opened(ConnectionLimits(total=100, per_address=2))
    other, first, second = opened.open("10.0.0.8"), opened.open(), opened.open()
    assert opened.dropped == []
    third = opened.open()
    assert opened.dropped == [first]
    second.wait()  # it has been used, and now counts as the latest
    opened.open()
    assert opened.dropped == [first, third]
    other.close()
    other.close()
    assert len(opened.limits) == 2


def test_admitted_clients_are_never_dropped() -> None:
    opened = Opened(ConnectionLimits(total=8, per_address=100))
    admitted = [opened.open() for _ in range(3)]
    for connection in admitted:
        connection.admit()
    waiting = [opened.open("10.0.0.8") for _ in range(20)]
    assert opened.dropped == waiting[:15]
    assert len(opened.limits) == 8
    for connection in waiting[15:]:
        connection.admit()
    assert opened.limits.open("10.0.0.9") is None
    admitted[0].close()
    opened.open("10.0.0.9")


def test_some_connections_are_reserved_for_admitted_clients() -> None:
    opened = Opened(ConnectionLimits(total=8, per_address=100))
    for number in range(20):
        opened.open(f"10.0.0.{number}")
    assert len(opened.limits) == 6


def test_the_address_with_most_connections_is_closed_first() -> None:
    opened = Opened(ConnectionLimits(total=8, per_address=100))
    alone = opened.open("10.0.0.8")
    for _ in range(20):
        opened.open()
    assert alone not in opened.dropped


def test_a_proxy_may_have_many_connections() -> None:
    opened = Opened(ConnectionLimits(total=100, per_address=2, proxies=["10.1.0.0/16"]))
    for _ in range(5):
        opened.open("10.1.2.3")
    assert opened.dropped == []


def test_limits_follow_the_file_descriptors_of_the_system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for allowed, total in ((1024, 1024 - OWN_FILES), (100, 64), (-1, 4000), (1_000_000, 4000)):
        monkeypatch.setattr("resource.getrlimit", lambda _, allowed=allowed: (allowed, allowed))
        assert ConnectionLimits.of(ServerSettings(data_dir=tmp_path)).total == total
    assert ServerSettings(data_dir=tmp_path).connections_per_address >= 200


# ------------------------------------------------------------------------------------------------ a real listener
async def answer(scope: Any, receive: Any, send: Any) -> None:
    """Answer with the size of the request's body, or with many bytes; accept a websocket, and echo its messages."""
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.accept"})
        if scope["path"] == "/admitted":
            scope["extensions"][EXTENSION].admit()
        while (message := await receive())["type"] == "websocket.receive":
            await send({"type": "websocket.send", "text": str(len(message["text"]))})
    elif scope["type"] == "http":
        size, more = 0, True
        while more:
            message = await receive()
            size, more = size + len(message.get("body", b"")), message.get("more_body", False)
        body = BIG if scope["path"] == "/big" else str(size).encode()
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"%d" % len(body))]})
        await send({"type": "http.response.body", "body": body})


class Served:
    def __init__(self, port: int, limits: ConnectionLimits) -> None:
        self.port = port
        self.limits = limits
        self._sockets = contextlib.ExitStack()

    def silent(self, sent: bytes = b"") -> socket.socket:
        opened = self._sockets.enter_context(socket.create_connection(("127.0.0.1", self.port)))
        opened.sendall(sent)
        return opened

    def close(self) -> None:
        self._sockets.close()

    async def none_left(self) -> None:
        await until(lambda: not len(self.limits))


@contextlib.asynccontextmanager
async def served(
    tmp_path: Path,
    tls: bool = False,
    listener: socket.socket | None = None,
    request_timeout: float = TIMEOUT,
    **limits: Any,
) -> Any:
    settings = ServerSettings(data_dir=tmp_path, request_timeout=request_timeout)
    files = None
    if tls:
        authority = Authority(tmp_path, lambda: ["127.0.0.1", "localhost"])
        authority.renew()
        files = authority.files
    counted = ConnectionLimits(**{"total": 400, "per_address": 200, **limits})
    listener = listener or socket.socket()
    with listener:
        listener.bind(("127.0.0.1", 0))
        ready = asyncio.Event()
        server = Server(configuration(answer, settings, files), settings, counted, None, ready.set)
        serving = asyncio.create_task(server.serve(sockets=[listener]))
        await ready.wait()
        here = Served(listener.getsockname()[1], counted)
        try:
            yield here
        finally:
            here.close()
            server.end()
            await serving


async def ended(reader: asyncio.StreamReader) -> bool:
    """Wait until the server ends a connection."""
    with contextlib.suppress(ConnectionError):
        async with asyncio.timeout(30):
            while await reader.read(65536):
                pass
    return True


async def drips(port: int, first: bytes, drip: bytes = b"") -> bool:
    """Send some bytes, then single bytes with pauses, until the server ends the connection."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    ending = asyncio.create_task(ended(reader))
    try:
        writer.write(first)
        for number in range(100):
            if (await asyncio.wait({ending}, timeout=TIMEOUT / 10))[0]:
                return await ending
            writer.write(drip[number % len(drip) :][:1] if drip else b"")
        return False
    finally:
        ending.cancel()
        writer.close()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()


@on_uvloop
async def test_slow_requests_time_out(tmp_path: Path) -> None:
    websocket = HEAD + b"Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Key: "
    body = b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000\r\n\r\n"
    async with served(tmp_path) as here:
        ends = await asyncio.gather(
            drips(here.port, b""),
            drips(here.port, b"", drip=b"GET /" + b"x" * 1000),
            drips(here.port, HEAD, drip=b"a: b\r\n"),
            drips(here.port, websocket, drip=b"x"),
            drips(here.port, HEAD + b"\r\n", drip=b"\r\n"),
            drips(here.port, body, drip=b"x"),
        )
        assert ends == [True] * 6
        await here.none_left()


@on_uvloop
async def test_a_slow_but_steady_client_is_served(tmp_path: Path) -> None:
    timeout = 1.5
    async with (
        served(tmp_path, request_timeout=timeout) as here,
        httpx.AsyncClient(timeout=60, base_url=f"http://127.0.0.1:{here.port}") as http,
    ):

        async def slowly() -> AsyncIterator[bytes]:
            for _ in range(6):
                yield b"x" * 1000
                await asyncio.sleep(timeout / 5)

        assert (await http.post("/", content=slowly())).text == "6000"
        async with http.stream("GET", "/big") as taken:
            size = 0
            async for part in taken.aiter_raw():
                size += len(part)
                if size % 17 == 0:
                    await asyncio.sleep(0.03)
        assert size == len(BIG)


@on_uvloop
async def test_an_unread_answer_is_dropped(tmp_path: Path) -> None:
    async with served(tmp_path) as here:
        here.silent(b"GET /big HTTP/1.1\r\nHost: localhost\r\n\r\n")
        here.silent(b"GET /big HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        await until(lambda: len(here.limits) == 2)
        await here.none_left()


def test_clients_close_idle_connections_before_the_server(tmp_path: Path) -> None:
    kept_by_clients = httpx.Limits().keepalive_expiry
    assert kept_by_clients
    assert configuration(answer, ServerSettings(data_dir=tmp_path)).timeout_keep_alive >= 3 * kept_by_clients


@on_uvloop
async def test_a_flood_of_connections_blocks_no_admitted_client(tmp_path: Path) -> None:
    async with (
        served(tmp_path, request_timeout=3.0, per_address=10) as here,
        connect(f"ws://127.0.0.1:{here.port}/admitted") as client,
    ):
        for _ in range(50):
            here.silent()
        async with httpx.AsyncClient(timeout=60, base_url=f"http://127.0.0.1:{here.port}") as http:
            assert (await http.get("/")).text == "0"
        assert len(here.limits) <= 11
        await client.send("hello")
        assert await client.recv() == "5"


@on_uvloop
async def test_a_long_message_needs_an_admitted_client(tmp_path: Path) -> None:
    message = "x" * (MAX_UNADMITTED_MESSAGE + 1)
    async with served(tmp_path, request_timeout=3.0) as here, connect(f"ws://127.0.0.1:{here.port}/admitted") as client:
        await client.send(message)
        assert await client.recv() == str(len(message))
        async with connect(f"ws://127.0.0.1:{here.port}/") as stranger:
            await stranger.send(message[1:])
            assert await stranger.recv() == str(len(message) - 1)
            await stranger.send(message)
            await stranger.wait_closed()
            assert stranger.close_code == 1009


@on_uvloop
async def test_connections_are_counted_before_tls(tmp_path: Path) -> None:
    async with served(tmp_path, tls=True, request_timeout=3.0, per_address=10) as here:
        for _ in range(20):
            here.silent()
        trusting = ssl.create_default_context(cafile=str(tmp_path / CERTIFICATE))
        async with httpx.AsyncClient(timeout=60, base_url=f"https://127.0.0.1:{here.port}", verify=trusting) as http:
            assert (await http.get("/")).text == "0"
            assert len(here.limits) <= 10
        await here.none_left()


class NoFiles(socket.socket):
    """A listener that fails with EMFILE for its first connections."""

    tries = 0

    def accept(self) -> Any:
        self.tries += 1
        if self.tries < 4:
            raise OSError(errno.EMFILE, "Too many open files")
        return super().accept()


@on_uvloop
async def test_accepting_resumes_after_running_out_of_file_descriptors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(http_server, "ACCEPT_PAUSE", 0.02)
    async with (
        served(tmp_path, listener=NoFiles()) as here,
        httpx.AsyncClient(timeout=60, base_url=f"http://127.0.0.1:{here.port}") as http,
    ):
        assert (await http.get("/")).text == "0"


@on_uvloop
async def test_the_server_limits_only_clients_without_admission(tmp_path: Path) -> None:
    async with running(tmp_path / "data", ARCOR2_HW_CONNECTIONS="64", ARCOR2_HW_REQUEST_TIMEOUT="0.5") as server:
        here = Served(int(server.url.rpartition(":")[2]), ConnectionLimits(1, 1))
        process = psutil.Process(server.process.pid)
        try:
            async with talking(server.url, "ann") as ann:
                before = process.num_fds()
                for _ in range(200):
                    here.silent()
                async with talking(server.url, "bob") as bob:
                    await bob.granted("SystemInfo")
                await ann.granted("SystemInfo")
                assert process.num_fds() - before < 64
                await until(lambda: process.num_fds() <= before + 10)
                assert isinstance(ann, RawConnection)
                await ann.granted("SystemInfo")
        finally:
            here.close()
