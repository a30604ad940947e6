"""The connected clients, and events to all or some of them."""

from collections.abc import Callable
from collections.abc import Set as AbstractSet

from arcor2_hw.data.events import EVENTS, Event, MainScreen, ShowMainScreenData
from arcor2_server.events import Connection, encode, make_event
from arcor2_server.websocket.client import Client


class Hub:
    """All connections. An event is encoded once and only queued here, so that no client delays another."""

    def __init__(self) -> None:
        self.clients: set[Client] = set()
        self._only: dict[Connection, frozenset[str]] = {}
        self._subscribers: dict[str, set[Connection]] = {}
        self.on_leave: list[Callable[[Connection], None]] = []
        self.main_screen = make_event("ShowMainScreen", ShowMainScreenData(MainScreen.SCENES_LIST))
        """The greeting while nothing is open: the last ShowMainScreen, without `highlight`."""

    def add(self, client: Client, only: frozenset[str] | None = None) -> None:
        """Add a connection; `only`: the events for it, None for all."""
        self.clients.add(client)
        if only is not None:
            self._only[client] = only

    def remove(self, client: Client) -> None:
        """Remove a connection and notify the observers."""
        self.clients.discard(client)
        self._only.pop(client, None)
        for subscribers in self._subscribers.values():
            subscribers.discard(client)
        for forget in self.on_leave:
            forget(client)

    def subscribe(self, client: Connection, names: set[str], send: bool) -> None:
        """Subscribe a client to additional events, or unsubscribe it."""
        for name in names:
            subscribers = self._subscribers.setdefault(name, set())
            if send:
                subscribers.add(client)
            else:
                subscribers.discard(client)

    def broadcast(self, event: Event, *, besides: Connection | None = None) -> None:
        """Send an event to all clients whose role permits it except `besides`; an additional event to subscribers."""
        if isinstance(event.data, ShowMainScreenData):
            self.main_screen = make_event(event.event, ShowMainScreenData(event.data.what))
        if self.clients:
            self.broadcast_encoded(event.event, encode(event), besides=besides)

    def broadcast_encoded(self, name: str, message: bytes, *, besides: Connection | None = None) -> None:
        """Send an event that is encoded already (it comes so from the cell host)."""
        declared = EVENTS[name]
        least = declared.role
        to = self._subscribers.get(name, set()) & self.clients if declared.additional else self.clients
        for client in self._hearing(name, to):
            if client is not besides and client.role >= least:
                client.put(message)

    def _hearing(self, name: str, clients: AbstractSet[Connection]) -> tuple[Connection, ...]:
        if not self._only:
            return tuple(clients)
        return tuple(client for client in clients if name in self._only.get(client, (name,)))

    def subscribers(self, name: str) -> tuple[Connection, ...]:
        """Return the clients that are sent an additional event."""
        least = EVENTS[name].role
        hearing = self._hearing(name, self._subscribers.get(name, set()) & self.clients)
        return tuple(client for client in hearing if client.role >= least)

    def send(self, client: Connection, event: Event) -> None:
        """Send an event to one client."""
        if client.role >= EVENTS[event.event].role:
            client.put(encode(event))

    def stream(self, name: str, key: str, message: bytes, clients: AbstractSet[Connection] | None = None) -> None:
        """Send the newest message of a stream (event `name` of e.g. robot `key`) to `clients`, None: to all.

        An older message of the same stream that still waits for a client is replaced.
        """
        least = EVENTS[name].role
        stream = f"{name}/{key}"
        for client in self._hearing(name, self.clients if clients is None else clients & self.clients):
            if client.role >= least:
                client.put_newest(stream, message)

    def stream_to_subscribers(self, name: str, key: str, message: bytes, *, besides: Connection | None = None) -> None:
        """Send the newest message of an additional event about `key` to its subscribers, as `stream` does."""
        stream = f"{name}/{key}"
        for client in self.subscribers(name):
            if client is not besides:
                client.put_newest(stream, message)
