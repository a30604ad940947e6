"""Sessions: trusted clients, users who are checked by the server, and the user of a call."""

import asyncio
import socket
from collections.abc import Awaitable, Callable
from contextvars import ContextVar
from typing import Any, Final

from asyncua import Server, ua
from asyncua.common.connection import TransportLimits
from asyncua.common.utils import Buffer, ServiceError
from asyncua.crypto.permission_rules import User as LibraryUser, UserRole
from asyncua.server.binary_server_asyncio import BinaryServer, OPCUAProtocol
from asyncua.server.internal_server import InternalServer
from asyncua.server.internal_session import InternalSession
from asyncua.server.uaprocessor import UaProcessor
from asyncua.ua.ua_binary import struct_from_binary

from arcor2_hw.opcua.certificates import TrustedClients
from arcor2_hw.opcua.messages import User
from arcor2_hw.opcua.monitored_devices import MonitoredDevices
from arcor2_hw.opcua.space import node_id

MIB: Final = 1024 * 1024
CHUNK: Final = 65535
MAX_CONNECTIONS: Final = 32
MAX_SUBSCRIPTIONS: Final = 128
MAX_QUEUED: Final = 1000
"""Maximum queue of a monitored item."""
MAX_MESSAGE: Final = 4 * MIB
LIMITS: Final = TransportLimits(CHUNK, CHUNK, MAX_MESSAGE // CHUNK + 1, MAX_MESSAGE)
_ACTIVATE: Final = node_id(ua.ObjectIds.ActivateSessionRequest_Encoding_DefaultBinary)
_CREATE: Final = node_id(ua.ObjectIds.CreateSessionRequest_Encoding_DefaultBinary)
_ACKNOWLEDGE: Final = node_id(ua.ObjectIds.AcknowledgeableConditionType_Acknowledge)
_READING: Final = frozenset(
    node_id(getattr(ua.ObjectIds, f"{name}Request_Encoding_DefaultBinary"))
    for name in (
        "Read", "Browse", "BrowseNext", "TranslateBrowsePathsToNodeIds", "RegisterNodes", "UnregisterNodes",
        "CreateSubscription", "ModifySubscription", "DeleteSubscriptions", "TransferSubscriptions", "SetPublishingMode",
        "CreateMonitoredItems", "ModifyMonitoredItems", "DeleteMonitoredItems", "SetMonitoringMode", "Publish",
        "Republish", "Call", "CloseSecureChannel",
    )
)  # fmt: skip
"""Services for users. Values are never written, and nodes never added."""

CheckUser = Callable[[str, str, str], Awaitable[User | None]]
"""Checks a user: name, PIN or token, address of the client."""
AcknowledgeCondition = Callable[[ua.NodeId, list[ua.Variant]], Awaitable[ua.StatusCode]]
caller: ContextVar["Caller | None"] = ContextVar("caller", default=None)
"""The client whose call is executed."""
_checked: ContextVar["Caller | None"] = ContextVar("checked", default=None)


class Caller(LibraryUser):
    """A client with its user; None for an anonymous client."""

    def __init__(self, user: User | None, address: str) -> None:
        super().__init__(UserRole.User, user.name if user else "anonymous")
        self.user, self.address = user, address


class Services:
    """Permits the services for reading and calls."""

    def check_validity(self, _user: LibraryUser, service: ua.NodeId, _body: Any) -> bool:
        """Return whether a service may be used."""
        return service in _READING


class Users:
    """Returns the user who was checked by the processor of the connection."""

    def get_user(self, _server: Any, username: Any = None, password: Any = None, certificate: Any = None) -> Any:  # noqa: ARG002
        """Return the checked user, None if the log-on is refused."""
        return _checked.get()


class Session(InternalSession):
    """A session that knows its user during calls, and gets current values.

    Values of devices are read only while clients want them. Nodes of points exist since they were read for the first
    time.
    """

    @property
    def _interest(self) -> MonitoredDevices:
        server: Any = self.iserver
        interest: MonitoredDevices = server.interest
        return interest

    async def read(self, params: ua.ReadParameters) -> list[ua.DataValue]:
        """Read values."""
        await self._interest.need(
            each.NodeId for each in params.NodesToRead if each.AttributeId == ua.AttributeIds.Value
        )
        return await super().read(params)

    async def browse(self, params: ua.BrowseParameters) -> list[ua.BrowseResult]:
        """Browse nodes."""
        await self._interest.need(each.NodeId for each in params.NodesToBrowse)
        return await super().browse(params)

    async def translate_browsepaths_to_nodeids(self, params: list[ua.BrowsePath]) -> list[ua.BrowsePathResult]:
        """Find nodes by browse names."""
        results = await super().translate_browsepaths_to_nodeids(params)
        if all(each.StatusCode.is_good() for each in results):
            return results
        await self._interest.need_all()
        return await super().translate_browsepaths_to_nodeids(params)

    async def create_monitored_items(
        self, params: ua.CreateMonitoredItemsParameters
    ) -> list[ua.MonitoredItemCreateResult]:
        """Monitor values or events."""
        await self._interest.need(each.ItemToMonitor.NodeId for each in params.ItemsToCreate)
        return await super().create_monitored_items(params)

    async def call(self, params: list[ua.CallMethodRequest]) -> list[ua.CallMethodResult]:
        """Call methods."""
        server: Any = self.iserver
        caller.set(self.user if isinstance(self.user, Caller) else None)
        results = []
        for request in params:
            if request.MethodId == _ACKNOWLEDGE:
                result = ua.CallMethodResult()
                result.StatusCode = await server.acknowledge(request.ObjectId, request.InputArguments or [])
                results.append(result)
            else:
                results += await super().call([request])
        return results


class Internal(InternalServer):
    """The internal server with limits, our sessions and our check of users.

    Args:
        trusted: the certificates of clients.
        check: checks a user.
        anonymous: whether clients without a user may read.
        unencrypted: whether sessions without encryption are permitted.
    """

    def __init__(self, trusted: TrustedClients, check: CheckUser, *, anonymous: bool, unencrypted: bool) -> None:
        super().__init__(user_manager=Users())  # type: ignore[arg-type]
        self.trusted, self.check, self.unencrypted = trusted, check, unencrypted
        self.acknowledge: AcknowledgeCondition
        self.interest: MonitoredDevices
        self.max_connections = MAX_CONNECTIONS
        self.max_subscriptions = MAX_SUBSCRIPTIONS
        self.max_monitored_item_queue_size = MAX_QUEUED
        self.bind_condition_methods = 1
        tokens = (ua.UserNameIdentityToken, ua.AnonymousIdentityToken)
        self.supported_tokens = tokens if anonymous else tokens[:1]  # type: ignore[assignment]

    def create_session(self, name: str, user: LibraryUser = LibraryUser(), external: bool = False) -> Session:  # noqa: B008
        """Return a new session."""
        return Session(self, self.aspace, self.subscription_service, name, user=user, external=external)


class Processor(UaProcessor):
    """Checks the certificate of the client and its user before the library handles the request."""

    async def _process_message(self, typeid: ua.NodeId, requesthdr: Any, seqhdr: Any, body: Buffer) -> Any:
        if typeid in (_CREATE, _ACTIVATE):
            self.check_channel()
        if typeid == _ACTIVATE:
            params = struct_from_binary(ua.ActivateSessionParameters, body.copy())
            _checked.set(await self._user(params.UserIdentityToken, requesthdr))
        return await super()._process_message(typeid, requesthdr, seqhdr, body)  # type: ignore[no-untyped-call]

    def check_channel(self) -> None:
        """Raise ServiceError unless sessions may use the channel.

        The library lets every client open a channel without encryption, which is meant for finding endpoints, and
        create a session on it.
        """
        server: Any = self.iserver
        policy = self._connection.security_policy
        if policy.Mode is ua.MessageSecurityMode.None_:
            if not server.unencrypted:
                raise ServiceError(ua.StatusCodes.BadSecurityPolicyRejected)
            return
        if not policy.peer_certificate or not server.trusted.admits(policy.peer_certificate):
            raise ServiceError(ua.StatusCodes.BadSecurityChecksFailed)

    async def _user(self, token: Any, requesthdr: Any) -> Caller | None:
        server: Any = self.iserver
        address = self.name[0] if self.name else ""
        if not isinstance(token, ua.UserNameIdentityToken):
            return Caller(None, address)  # the library refuses kinds of tokens that are not supported
        session = self.session or server.lookup_external_session(requesthdr.AuthenticationToken)
        try:
            name, secret = server.decrypt_user_token(session, token)
        except Exception:  # noqa: BLE001 - the content comes from the client
            raise ServiceError(ua.StatusCodes.BadIdentityTokenInvalid) from None
        user = await server.check(name or "", secret or "", address)
        return None if user is None else Caller(user, address)


class Protocol(OPCUAProtocol):
    """A connection with our processor."""

    def connection_made(self, transport: Any) -> None:
        """Handle a new connection."""
        super().connection_made(transport)
        if self.processor is not None:
            self.processor = Processor(self.iserver, transport, self.limits)
            self.processor.set_policies(self.policies)  # type: ignore[no-untyped-call]


class Listener(BinaryServer):
    """Listens on a socket that is bound already."""

    def __init__(self, internal: InternalServer, bound: socket.socket) -> None:
        host, port = bound.getsockname()[:2]
        super().__init__(internal, host, port, LIMITS)
        self._bound = bound

    def _make_protocol(self) -> Protocol:
        return Protocol(self.iserver, self._policies, self.clients, self.closing_tasks, self.limits)

    async def start(self) -> None:
        """Start to listen."""
        self._server = await asyncio.get_running_loop().create_server(self._make_protocol, sock=self._bound)
        self.cleanup_task = asyncio.create_task(self._close_task_loop())


class OpcUaServer(Server):
    """The server of the library on a socket that is bound already."""

    async def listen(self, bound: socket.socket) -> None:
        """Start to serve clients."""
        await self._setup_server_nodes()
        await self.iserver.start()
        self.bserver = Listener(self.iserver, bound)
        self.bserver.set_policies(self._policies)
        await self.bserver.start()
