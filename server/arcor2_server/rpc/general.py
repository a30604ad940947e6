"""Requests about the server itself and about who is there."""

import functools
from typing import Any, Final

from msgspec import Raw

from arcor2_hw.data.base import Unset
from arcor2_hw.data.events import EVENTS
from arcor2_hw.data.rpc import (
    AuthenticateArgs,
    AuthenticateData,
    RegisterUserArgs,
    SubscribeEventsArgs,
    SystemInfoData,
)
from arcor2_server.access.admission import TooManyAttempts
from arcor2_server.errors import RequestRefused
from arcor2_server.events import encode, make_event
from arcor2_server.rpc.registry import HANDLERS, Context, at_once, rpc
from arcor2_server.services import Services
from arcor2_server.websocket.client import CloseCode

VERSION: Final = "1.4.0"
"""The version of the ARServer whose behaviour this is; our own is `arcor2-hw --version`."""
API_VERSION: Final = "1.1.0"
"""Existing clients refuse another major version."""
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


@rpc("SystemInfo")
async def system_info(context: Context, args: None) -> Any:  # noqa: ARG001
    """Give versions, parameter types and the requests that are served (an existing client sends no other)."""
    return _system_info(len(HANDLERS))


@functools.lru_cache(maxsize=1)
def _system_info(_handlers: int) -> Raw:
    """Encode the answer once; the handlers only grow, and only until the server is up."""
    return Raw(encode(SystemInfoData(VERSION, API_VERSION, set(PARAMETER_TYPES), set(HANDLERS))))


@at_once("SystemInfo")
def _kept_system_info(services: Services) -> Raw:  # noqa: ARG001
    return _system_info(len(HANDLERS))


@rpc("Authenticate")
async def authenticate(context: Context, args: AuthenticateArgs) -> AuthenticateData:
    """Show a token at a connection that could send none when it was made; the greeting follows the answer."""
    services, client = context.services, context.client
    try:
        admission = services.access.by_token(args.token, client.address)
    except TooManyAttempts:
        client.close(CloseCode.NOT_ADMITTED, "too many wrong tokens")
        raise
    token = admission.token
    assert token is not None
    was_in = client.admitted
    client.admit(token.role, token)
    if not was_in:
        context.events_to_caller += client.greeting()
        services.hub.add(client, client.events)
    return AuthenticateData(token.name, token.role.name.lower())


@rpc("RegisterUser")
async def register_user(context: Context, args: RegisterUserArgs) -> None:
    """Log in at this connection."""
    services, name = context.services, args.user_name
    context.events_to_caller += await services.users.register(context.client, name)
    if context.client in services.hub.subscribers("HistoryChanged"):
        context.events_to_caller.append(services.edit_news.history_of(context.client))
    aim = services.aiming.of(name, services.session.document)
    if aim is not None and not services.locks.holds(name, aim.object_id):
        services.aiming.end(name)


@rpc("SubscribeEvents")
async def subscribe_events(context: Context, args: SubscribeEventsArgs) -> None:
    """Send additional events to this connection, or no longer; first it is told how everything is now."""
    offered = {event.name for event in EVENTS.values() if event.additional}
    if unknown := args.events - offered:
        raise RequestRefused(
            f"No additional event is called {', '.join(sorted(unknown))}; there is {', '.join(sorted(offered))}."
        )
    services, client = context.services, context.client
    services.hub.subscribe(client, args.events, args.send)
    if not isinstance(args.users, Unset):
        client.follows = client.follows | args.users if args.send else client.follows - args.users
    if not args.send:
        return
    tell = context.events_to_caller
    if "ObjectState" in args.events:
        states = services.execution.board.states() or services.cell.board.states()
        tell += [make_event("ObjectState", state) for state in states]
    if "ObjectHealth" in args.events:
        healths = services.execution.board.healths() or services.cell.board.healths()
        tell += [make_event("ObjectHealth", health) for health in healths]
    if "RobotHold" in args.events:
        tell += [make_event("RobotHold", hold) for hold in services.cell.held.states()]
    if "UserPresence" in args.events:
        tell += services.presence.everybody()
    if "TaskState" in args.events:
        tell += services.tasks.under_way()
    if "ReachabilityChanged" in args.events:
        services.reachability.look()
    if "HistoryChanged" in args.events:
        tell.append(services.edit_news.history_of(client))
