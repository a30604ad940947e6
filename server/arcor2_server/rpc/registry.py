"""How a request finds its handler, and what a handler is given."""

import time
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any, Final

from msgspec import Raw

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.events import ChangeType, Event
from arcor2_hw.data.rpc import RPCS
from arcor2_server.errors import NotRegistered
from arcor2_server.events import make_event

if TYPE_CHECKING:
    from arcor2_server.services import Services
    from arcor2_server.websocket.client import Client


class Context:
    """What a handler is given beside its arguments.

    Events: `emit` sends to all clients after the response, `emit_first` before it (protocol, section 2). They are
    sent when the request is granted, or refused with data; an error that is raised otherwise drops them.
    """

    __slots__ = (
        "client",
        "dry_run",
        "events_after",
        "events_before",
        "events_to_caller",
        "received_at",
        "request",
        "services",
    )

    def __init__(self, services: "Services", client: "Client", dry_run: bool = False, request: str = "") -> None:
        self.services = services
        self.client = client
        self.dry_run = dry_run
        self.request = request
        self.received_at = time.monotonic()
        """When the request came, s of the monotonic clock."""
        self.events_before: list[Event] = []
        self.events_after: list[Event] = []
        self.events_to_caller: list[Event] = []
        """Sent to the caller alone, after the response."""

    @property
    def user(self) -> str:
        """Give the registered name of the caller; RequestRefused when there is none."""
        if self.client.user is None:
            raise NotRegistered("You are not logged in: send RegisterUser first.")
        return self.client.user

    def emit(self, name: str, data: Any = UNSET, change: ChangeType | None = None, parent: str | None = None) -> None:
        """Send an event to all clients once the response is out."""
        self.events_after.append(make_event(name, data, change, parent))

    def emit_first(
        self, name: str, data: Any = UNSET, change: ChangeType | None = None, parent: str | None = None
    ) -> None:
        """Send an event to all clients before the response."""
        self.events_before.append(make_event(name, data, change, parent))


Handler = Callable[[Context, Any], Awaitable[Any]]
"""Takes the context and the decoded arguments (None when the request has none); gives the answer's data or None."""

HANDLERS: Final[dict[str, Handler]] = {}

AT_ONCE: Final[dict[str, "Callable[[Services], Raw | None]"]] = {}
"""For requests without arguments: gives the answer's data if it is kept, without waiting for anything."""


def rpc(name: str) -> Callable[[Handler], Handler]:
    """Register the handler of a request that the protocol declares (arcor2_hw.data.rpc: arguments, answer, role)."""
    if name not in RPCS:
        raise KeyError(f"{name} is no request of the protocol")

    def register(handler: Handler) -> Handler:
        if name in HANDLERS:
            raise KeyError(f"{name} has two handlers")
        HANDLERS[name] = handler
        return handler

    return register


def at_once(
    name: str,
) -> "Callable[[Callable[[Services], Raw | None]], Callable[[Services], Raw | None]]":
    """Register what answers a request without a task of its own; it gives None when the handler has to."""
    if RPCS[name].args is not None:
        raise KeyError(f"{name} has arguments")

    def register(look: "Callable[[Services], Raw | None]") -> "Callable[[Services], Raw | None]":
        AT_ONCE[name] = look
        return look

    return register
