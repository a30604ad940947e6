"""The connected clients: events to all of them, or to one."""

import msgspec

from arcor2_hw.data.events import EVENTS, Event
from arcor2_server.client import Client

encode = msgspec.json.Encoder().encode


class Hub:
    """Knows every connection. An event is encoded once, and only queued here: no client can delay another."""

    def __init__(self) -> None:
        self.clients: set[Client] = set()

    def add(self, client: Client) -> None:
        """Take in a connection."""
        self.clients.add(client)

    def remove(self, client: Client) -> None:
        """Forget a connection."""
        self.clients.discard(client)

    def broadcast(self, event: Event, *, besides: Client | None = None) -> None:
        """Send an event to all clients whose role may see it, but not to `besides`."""
        if self.clients:
            self.broadcast_encoded(event.event, encode(event), besides=besides)

    def broadcast_encoded(self, name: str, message: bytes, *, besides: Client | None = None) -> None:
        """Send an event that is encoded already (it comes so from the cell host)."""
        least = EVENTS[name].role
        for client in tuple(self.clients):
            if client is not besides and client.role >= least:
                client.put(message)

    def send(self, client: Client, event: Event) -> None:
        """Send an event to one client."""
        if client.role >= EVENTS[event.event].role:
            client.put(encode(event))

    def stream(self, name: str, key: str, message: bytes, clients: "set[Client] | None" = None) -> None:
        """Send the newest message of a stream (event `name` of e.g. robot `key`) to `clients`, None: to all.

        An older message of the same stream that still waits for a client is replaced.
        """
        least = EVENTS[name].role
        stream = f"{name}/{key}"
        for client in tuple(self.clients if clients is None else clients & self.clients):
            if client.role >= least:
                client.put_newest(stream, message)
