"""Starts the process of the OPC UA server, restarts it if it ends, and exchanges messages with it."""

import asyncio
import socket
import time
from importlib.metadata import version
from typing import Any, Final

import structlog

from arcor2_hw.framing import PREFIX_SIZE, body_length
from arcor2_hw.opcua import messages as m
from arcor2_server.access.addresses import certified_hosts
from arcor2_server.background import BackgroundTasks
from arcor2_server.child_process import ChildProcess, describe_exit
from arcor2_server.opcua.feed import CellFeed
from arcor2_server.opcua.requests import PlantRequests
from arcor2_server.packml.cell import PackmlCell
from arcor2_server.settings import ServerSettings, is_loopback

log = structlog.get_logger(__name__)

COMMAND: Final = ("-P", "-m", "arcor2_hw.opcua")
PERIOD: Final = 0.1
"""Shortest time between two updates, s."""
MOST_UNSENT: Final = 256 * 1024
"""Number of unsent bytes above which changes are merged instead of sent."""
EXIT_TIMEOUT: Final = 3.0
"""Time limit for the process to end after its socket is closed, s."""
FIRST_PAUSE: Final = 0.5
LONGEST_PAUSE: Final = 30.0
"""Shortest and longest time before a restart, s. It doubles each time, until the process has run for LONGEST_PAUSE."""
EMPTY: Final = m.Update()


class OpcUa:
    """The OPC UA server, if `serve` is called.

    Args:
        settings: settings of the server.
        feed: what the OPC UA server shows.
        requests: executes requests of its clients.
        cell: the cell, whose authority may then be given to the plant.
    """

    def __init__(self, settings: ServerSettings, feed: CellFeed, requests: PlantRequests, cell: PackmlCell) -> None:
        self._settings, self._feed, self._requests, self._cell = settings, feed, requests, cell
        self._background = BackgroundTasks()

    def serve(self, listener: socket.socket) -> None:
        """Start to serve clients on a bound socket. The process is started in the background."""
        listener.listen()  # clients wait while the process is not running
        self._cell.has_opcua = True
        self._feed.start()
        self._background.spawn(self._keep_running(listener), "OPC UA server")

    async def close(self) -> None:
        """End the process."""
        await self._background.cancel()

    async def _keep_running(self, listener: socket.socket) -> None:
        pause = FIRST_PAUSE
        while True:
            started = time.monotonic()
            try:
                await self._run(listener)
            except OSError as error:
                log.error("OPC UA server not started", reason=str(error))
            pause = FIRST_PAUSE if time.monotonic() - started > LONGEST_PAUSE else min(2.0 * pause, LONGEST_PAUSE)
            await asyncio.sleep(pause)

    async def _run(self, listener: socket.socket) -> None:
        """Run the process until it ends. Raise OSError if it cannot be started."""
        ours, theirs = socket.socketpair()
        reader, writer = await asyncio.open_unix_connection(sock=ours)
        tasks = BackgroundTasks()
        process = None
        try:
            process = await ChildProcess.start(COMMAND, theirs, inherited=(listener.fileno(),))
            log.info("OPC UA server starts", pid=process.pid)
            writer.write(m.encode(self._setup(listener)))
            tasks.spawn(self._log_output(process), "output of the OPC UA server")
            sending = tasks.spawn(self._send(writer), "updates of the OPC UA server")
            sending.add_done_callback(lambda _: writer.transport.abort())
            await self._receive(reader, writer, tasks)
        except (asyncio.IncompleteReadError, ConnectionError):
            pass  # the process has ended
        finally:
            writer.transport.abort()
            if process is not None:
                status = await process.wait_or_kill(EXIT_TIMEOUT)
                write = log.warning if status else log.info
                write("OPC UA server ended", pid=process.pid, status=str(describe_exit(status)))
            await tasks.cancel()

    def _setup(self, listener: socket.socket) -> m.Setup:
        settings, machine = self._settings, socket.gethostname()
        assert settings.opcua is not None
        local = is_loopback(settings.opcua.host)
        return m.Setup(
            listener=listener.fileno(),
            host=settings.opcua.host,
            port=listener.getsockname()[1],
            machine=machine,
            hosts=certified_hosts(settings.opcua.host),
            folder=str(settings.data_dir.absolute()),
            cell=machine,
            version=version("arcor2-hw"),
            anonymous=settings.opcua.anonymous or (local and self._requests.open_to_all),
            unencrypted=settings.opcua.unencrypted or local,
        )

    # -------------------------------------------------------------------------------- messages
    async def _send(self, writer: asyncio.StreamWriter) -> None:
        """Send the state of the cell, then changes. A slow process gets merged changes, never a queue of them."""
        writer.write(m.encode(await self._feed.everything()))
        sent = time.monotonic()
        while True:
            await asyncio.sleep(PERIOD)
            if writer.is_closing():
                return
            if writer.transport.get_write_buffer_size() > MOST_UNSENT:
                continue
            update = await self._feed.changes()
            if update != EMPTY or time.monotonic() - sent > m.BEAT_PERIOD:
                writer.write(m.encode(update))
                sent = time.monotonic()

    async def _receive(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, tasks: BackgroundTasks
    ) -> None:
        while True:
            size = body_length(await reader.readexactly(PREFIX_SIZE), m.MAX_MESSAGE)
            match m.decode_from_process(await reader.readexactly(size)):
                case m.Started(fingerprint):
                    log.info("OPC UA server is ready", certificate=fingerprint)
                case request:
                    tasks.spawn(self._answer(request, writer), "request of an OPC UA client")

    async def _answer(self, request: Any, writer: asyncio.StreamWriter) -> None:
        answer: m.LogOnAnswer | m.CallAnswer
        try:
            match request:
                case m.LogOn():
                    answer = await self._requests.log_on(request)
                case m.Command():
                    answer = await self._requests.command(request)
                case _:
                    answer = await self._requests.acknowledge(request)
        except Exception as error:
            log.exception("request of an OPC UA client failed", request=type(request).__name__)
            refused = m.CallAnswer(request.number, 8, f"An error inside the server: {error}")
            answer = m.LogOnAnswer(request.number, None) if isinstance(request, m.LogOn) else refused
        if not writer.is_closing():
            writer.write(m.encode(answer))

    async def _log_output(self, process: ChildProcess) -> None:
        async for line in process.output():
            log.info("OPC UA server output", pid=process.pid, text=line)
