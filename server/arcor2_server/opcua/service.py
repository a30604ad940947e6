"""Starts the process of the OPC UA server, and answers the requests of its clients."""

import socket
from importlib.metadata import version
from typing import Any, Final

import structlog

from arcor2_hw.opcua import messages as m
from arcor2_server.access.addresses import certified_hosts
from arcor2_server.alarms.service import Alarms
from arcor2_server.opcua.requests import PlantRequests
from arcor2_server.packml.cell import PackmlCell
from arcor2_server.plant.feed import CellFeed
from arcor2_server.plant.process import PlantProcess
from arcor2_server.settings import ServerSettings, is_loopback

log = structlog.get_logger(__name__)

NAME: Final = "OPC UA server"


class OpcUa:
    """The OPC UA server, if `serve` is called.

    Args:
        settings: settings of the server.
        feed: source of the data of the OPC UA server.
        requests: executes requests of its clients.
        cell: the cell; the plant can then have its authority.
        alarms: the alarms.
    """

    def __init__(
        self, settings: ServerSettings, feed: CellFeed, requests: PlantRequests, cell: PackmlCell, alarms: Alarms
    ) -> None:
        self._settings, self._feed, self._requests, self._cell = settings, feed, requests, cell
        self._alarms = alarms
        self.process: PlantProcess | None = None
        self.clients = 0
        """Number of connections of clients."""

    def serve(self, listener: socket.socket) -> None:
        """Start to serve clients on a bound socket. The process is started in the background."""
        listener.listen()  # clients wait while the process is not running
        self._cell.has_opcua = True
        self._reader = self._feed.reader(with_streams=False)
        self.process = PlantProcess(
            NAME,
            "arcor2_hw.opcua",
            self._reader,
            self._alarms,
            "opcua_ended",
            lambda: self._setup(listener),
            self._received,
        )
        self.process.start(inherited=(listener.fileno(),))

    async def close(self) -> None:
        """End the process."""
        if self.process is not None:
            await self.process.close()

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

    async def _received(self, body: bytes) -> m.LogOnAnswer | m.CallAnswer | None:
        match m.decode_from_process(body):
            case m.Started(fingerprint):
                self.clients = 0
                log.info("OPC UA server is ready", certificate=fingerprint)
                return None
            case m.Clients(count):
                self.clients = count
                return None
            case m.Watch(devices):
                self._reader.watch(devices)
                return None
            case request:
                return await self._answer(request)

    async def _answer(self, request: Any) -> m.LogOnAnswer | m.CallAnswer:
        try:
            match request:
                case m.LogOn():
                    return await self._requests.log_on(request)
                case m.Command():
                    return await self._requests.command(request)
                case m.SetMode():
                    return await self._requests.set_mode(request)
                case _:
                    return await self._requests.acknowledge(request)
        except Exception as error:
            log.exception("request of an OPC UA client failed", request=type(request).__name__)
            refused = m.CallAnswer(request.number, 8, f"An error inside the server: {error}")
            return m.LogOnAnswer(request.number, None) if isinstance(request, m.LogOn) else refused
