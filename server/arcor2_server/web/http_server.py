"""The HTTP server: uvicorn, with connection limits that apply before the TLS handshake."""

import asyncio
import contextlib
import functools
import socket
import ssl
import sys
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any, Final, cast

import structlog
import uvicorn

from arcor2_server.access.connection_limits import Connection, ConnectionLimits
from arcor2_server.settings import ServerSettings
from arcor2_server.web.http_protocol import HttpProtocol
from arcor2_server.web.websocket_transport import WireProtocol

log = structlog.get_logger(__name__)

CLOSE_TIMEOUT: Final = 2
"""Time limit for open requests when the server stops, s. The whole stop must take at most 5 s."""
ACCEPTED_AT_ONCE: Final = 100
"""Number of connections accepted before the event loop continues."""
KEEP_ALIVE: Final = 20
"""Time after which an idle connection is closed, s.

It must be longer than the time for which clients keep idle connections (httpx 5 s, aiohttp 15 s). Otherwise a client
sends a request on a connection that the server is closing, and gets no answer.
"""
TLS_HANDSHAKE: Final = b"\x16"
"""First byte of a TLS connection (RFC 8446, 5.1). No HTTP request starts with it."""
ACCEPT_PAUSE: Final = 0.5
"""Time without accepting connections after the file descriptors were used up, s."""


def configuration(
    app: object, settings: ServerSettings, certificate: tuple[Path, Path] | None = None
) -> uvicorn.Config:
    """Return the configuration of uvicorn: one process, no compression, our websocket protocol."""
    return uvicorn.Config(
        app,  # type: ignore[arg-type]
        ws=WireProtocol,
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=list(settings.trusted_proxies),
        ws_max_size=settings.drained_size,
        ws_ping_interval=settings.ping_interval,
        ws_ping_timeout=settings.ping_interval,
        ws_per_message_deflate=False,
        timeout_keep_alive=KEEP_ALIVE,
        timeout_graceful_shutdown=CLOSE_TIMEOUT,
        ssl_certfile=certificate[0] if certificate else None,
        ssl_keyfile=certificate[1] if certificate else None,
    )


class Listener:
    """Accepts the connections of one socket within the limits. It replaces an asyncio.Server.

    Args:
        listener: the bound socket.
        limits: the connection limits.
        connected: creates the protocol of a connection.
        tls: TLS settings, None for plain TCP.
        handshake_timeout: time limit of the TLS handshake, s.
        plain: creates the protocol of a connection without TLS on a socket with TLS; None refuses such a connection.
        backlog: maximum number of connections that wait to be accepted.

    Raises:
        OSError: another program listens on the address.
    """

    def __init__(
        self,
        listener: socket.socket,
        limits: ConnectionLimits,
        connected: Callable[[Connection], asyncio.Protocol],
        tls: ssl.SSLContext | None,
        handshake_timeout: float,
        plain: Callable[[Connection], asyncio.Protocol] | None,
        backlog: int,
    ) -> None:

        self._socket, self._limits, self._connected, self._tls = listener, limits, connected, tls
        self._plain = plain if tls else None
        self._handshake_timeout = handshake_timeout
        self._loop = asyncio.get_running_loop()
        self._tasks: set[asyncio.Task[None]] = set()
        self._connecting: set[asyncio.Task[None]] = set()
        self._closed = False
        listener.setblocking(False)
        listener.listen(backlog)
        self._accept_again()

    def close(self) -> None:
        """Stop accepting connections. The owner of the socket closes it."""
        if not self._closed:
            self._closed = True
            self._loop.remove_reader(self._socket)
            for task in tuple(self._connecting):
                task.cancel()

    async def wait_closed(self) -> None:
        """Wait until no connection is being established."""
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _accept_again(self) -> None:
        if not self._closed:
            self._loop.add_reader(self._socket, self._accept)

    def _accept(self) -> None:
        for _ in range(ACCEPTED_AT_ONCE):
            try:
                accepted, peer = self._socket.accept()
            except (BlockingIOError, InterruptedError, ConnectionAbortedError):
                return
            except OSError as error:
                log.error("no connection can be accepted", reason=error.strerror, connections=len(self._limits))
                self._limits.make_room()
                self._loop.remove_reader(self._socket)
                self._loop.call_later(ACCEPT_PAUSE, self._accept_again)
                return
            accepted.setblocking(False)
            with contextlib.suppress(OSError):  # the client has disconnected already
                accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection = self._limits.open(str(peer[0]))
            if connection is None:
                accepted.close()
                continue
            connection.drop = accepted.close
            task = self._loop.create_task(self._connect(accepted, connection))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _connect(self, accepted: socket.socket, connection: Connection) -> None:
        """Perform the TLS handshake and hand the connection over to its protocol."""
        if self._closed or accepted.fileno() < 0:  # dropped meanwhile
            accepted.close()
            connection.close()
            return
        task = asyncio.current_task()
        assert task is not None
        connection.drop = task.cancel
        self._connecting.add(task)
        connected, tls = self._connected, self._tls
        try:
            if self._plain is not None and not await self._starts_tls(accepted):
                connected, tls = self._plain, None
            # From here on the event loop owns the socket and closes it in any case.
            await self._loop.connect_accepted_socket(
                lambda: connected(connection),
                accepted,
                ssl=tls,
                ssl_handshake_timeout=self._handshake_timeout if tls else None,
            )
        except OSError as error:  # includes ssl.SSLError and TimeoutError of the handshake
            log.debug("connection failed", address=connection.address, reason=str(error))
            connection.close()
        except BaseException:
            connection.close()
            raise
        finally:
            self._connecting.discard(task)

    async def _starts_tls(self, accepted: socket.socket) -> bool:
        """Wait for the first byte without consuming it, and return whether it starts a TLS handshake.

        Close the socket if it fails. Raise OSError if the client sends nothing.
        """
        readable: asyncio.Future[None] = self._loop.create_future()

        def ready() -> None:
            if not readable.done():
                readable.set_result(None)

        self._loop.add_reader(accepted, ready)
        try:
            async with asyncio.timeout(self._handshake_timeout):
                await readable
            first = accepted.recv(1, socket.MSG_PEEK)
            if not first:
                raise ConnectionResetError("the client has disconnected")
        except BaseException:
            self._loop.remove_reader(accepted)
            accepted.close()
            raise
        self._loop.remove_reader(accepted)
        return first == TLS_HANDSHAKE


class Server(uvicorn.Server):
    """The server of uvicorn with connection limits and a report when it is ready. The caller handles signals.

    Args:
        config: the configuration of uvicorn.
        settings: the settings of the server.
        limits: the connection limits.
        legacy: bound socket for clients without TLS.
        when_ready: called when the server is ready.
        plain: application for clients that use plain HTTP on a port with TLS; None refuses them.
    """

    def __init__(
        self,
        config: uvicorn.Config,
        settings: ServerSettings,
        limits: ConnectionLimits,
        legacy: socket.socket | None,
        when_ready: Callable[[], None],
        plain: object | None = None,
    ) -> None:
        super().__init__(config)
        self._plain = None
        if plain is not None:
            self._plain = configuration(plain, settings)
            self._plain.load()
        self._settings = settings
        self._limits = limits
        self._legacy = legacy
        self._when_ready = when_ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen on the sockets, and on the legacy socket without TLS; then print the address."""
        await super().startup(sockets=[])
        if not self.started or not sockets:
            return
        servers: list[Any] = [self._listen(each, self.config.ssl) for each in sockets]
        if self._legacy is not None:
            servers.append(self._listen(self._legacy, None))
        self.servers = servers
        scheme = "wss" if self.config.is_ssl else "ws"
        host = f"[{self._settings.host}]" if ":" in self._settings.host else self._settings.host
        sys.stdout.write(f"ready {scheme}://{host}:{sockets[0].getsockname()[1]}\n")
        sys.stdout.flush()
        self._when_ready()

    def _listen(self, listener: socket.socket, tls: ssl.SSLContext | None) -> Listener:
        timeout = self._settings.request_timeout

        def protocol(config: uvicorn.Config, connection: Connection) -> asyncio.Protocol:
            return HttpProtocol(
                config=config,
                server_state=self.server_state,
                app_state=cast("dict[str, Any]", self.lifespan.state),
                connection=connection,
                request_timeout=timeout,
            )

        connected = functools.partial(protocol, self.config)
        plain = functools.partial(protocol, self._plain) if self._plain else None
        return Listener(listener, self._limits, connected, tls, timeout, plain, self.config.backlog)

    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        """Do not handle signals. uvicorn would raise them again at the end, so the exit status would not be 0."""
        yield

    def end(self) -> None:
        """Stop the server in an orderly way."""
        self.should_exit = True
