"""The requests of a websocket service, each with its handler."""

from collections.abc import Callable, Mapping
from typing import Any, Final

import msgspec
from msgspec import UNSET, Struct

from arcor2_hw.data.events import Event
from arcor2_hw.data.rpc import RPCS, Rpc
from arcor2_server.websocket.request import CachedAnswer, Handler

AUTHENTICATE: Final = "Authenticate"
"""The only request that is served before a client is admitted."""


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
