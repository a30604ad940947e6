"""The hub of events: the connected clients and their subscriptions."""

from collections.abc import Callable, Set as AbstractSet

from arcor2_hw.data.events import EVENTS, Event, MainScreen, ShowMainScreenData
from arcor2_server.events import Connection, encode, make_event
from arcor2_server.websocket.client import Client


class Hub:
    """The connected clients. Each event is encoded once and only queued, so that no client delays another."""

    def __init__(self) -> None:
        self.clients: set[Client] = set()
        self._only: dict[Connection, frozenset[str]] = {}
        self._subscribers: dict[str, set[Connection]] = {}
        self.on_leave: list[Callable[[Connection], None]] = []
        self.main_screen = make_event("ShowMainScreen", ShowMainScreenData(MainScreen.SCENES_LIST))
        """The last ShowMainScreen event without `highlight`. It greets clients while no document is open."""

    def add(self, client: Client, only: frozenset[str] | None = None) -> None:
        """Add a client. `only`: names of the events for it, None for all."""
        self.clients.add(client)
        if only is not None:
            self._only[client] = only

    def remove(self, client: Client) -> None:
        """Remove a client and notify the observers."""
        self.clients.discard(client)
        self._only.pop(client, None)
        for subscribers in self._subscribers.values():
            subscribers.discard(client)
        for notify in self.on_leave:
            notify(client)

    def subscribe(self, client: Connection, names: set[str], send: bool) -> None:
        """Subscribe a client to additional events, or unsubscribe it."""
        for name in names:
            subscribers = self._subscribers.setdefault(name, set())
            if send:
                subscribers.add(client)
            else:
                subscribers.discard(client)

    def broadcast(self, event: Event, *, besides: Connection | None = None) -> None:
        """Send an event to all clients with the needed role, except `besides`; an additional event to subscribers."""
        if isinstance(event.data, ShowMainScreenData):
            self.main_screen = make_event(event.event, ShowMainScreenData(event.data.what))
        if self.clients:
            self.broadcast_encoded(event.event, encode(event), besides=besides)

    def broadcast_encoded(self, name: str, message: bytes, *, besides: Connection | None = None) -> None:
        """Send an encoded event, as `broadcast` does."""
        receivers = self.subscribers(name) if EVENTS[name].additional else self._receivers(name, self.clients)
        for client in receivers:
            if client is not besides:
                client.put(message)

    def _receivers(self, name: str, clients: AbstractSet[Connection]) -> tuple[Connection, ...]:
        """Return the clients that receive an event: those with its role, unless their service does not have it."""
        least = EVENTS[name].role
        permitted = (client for client in clients if client.role >= least)
        return tuple(client for client in permitted if name in self._only.get(client, (name,)))

    def subscribers(self, name: str) -> tuple[Connection, ...]:
        """Return the clients that receive an additional event."""
        return self._receivers(name, self._subscribers.get(name, set()) & self.clients)

    def send(self, client: Connection, event: Event) -> None:
        """Send an event to one client."""
        if client.role >= EVENTS[event.event].role:
            client.put(encode(event))

    def stream(self, name: str, key: str, message: bytes, clients: AbstractSet[Connection] | None = None) -> None:
        """Send the newest message of a stream. It replaces an older message of the stream that still waits.

        Args:
            name: the event.
            key: the subject of the stream, such as a robot.
            message: the encoded event.
            clients: the clients, None for all.
        """
        stream = f"{name}/{key}"
        for client in self._receivers(name, self.clients if clients is None else clients & self.clients):
            client.put_newest(stream, message)

    def stream_to_subscribers(self, name: str, key: str, message: bytes, *, besides: Connection | None = None) -> None:
        """Send the newest message of a stream of additional events to their subscribers, as `stream` does."""
        stream = f"{name}/{key}"
        for client in self.subscribers(name):
            if client is not besides:
                client.put_newest(stream, message)
