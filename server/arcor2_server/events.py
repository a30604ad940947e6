"""Creation of protocol events, and the interface through which parts of the server publish them."""

from collections.abc import Callable, Set as AbstractSet
from typing import Any, Final, Protocol

import msgspec

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.events import EVENTS, ChangeType, Event
from arcor2_hw.data.persons import Person
from arcor2_hw.data.role import Role

encode: Final = msgspec.json.Encoder().encode
"""Encode an event or an answer as JSON."""


def make_event(name: str, data: Any = UNSET, change: ChangeType | None = None, parent: str | None = None) -> Event:
    """Return an event of the protocol.

    Raises:
        KeyError: the protocol has no event of this name.
    """
    return Event(EVENTS[name].name, change or UNSET, UNSET if parent is None else parent, data)


class Connection(Protocol):
    """One connected client: the interface for the layers below the websocket."""

    number: int
    user: str | None
    """Name of the registered user, None before RegisterUser."""
    person: Person | None
    """The person who is logged on at this device."""
    address: str
    follows: frozenset[str]
    """Other users whose view states the client receives."""

    @property
    def role(self) -> Role:
        """Role of the client: the lower one of the roles of its token and of the logged-on person."""

    @property
    def device(self) -> str:
        """The id of its token, or its address without a token."""

    def put(self, message: bytes) -> None:
        """Queue an encoded message."""

    def put_newest(self, stream: str, message: bytes) -> None:
        """Queue a message in place of the queued message of the same stream."""

    async def ping(self, within: float) -> bool:
        """Return whether the client answers a ping within that many seconds."""


class EventHub(Protocol):
    """Publishes events to the connected clients. Messages are only queued, so that no client delays another."""

    on_leave: list[Callable[[Connection], None]]
    """Called with each client that disconnects."""

    @property
    def clients(self) -> AbstractSet[Connection]:
        """The admitted clients."""

    def broadcast(self, event: Event, *, besides: Connection | None = None) -> None:
        """Send an event to all clients, an additional event to its subscribers, but not to `besides`."""

    def broadcast_encoded(self, name: str, message: bytes, *, besides: Connection | None = None) -> None:
        """Send an encoded event, as `broadcast` does."""

    def subscribers(self, name: str) -> tuple[Connection, ...]:
        """Return the clients that subscribed to an additional event."""

    def send(self, client: Connection, event: Event) -> None:
        """Send an event to one client."""

    def stream(self, name: str, key: str, message: bytes, clients: AbstractSet[Connection] | None = None) -> None:
        """Send a message of a stream to `clients`, None: to all. It replaces a queued message of the same stream."""

    def stream_to_subscribers(self, name: str, key: str, message: bytes, *, besides: Connection | None = None) -> None:
        """Send a message of a stream to the subscribers of an additional event, as `stream` does."""
