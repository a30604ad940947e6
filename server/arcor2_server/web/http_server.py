"""The HTTP server: uvicorn with connection limits that apply before TLS."""

import asyncio
import contextlib
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

GRACE: Final = 2
"""Time limit for open requests at the end of the server, s; the contract allows 5 for everything."""
ACCEPTED_AT_ONCE: Final = 100
"""Number of connections accepted before the event loop continues."""
PAUSE: Final = 0.5
"""Seconds without accepting after the system had no file descriptor for a connection."""


def configuration(
    app: object, settings: ServerSettings, certificate: tuple[Path, Path] | None = None
) -> uvicorn.Config:
    """Return uvicorn's configuration: one process, no compression, our websocket."""
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
        timeout_graceful_shutdown=GRACE,
        ssl_certfile=certificate[0] if certificate else None,
        ssl_keyfile=certificate[1] if certificate else None,
    )


class Listener:
    """Accepts the connections of one socket within the limits. It replaces an asyncio.Server.

    connected: creates the protocol of a connection.
    handshake_timeout: time limit of the TLS handshake, s.
    """

    def __init__(
        self,
        listener: socket.socket,
        limits: ConnectionLimits,
        connected: Callable[[Connection], asyncio.Protocol],
        tls: ssl.SSLContext | None,
        handshake_timeout: float,
        backlog: int,
    ) -> None:
        """Listen. OSError where another program listens there."""
        self._socket, self._limits, self._connected, self._tls = listener, limits, connected, tls
        self._handshake_timeout = handshake_timeout
        self._loop = asyncio.get_running_loop()
        self._tasks: set[asyncio.Task[None]] = set()
        self._connecting: set[asyncio.Task[None]] = set()
        self._closed = False
        listener.setblocking(False)
        listener.listen(backlog)
        self._accept_again()

    def close(self) -> None:
        """Accept nothing more; the socket is left to its owner."""
        if not self._closed:
            self._closed = True
            self._loop.remove_reader(self._socket)
            for task in tuple(self._connecting):
                task.cancel()

    async def wait_closed(self) -> None:
        """Return when no connection is being made any more."""
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
                self._loop.call_later(PAUSE, self._accept_again)
                return
            accepted.setblocking(False)
            with contextlib.suppress(OSError):  # the other side is gone again
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
        """Hand a connection over to its protocol, which has it when the TLS handshake is done."""
        if self._closed or accepted.fileno() < 0:  # dropped meanwhile
            accepted.close()
            connection.close()
            return
        task = asyncio.current_task()
        assert task is not None
        connection.drop = task.cancel
        self._connecting.add(task)
        try:
            # From here on the event loop owns the socket, and closes it whatever happens.
            await self._loop.connect_accepted_socket(
                lambda: self._connected(connection),
                accepted,
                ssl=self._tls,
                ssl_handshake_timeout=self._handshake_timeout if self._tls else None,
            )
        except OSError as error:  # a handshake that failed (ssl.SSLError) or took too long (TimeoutError), too
            log.debug("no connection came about", address=connection.address, reason=str(error))
            connection.close()
        except BaseException:
            connection.close()
            raise
        finally:
            self._connecting.discard(task)


class Server(uvicorn.Server):
    """The server of uvicorn, which reports when it is ready, limits connections, and leaves signals to the caller."""

    def __init__(
        self,
        config: uvicorn.Config,
        settings: ServerSettings,
        limits: ConnectionLimits,
        legacy: socket.socket | None,
        when_ready: Callable[[], None],
    ) -> None:
        super().__init__(config)
        self._settings = settings
        self._limits = limits
        self._legacy = legacy
        self._when_ready = when_ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen at the sockets, and at the one for legacy clients without TLS; then say where."""
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

        def connected(connection: Connection) -> asyncio.Protocol:
            return HttpProtocol(
                config=self.config,
                server_state=self.server_state,
                app_state=cast("dict[str, Any]", self.lifespan.state),
                connection=connection,
                request_timeout=timeout,
            )

        return Listener(listener, self._limits, connected, tls, timeout, self.config.backlog)

    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        """Leave the signals alone: uvicorn would raise them again at the end, and the status were not 0."""
        yield

    def end(self) -> None:
        """End in order."""
        self.should_exit = True
