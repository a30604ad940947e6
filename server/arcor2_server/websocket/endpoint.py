"""The websocket endpoint: decodes requests, calls their handlers and answers each message."""

import asyncio
import logging
import secrets
from collections.abc import Callable, Mapping
from typing import Any, Final
from weakref import WeakKeyDictionary

import msgspec
import structlog
from litestar import WebSocket
from msgspec import UNSET, Struct
from msgspec.structs import replace

from arcor2_hw.data.events import Event
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS, Request, Response, Rpc
from arcor2_hw.data.texts import SHORTEST, check_texts
from arcor2_hw.exceptions import Arcor2Error, StorageError, TextTooLong
from arcor2_hw.messages import Message
from arcor2_server.access.admission import Access, AccessRefused, address_of
from arcor2_server.collaboration.users import Users
from arcor2_server.errors import RequestRefused
from arcor2_server.events import encode
from arcor2_server.log import audit
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.damage_notices import DataDamage
from arcor2_server.web.websocket_transport import EXTENSION, WireProtocol
from arcor2_server.websocket.client import Client, CloseCode
from arcor2_server.websocket.hub import Hub
from arcor2_server.websocket.request import CachedAnswer, Context, Handler

log = structlog.get_logger(__name__)

AUTHENTICATE: Final = "Authenticate"
"""The only request that is served before a client is admitted."""
AUTHENTICATE_WITHIN: Final = 10.0
"""Time limit for a client to send its token, s."""
LONGEST_AUTHENTICATION: Final = 4096
"""Maximum length of a message from an unadmitted client, characters."""
TOKENS_PERIOD: Final = 2.0
"""Period of checking for revoked and expired tokens, s."""
UNREADABLE: Final = "Error"
"""Request name in the answer to an unreadable message."""
LONGEST_NAME: Final = 200
"""Maximum length of an unknown request name in an answer, characters."""
LONGEST_REASON: Final = 4000
"""Maximum length of the message of a refusal, characters. It may quote the request."""
_decode_request = msgspec.json.Decoder(Request).decode
_decode_anything = msgspec.json.Decoder().decode


class _Head(Struct):
    """Id and name of a message that is refused, as far as they are readable."""

    id: int = 0
    request: str = UNREADABLE


class _CompleteHead(Struct):
    id: int
    request: str


_decode_head = msgspec.json.Decoder(_CompleteHead).decode


class Route(Struct, frozen=True):
    """A request of the protocol, its handler, its cached answer and the decoder of its arguments."""

    rpc: Rpc
    handler: Handler | None
    cached: CachedAnswer | None
    decode: Any
    default: Any
    """Default of the arguments; UNSET if they are required."""


def routes(handlers: Mapping[str, Handler], cached: Mapping[str, CachedAnswer]) -> dict[str, Route]:
    """Return a route for each request of the protocol. Requests without a handler are refused."""
    table = {}
    for name, rpc in RPCS.items():
        default: Any = None
        if rpc.args is not None:
            default = UNSET
            if rpc.args_optional:
                is_struct = isinstance(rpc.args, type) and issubclass(rpc.args, Struct)
                default = rpc.args() if is_struct else None
        decode = None if rpc.args is None else msgspec.json.Decoder(rpc.args).decode
        table[name] = Route(rpc, handlers.get(name), cached.get(name), decode, default)
    return table


class Service(Struct, frozen=True):
    """A websocket service."""

    routes: dict[str, Route]
    """The requests by name."""
    greeting: Callable[[], list[Event]]
    """Returns the first events for a client."""
    events: frozenset[str] | None = None
    """Names of the events that clients receive, None for all."""


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
    ) -> None:
        self.service = service
        self._settings = settings
        self._access = access
        self._hub = hub
        self._users = users
        self._damage = damage
        self._tasks: set[asyncio.Task[None]] = set()
        self._watch: asyncio.Task[None] | None = None
        self._holds: WeakKeyDictionary[Client, tuple[str, str, int, str]] = WeakKeyDictionary()
        """The last logged hold-to-run request of each client."""

    async def serve(self, socket: WebSocket[Any, Any, Any]) -> None:
        """Serve a connection until it ends."""
        await socket.accept()
        if self._watch is None:
            self._watch = asyncio.create_task(self._watch_tokens(), name="tokens")
        protocol: Any = (socket.scope["extensions"] or {})[EXTENSION]
        client = Client(_SocketWire(socket, protocol), self._settings)
        writer = asyncio.create_task(client.write(), name=f"client {client.number} writes")
        address = address_of(socket)
        log.info("client connected", client=client.number, address=address)
        deadline: asyncio.TimerHandle | None = None
        try:
            try:
                admission = self._access.admit(socket)
            except AccessRefused as error:
                client.close(CloseCode.NOT_ADMITTED, str(error))
                await writer
                return
            client.address = address
            client.greeting = self.service.greeting
            client.events = self.service.events
            if admission.role is not None:
                client.admit(admission.role, admission.token)
                for event in client.greeting():
                    self._hub.send(client, event)
                self._hub.add(client, client.events)
            else:
                loop = asyncio.get_running_loop()
                deadline = loop.call_later(AUTHENTICATE_WITHIN, self._expect_admitted, client)
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
        """Close the connections with invalid tokens, and report a damaged token file."""
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
                    client.close(CloseCode.NOT_ADMITTED, "the token is not valid any more")
            if reported != (reported := self._access.damage) and reported:
                self._damage.report(reported)

    async def close(self) -> None:
        """Cancel the requests that are still being handled."""
        if self._watch is not None:
            self._watch.cancel()
            await asyncio.gather(self._watch, return_exceptions=True)
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    @staticmethod
    def _expect_admitted(client: Client) -> None:
        if not client.admitted:
            client.close(CloseCode.NOT_ADMITTED, f"no token came within {AUTHENTICATE_WITHIN:g} s")

    async def _read(self, socket: WebSocket[Any, Any, Any], client: Client) -> None:
        receive = socket.receive
        create_task = asyncio.get_running_loop().create_task
        served, in_flight = self._settings.served_size, self._settings.requests_in_flight
        mine: set[asyncio.Task[None]] = set()
        while True:
            message = await receive()
            if message["type"] != "websocket.receive":
                return
            text = message.get("text")
            if text is None:
                self._refuse(client, _Head(), "Send requests as text messages.")
                continue
            if len(text) > served:
                self._refuse(client, _read_head(text), f"The message is longer than {served} bytes: it was not read.")
                continue
            if not client.admitted and len(text) > LONGEST_AUTHENTICATION:
                self._refuse(client, _Head(), f"A token is needed: send {AUTHENTICATE} first.")
                continue
            try:
                request = _decode_request(text)
            except (msgspec.DecodeError, RecursionError) as error:
                self._refuse(client, _read_head(text), f"This is not a valid request: {error}.")
                continue
            route = self.service.routes.get(request.request)
            if route is None:
                self._refuse(client, request, f"There is no request {request.request!r}.", "unknown_request")
                continue
            if not client.admitted and request.request != AUTHENTICATE:
                self._refuse(client, request, f"A token is needed: send {AUTHENTICATE} first.", "token_needed")
                continue
            if route.cached is not None and self._answer_from_cache(client, request, route):
                continue
            if len(mine) >= in_flight:
                await asyncio.wait(mine, return_when=asyncio.FIRST_COMPLETED)
            task = create_task(self._handle(client, request, route))
            for held in (mine, self._tasks):
                held.add(task)
                task.add_done_callback(held.discard)

    def _answer_from_cache(self, client: Client, request: Request, route: Route) -> bool:
        """Send the cached answer if there is one; return whether it was sent."""
        if client.role < route.rpc.role or route.cached is None:
            return False
        try:
            data = route.cached()
        except Exception:
            # The handler will meet the same error and report it.
            log.exception("cached answer failed", request=request.request)
            return False
        if data is not None:
            client.put(encode(Response(request.id, request.request, True, UNSET, data)))
        return data is not None

    async def _handle(self, client: Client, request: Request, route: Route) -> None:
        try:
            await self._run(client, request, route)
        except asyncio.CancelledError:
            raise
        except Exception:
            reference = secrets.token_hex(4)
            log.exception("request failed", request=request.request, reference=reference, user=client.user)
            message = f"An error inside the server: see its log, reference {reference}."
            self._refuse(client, request, message, "internal")

    async def _run(self, client: Client, request: Request, route: Route) -> None:
        rpc = route.rpc
        if client.role < rpc.role:
            needed = f"{rpc.name} needs the role {Role(rpc.role).name.lower()} or a higher one."
            self._refuse(client, request, needed, "forbidden")
            self._note("forbidden", client, rpc, UNSET)
            return
        args = route.default
        if route.decode is not None:
            if not isinstance(request.args, msgspec.UnsetType):
                try:
                    args = route.decode(request.args)
                    if len(request.args) > SHORTEST:
                        check_texts(args)
                except TextTooLong as error:
                    self._refuse(client, request, f"The arguments of {rpc.name} are wrong: {error}", error.code)
                    return
                except (msgspec.DecodeError, RecursionError) as error:
                    wrong = f"The arguments of {rpc.name} are wrong: {error}."
                    self._refuse(client, request, wrong, "invalid_arguments")
                    return
            elif args is UNSET:
                self._refuse(client, request, f"The arguments of {rpc.name} are missing.", "invalid_arguments")
                return
        if route.handler is None:
            self._refuse(client, request, f"{rpc.name} is not available in this version.", "not_available")
            return
        context = Context(client, request.dry_run and rpc.dry_run, rpc.name)
        try:
            data = await route.handler(context, args)
        except RequestRefused as error:
            # A refusal with data means that a part of the request was done, so its events are sent.
            partly_done = error.data is not UNSET
            self._answer(client, request, context if partly_done else None, error.data, error)
            self._note("refused", client, rpc, args, dry_run=context.dry_run)
            return
        except Arcor2Error as error:
            if error.detail:
                log.info("request refused", request=rpc.name, reason=_shortened(str(error)), detail=error.detail)
            self._refuse(client, request, error.message, error.code)
            self._note("refused", client, rpc, args, dry_run=context.dry_run)
            return
        self._answer(client, request, context, UNSET if data is None else data)
        self._note("done", client, rpc, args, dry_run=context.dry_run)

    def _note(self, outcome: str, client: Client, rpc: Rpc, args: Any, *, dry_run: bool = False) -> None:
        """Log a command, or any request refused by role. A hold-to-run request is logged once, not on each renewal."""
        if outcome != "forbidden" and (dry_run or not audit.is_command(rpc)):
            return
        if (hold := getattr(args, "hold", None)) is not None:
            logged = (rpc.name, args.robot_id, hold, outcome)
            if self._holds.get(client) == logged:
                return
            self._holds[client] = logged
        target = audit.target_of(args)
        audit.note(outcome, rpc.name, user=client.name, role=client.role, address=client.address, target=target)

    def _answer(
        self,
        client: Client,
        request: Request,
        context: Context | None,
        data: Any,
        error: RequestRefused | None = None,
    ) -> None:
        response = Response(request.id, request.request, error is None, data=data)
        if error is not None:
            response = replace(response, messages=[_shortened(str(error))])
            if request.codes:
                response = replace(response, code=error.code, **_translation(error.message))
        answer = encode(response)
        if context is None:
            client.put(answer)
            return
        broadcast = self._hub.broadcast
        for event in context.events_before:
            broadcast(event)
        client.put(answer)
        for event in context.events_to_caller:
            self._hub.send(client, event)
        for event in context.events_after:
            broadcast(event)

    def _refuse(self, client: Client, request: "Request | _Head", message: str | Message, code: str = "") -> None:
        name = request.request if len(request.request) <= LONGEST_NAME else UNREADABLE
        text = _shortened(str(message))
        if log.is_enabled_for(logging.DEBUG):
            log.debug("refused", client=client.number, request=name, message=text)
        try:
            response = Response(request.id, name, False, [text])
            if isinstance(request, Request) and request.codes:
                translation = _translation(message) if isinstance(message, Message) else {}
                response = replace(response, code=code or UNSET, **translation)
            answer = encode(response)
        except UnicodeEncodeError:
            # A name with half a surrogate pair can be read but not sent back.
            answer = encode(Response(request.id, UNREADABLE, False, [ascii(text)]))
        client.put(answer)


def _translation(message: Message) -> dict[str, Any]:
    """Return key and values of a message that is not shortened."""
    return message.translation() if len(message.text) <= LONGEST_REASON else {}


def _shortened(message: str) -> str:
    return message if len(message) <= LONGEST_REASON else message[:LONGEST_REASON] + " …"


def _read_head(text: str) -> _Head:
    """Return the id and name of a message that is invalid or too long, as far as they are readable."""
    try:
        readable = _decode_head(text)
    except (msgspec.DecodeError, RecursionError):
        pass
    else:
        return _Head(readable.id, readable.request)
    try:
        content = _decode_anything(text)
    except (msgspec.DecodeError, RecursionError):
        return _Head()
    if not isinstance(content, dict):
        return _Head()
    number, name = content.get("id"), content.get("request")
    if not isinstance(number, int) or isinstance(number, bool):
        return _Head()
    return _Head(number, name if isinstance(name, str) else UNREADABLE)
