"""Requests about the server, registration and event subscriptions."""

import functools
from dataclasses import dataclass
from typing import Any, Final

from msgspec import Raw

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.events import EVENTS
from arcor2_hw.data.interlocks import InterlockStates
from arcor2_hw.data.rpc import (
    AuthenticateArgs,
    AuthenticateData,
    CellInfo,
    RegisterUserArgs,
    SubscribeEventsArgs,
    SystemInfoData,
)
from arcor2_server.access.admission import LOG_ON_NEEDED, Access, TooManyAttempts
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.log_ons import LogOns
from arcor2_server.collaboration.persons import Persons
from arcor2_server.collaboration.presence import PresenceBoard
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.collaboration.users import Users
from arcor2_server.documents import Session
from arcor2_server.documents.edit_notifications import EditNotifications
from arcor2_server.errors import LogOnNeeded, RequestRefused
from arcor2_server.events import encode, make_event
from arcor2_server.execution.service import Execution
from arcor2_server.nodes.board import NodeBoard
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.registry import DECLARED, Context, cached, rpc
from arcor2_server.settings import API_VERSION, VERSION, ServerSettings
from arcor2_server.websocket.client import Client, CloseCode
from arcor2_server.websocket.hub import Hub
from arcor2_server.workspace.object_aiming import ObjectAimings
from arcor2_server.workspace.reachability import ReachabilityBoard

PARAMETER_TYPES: Final = (
    "boolean",
    "double",
    "image",
    "integer",
    "integer_enum",
    "joints",
    "pose",
    "position",
    "string",
    "string_enum",
)


@functools.lru_cache(maxsize=1)
def _system_info(_handlers: int, name: str, fleet: str) -> Raw:
    """Encode the answer once per number of handlers, which is constant after all modules are imported."""
    cell = CellInfo(name, fleet or UNSET) if name else UNSET
    return Raw(encode(SystemInfoData(VERSION, API_VERSION, set(PARAMETER_TYPES), set(DECLARED), cell)))


@dataclass(frozen=True, slots=True)
class GeneralRequests:
    """Requests about the server, registration and event subscriptions."""

    _access: Access
    _persons: Persons
    _log_ons: LogOns
    _hub: Hub
    _users: Users
    _locks: Locks
    _session: Session
    _online: OnlineScene
    _execution: Execution
    _object_aiming: ObjectAimings
    _tasks: Tasks
    _presence: PresenceBoard
    _edit_notifications: EditNotifications
    _reachability: ReachabilityBoard
    _settings: ServerSettings
    _nodes: NodeBoard

    def _system_info(self) -> Raw:
        return _system_info(len(DECLARED), self._settings.cell_name, self._settings.fleet_address)

    @rpc("SystemInfo")
    async def system_info(self, context: Context, args: None) -> Any:
        """Return versions, parameter types and supported requests. Existing clients send no other requests."""
        return self._system_info()

    @cached("SystemInfo")
    def cached_system_info(self, codes: bool) -> Raw:
        """Return the encoded answer to SystemInfo."""
        return self._system_info()

    @rpc("Authenticate")
    async def authenticate(self, context: Context, args: AuthenticateArgs) -> AuthenticateData:
        """Authenticate a connection that was opened without a token. The greeting follows the answer."""
        client = context.client
        try:
            admission = self._access.by_token(args.token, client.address)
        except TooManyAttempts:
            client.close(CloseCode.NOT_ADMITTED, "too many wrong tokens")
            raise
        token = admission.token
        assert token is not None
        if client.token is not None and client.token.id != token.id:
            self._log_ons.log_off(client)
        was_admitted = client.admitted
        client.admit(token.role, token)
        if not was_admitted:
            context.events_to_caller += client.greeting()
            self._hub.add(client, client.events)
        return AuthenticateData(token.name, token.role.identifier, token.shared or UNSET)

    @rpc("RegisterUser")
    async def register_user(self, context: Context, args: RegisterUserArgs) -> None:
        """Register the user of this connection."""
        name = args.user_name
        await self._require_own_name(context.client, name)
        context.events_to_caller += await self._users.register(context.client, name)
        if context.client in self._hub.subscribers("HistoryChanged"):
            context.events_to_caller.append(self._edit_notifications.history_of(context.client))
        aiming = self._object_aiming.of(name, self._session.document)
        if aiming is not None and not self._locks.holds(name, aiming.object_id):
            self._object_aiming.end(name)

    async def _require_own_name(self, client: Client, name: str) -> None:
        """Raise LogOnNeeded if a name may be used only by a person who has logged on."""
        if client.person is not None:
            if client.person.name != name:
                raise LogOnNeeded("{name} is logged on at this device. Log off first.", name=client.person.name)
        elif client.shared:
            raise LogOnNeeded(LOG_ON_NEEDED)
        elif await self._persons.has_name(name):
            raise LogOnNeeded("{name} logs on with a PIN or a card. Use another name, or log on.", name=name)

    @rpc("SubscribeEvents")
    async def subscribe_events(self, context: Context, args: SubscribeEventsArgs) -> None:
        """Subscribe this client to additional events, or unsubscribe it. The present state follows the answer."""
        offered = {event.name for event in EVENTS.values() if event.additional}
        if unknown := args.events - offered:
            raise RequestRefused(
                "Unknown additional events: {unknown}. Available events: {offered}.",
                unknown=", ".join(sorted(unknown)),
                offered=", ".join(sorted(offered)),
            )
        client = context.client
        self._hub.subscribe(client, args.events, args.send)
        if not isinstance(args.users, Unset):
            client.follows = client.follows | args.users if args.send else client.follows - args.users
        if not args.send:
            return
        events = context.events_to_caller
        if "ObjectState" in args.events:
            states = self._execution.board.states() or self._online.board.states()
            events += [make_event("ObjectState", state) for state in states]
        if "ObjectHealth" in args.events:
            healths = self._execution.board.healths() or self._online.board.healths()
            events += [make_event("ObjectHealth", health) for health in healths]
        if "ObjectValues" in args.events:
            values = self._execution.board.values() or self._online.board.values()
            events += [make_event("ObjectValues", each) for each in values]
        if "InterlockStates" in args.events:
            known = self._execution.board.interlocks or self._online.board.interlocks
            events.append(make_event("InterlockStates", InterlockStates(known)))
        if "RobotHold" in args.events:
            events += [make_event("RobotHold", hold) for hold in self._online.held.states()]
        if "ForcesChanged" in args.events:
            events.append(make_event("ForcesChanged", self._online.forces.states()))
        if "NodesChanged" in args.events:
            events.append(make_event("NodesChanged", self._nodes.data()))
        if "UserPresence" in args.events:
            events += self._presence.all_events()
        if "TaskState" in args.events:
            events += self._tasks.running_events()
        if "ReachabilityChanged" in args.events:
            self._reachability.schedule()
        if "Held" in args.events and (held := self._execution.hold.present) is not None:
            events.append(make_event("Held", held))
        if "HistoryChanged" in args.events:
            events.append(self._edit_notifications.history_of(client))
