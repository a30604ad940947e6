"""The websocket endpoint: admits clients, and decodes their requests."""

import asyncio
from typing import Any, Final

import msgspec
import structlog
from litestar import WebSocket

from arcor2_hw.data.rpc import Request
from arcor2_hw.exceptions import StorageError
from arcor2_hw.messages import Message
from arcor2_server.access.admission import Access, AccessRefused, address_of
from arcor2_server.audit.trail import AuditTrail
from arcor2_server.background import BackgroundTasks
from arcor2_server.collaboration.log_ons import LogOns
from arcor2_server.collaboration.users import Users
from arcor2_server.durations import Durations
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.damage_notices import DataDamage
from arcor2_server.web.websocket_transport import EXTENSION, WireProtocol
from arcor2_server.websocket.answers import Head, read_head
from arcor2_server.websocket.client import Client, CloseCode
from arcor2_server.websocket.dispatch import Dispatcher, refuse
from arcor2_server.websocket.hub import Hub
from arcor2_server.websocket.routes import AUTHENTICATE, Service

log = structlog.get_logger(__name__)

_TOKEN_NEEDED: Final = Message.of("A token is needed: send {request} first.", request=AUTHENTICATE)
AUTHENTICATION_TIMEOUT: Final = 10.0
"""Time limit for a client to send its token, s."""
MAX_AUTHENTICATION_MESSAGE: Final = 4096
"""Maximum length of a message from an unadmitted client, characters."""
TOKENS_PERIOD: Final = 2.0
"""Period of checking for revoked and expired tokens, s."""
_decode_request = msgspec.json.Decoder(Request).decode


class _SocketWire:
    """The transport of a client: the ASGI socket for closing, and its protocol for everything else."""

    def __init__(self, socket: WebSocket[Any, Any, Any], protocol: WireProtocol) -> None:
        self._socket = socket
        self.send = protocol.send_text
        self.send_now = protocol.send_text_now
        self.ping = protocol.ping
        self.admit = protocol.admit
        self.abort = protocol.abort

    async def close(self, code: int, reason: str) -> None:
        """Send a close frame."""
        try:
            await self._socket.send({"type": "websocket.close", "code": code, "reason": reason})
        except RuntimeError as error:
            raise ConnectionError("the connection is closed") from error


class Endpoint:
    """Serves all connections of one websocket service."""

    def __init__(
        self,
        service: Service,
        settings: ServerSettings,
        access: Access,
        hub: Hub,
        users: Users,
        damage: DataDamage,
        audit: AuditTrail,
        log_ons: LogOns,
    ) -> None:
        self.service = service
        self._settings = settings
        self._access = access
        self._hub = hub
        self._users = users
        self._damage = damage
        self._log_ons = log_ons
        self._dispatcher = Dispatcher(hub, audit, log_ons)
        self._requests = BackgroundTasks()
        self._watch: asyncio.Task[None] | None = None

    @property
    def durations(self) -> Durations:
        """Durations of the handled requests."""
        return self._dispatcher.durations

    async def serve(self, socket: WebSocket[Any, Any, Any]) -> None:
        """Serve a connection until it ends."""
        await socket.accept()
        if self._watch is None:
            self._watch = asyncio.create_task(self._watch_tokens(), name="tokens")
        protocol: Any = (socket.scope["extensions"] or {})[EXTENSION]
        address, service = address_of(socket), self.service
        client = Client(_SocketWire(socket, protocol), self._settings, address, service.greeting, service.events)
        writer = asyncio.create_task(client.write(), name=f"client {client.number} writes")
        log.info("client connected", client=client.number, address=address)
        deadline: asyncio.TimerHandle | None = None
        try:
            try:
                admission = self._access.admit(socket)
            except AccessRefused as error:
                client.close(CloseCode.NOT_ADMITTED, str(error))
                await writer
                return
            if admission.role is not None:
                client.admit(admission.role, admission.token)
                for event in client.greeting():
                    self._hub.send(client, event)
                self._hub.add(client, client.events)
            else:
                loop = asyncio.get_running_loop()
                deadline = loop.call_later(AUTHENTICATION_TIMEOUT, self._expect_admitted, client)
            await self._read(socket, client)
        finally:
            if deadline is not None:
                deadline.cancel()
            self._hub.remove(client)
            self._users.disconnected(client)
            client.lost()
            writer.cancel()
            await asyncio.gather(writer, return_exceptions=True)
            log.info("client disconnected", client=client.number, user=client.user)

    async def _watch_tokens(self) -> None:
        """Close the connections with invalid tokens, report a damaged token file, and apply changes of persons."""
        reported = self._access.damage
        while True:
            await asyncio.sleep(TOKENS_PERIOD)
            for client in tuple(self._hub.clients):
                try:
                    valid = client.token is None or self._access.valid(client.token)
                except StorageError as error:
                    log.error("tokens cannot be read", error=str(error))
                    break
                if not valid:
                    client.close(CloseCode.NOT_ADMITTED, "the token is no longer valid")
            try:
                await self._log_ons.refresh()
            except StorageError as error:
                log.error("persons cannot be read", error=str(error))
            if reported != (reported := self._access.damage) and reported:
                self._damage.report(reported)

    async def close(self) -> None:
        """Cancel the requests that are still being handled."""
        if self._watch is not None:
            self._watch.cancel()
            await asyncio.gather(self._watch, return_exceptions=True)
        await self._requests.cancel()

    @staticmethod
    def _expect_admitted(client: Client) -> None:
        if not client.admitted:
            client.close(CloseCode.NOT_ADMITTED, f"no token came within {AUTHENTICATION_TIMEOUT:g} s")

    async def _read(self, socket: WebSocket[Any, Any, Any], client: Client) -> None:
        receive = socket.receive
        served, in_flight = self._settings.served_size, self._settings.requests_in_flight
        mine: set[asyncio.Task[None]] = set()
        while True:
            message = await receive()
            if message["type"] != "websocket.receive":
                return
            text = message.get("text")
            if text is None:
                refuse(client, Head(), Message.of("Send requests as text messages."))
                continue
            if len(text) > served:
                long = Message.of("The message is longer than {limit} bytes: it was not read.", limit=served)
                refuse(client, read_head(text), long)
                continue
            if not client.admitted and len(text) > MAX_AUTHENTICATION_MESSAGE:
                refuse(client, Head(), _TOKEN_NEEDED)
                continue
            try:
                request = _decode_request(text)
            except (msgspec.DecodeError, RecursionError) as error:
                refuse(client, read_head(text), Message.of("This is not a valid request: {reason}.", reason=error))
                continue
            route = self.service.routes.get(request.request)
            if route is None:
                unknown = Message.of("Request {name!r} does not exist.", name=request.request)
                refuse(client, request, unknown, "unknown_request")
                continue
            if not client.admitted and request.request != AUTHENTICATE:
                refuse(client, request, _TOKEN_NEEDED, "token_needed")
                continue
            if route.cached is not None and self._dispatcher.answer_from_cache(client, request, route):
                continue
            if len(mine) >= in_flight:
                await asyncio.wait(mine, return_when=asyncio.FIRST_COMPLETED)
            task = self._requests.spawn(self._dispatcher.handle(client, request, route), request.request)
            mine.add(task)
            task.add_done_callback(mine.discard)
