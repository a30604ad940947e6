"""`arcor2-hw serve`: the server, until it is told to end."""

import asyncio
import contextlib
import errno
import fcntl
import gc
import importlib
import signal
import socket
import sys
from collections.abc import Callable, Generator
from pathlib import Path
from typing import IO, Annotated

import uvicorn
import uvloop
from cyclopts import Parameter, validators

from arcor2_hw.data.cell import read_cell
from arcor2_hw.exceptions import Arcor2Error, InvalidData, NotFound, StorageError
from arcor2_server import logging as server_logging
from arcor2_server.cli.status import ExitStatus
from arcor2_server.settings import ServerSettings

GRACE = 2
"""Seconds that open requests get to end; the contract allows 5 for everything."""


class CannotServe(Exception):
    """The server cannot start, for a reason that a person can do something about."""

    def __init__(self, status: ExitStatus, reason: str) -> None:
        super().__init__(reason)
        self.status = status


def serve(
    *,
    host: str | None = None,
    port: Annotated[int | None, Parameter(validator=validators.Number(gte=0, lte=65535))] = None,
    data_dir: Path | None = None,
    cell: Path | None = None,
    log_level: str = "info",
) -> int:
    """Serve the websocket and REST interfaces until SIGTERM or Ctrl-C.

    Prints `ready <url>` on standard output when requests are accepted.

    Parameters
    ----------
    host
        Address to listen on (127.0.0.1): other machines reach the server only on an address of the network.
    port
        Port to listen on (6789); 0 takes any free one, which `ready` then tells.
    data_dir
        Where scenes, projects and packages are kept ($XDG_DATA_HOME/arcor2-hw); created when missing.
    cell
        A cell.yaml whose settings of devices win over those of scenes and packages, by the objects' names.
    log_level
        What is logged on standard error: debug, info, warning or error.
    """
    # Start-up makes much that stays and little that goes: collecting would only look at it again and again.
    gc.disable()
    try:
        here = None if cell is None else read_cell(cell)
    except Arcor2Error as error:
        sys.stderr.write(f"arcor2-hw serve: {' '.join(str(error).split())}\n")
        return ExitStatus.NOT_FOUND if isinstance(error, NotFound) else ExitStatus.CELL_UNUSABLE
    try:
        settings = ServerSettings.from_environment(host=host, port=port, data_dir=data_dir, cell=here)
        server_logging.set_up(log_level)
    except (InvalidData, KeyError) as error:
        sys.stderr.write(f"arcor2-hw serve: {error}\n")
        return ExitStatus.USAGE
    try:
        with (
            data_directory(settings.data_dir),
            contextlib.closing(listen(settings.host, settings.port)) as listener,
            asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner,
        ):
            runner.run(run(settings, listener))
    except CannotServe as error:
        sys.stderr.write(f"arcor2-hw serve: {error}\n")
        return error.status
    except StorageError as error:
        sys.stderr.write(f"arcor2-hw serve: {error}\n")
        return ExitStatus.DATABASE_UNUSABLE
    return ExitStatus.OK


async def run(settings: ServerSettings, listener: socket.socket) -> None:
    """Serve at a socket that is bound. StorageError when the data cannot be used."""
    from arcor2_server.app import create_app, running_services

    async with running_services(settings) as services:

        def when_ready() -> None:
            gc.freeze()
            gc.enable()
            services.cell.hosts.prepare()
            loop.run_in_executor(None, importlib.import_module, "transforms3d.quaternions")

        loop = asyncio.get_running_loop()
        server = Server(configuration(create_app(services), settings), settings.host, when_ready)
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, server.end)
        try:
            await server.serve(sockets=[listener])
        except OSError as error:
            # Between our bind and this, another program began to listen there.
            if error.errno != errno.EADDRINUSE:
                raise
            raise _no_port(settings.host, listener.getsockname()[1], error) from error


def configuration(app: object, settings: ServerSettings) -> uvicorn.Config:
    """Give uvicorn's configuration: one process, no compression, our websocket."""
    from arcor2_server.wire import WireProtocol

    return uvicorn.Config(
        app,  # type: ignore[arg-type]
        ws=WireProtocol,
        http="httptools",
        log_config=None,
        access_log=False,
        server_header=False,
        ws_max_size=settings.drained_size,
        ws_ping_interval=settings.ping_interval,
        ws_ping_timeout=settings.ping_interval,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=GRACE,
    )


class Server(uvicorn.Server):
    """uvicorn's server, which says when it is ready and leaves signals to us."""

    def __init__(self, config: uvicorn.Config, host: str, when_ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._host = host
        self._when_ready = when_ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start, then say where."""
        await super().startup(sockets=sockets)
        if self.started and sockets:
            host = f"[{self._host}]" if ":" in self._host else self._host
            sys.stdout.write(f"ready ws://{host}:{sockets[0].getsockname()[1]}\n")
            sys.stdout.flush()
            self._when_ready()

    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        """Leave the signals alone: uvicorn would raise them again at the end, and the status were not 0."""
        yield

    def end(self) -> None:
        """End in order."""
        self.should_exit = True


@contextlib.contextmanager
def data_directory(directory: Path) -> Generator[IO[bytes], None, None]:
    """Make sure that the directory is there, can be written, and is ours alone. CannotServe."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        lock = (directory / "lock").open("ab")
    except OSError as error:
        reason = f"the data directory {directory} cannot be used: {error.strerror}"
        raise CannotServe(ExitStatus.DATA_UNUSABLE, reason) from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            reason = f"the data directory {directory} is in use by another server"
            raise CannotServe(ExitStatus.DATA_IN_USE, reason) from error
        yield lock


def listen(host: str, port: int) -> socket.socket:
    """Give a socket that is bound; uvicorn listens at it once everything is up. CannotServe."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listener = socket.socket(family, kind, protocol)
    except OSError as error:
        raise CannotServe(ExitStatus.PORT_TAKEN, f"cannot listen on {host}: {error.strerror}") from error
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.set_inheritable(False)
        listener.setblocking(False)
    except OSError as error:
        listener.close()
        raise _no_port(host, port, error) from error
    return listener


def _no_port(host: str, port: int, error: OSError) -> CannotServe:
    if error.errno == errno.EADDRINUSE:
        return CannotServe(ExitStatus.PORT_TAKEN, f"port {port} of {host} is taken by another program")
    return CannotServe(ExitStatus.PORT_TAKEN, f"cannot listen on port {port} of {host}: {error.strerror}")
