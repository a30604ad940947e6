"""Subscriptions to joints, end effector poses, observations and points, at the streaming period or another rate."""

from collections.abc import Callable
from typing import Final

from arcor2_hw.data.rpc import RobotEventKind
from arcor2_hw.runtime import messages as m
from arcor2_server.errors import RequestRefused
from arcor2_server.events import Connection, EventHub

OBSERVATIONS: Final = "observations"
"""The kind of the streams of observations, next to those of RobotEventKind."""
POINTS: Final = "points"
"""The kind of the streams of points."""
_KINDS: Final[dict[str, str]] = {
    "RobotJoints": RobotEventKind.JOINTS,
    "RobotEef": RobotEventKind.EEF_POSE,
    "ObjectObservations": OBSERVATIONS,
    "ObjectPoints": POINTS,
}


class RobotStreams:
    """The subscriptions to the streams of robots and other devices.

    Args:
        hub: publishes the streams.
        send_message: sends a message to the host, if there is one.
        to_all_clients: send streams at the streaming period to all clients, as the protocol requires for a program.
    """

    def __init__(
        self, hub: EventHub, send_message: Callable[[m.ToHost], None], *, to_all_clients: bool = False
    ) -> None:
        self._hub = hub
        self._send = send_message
        self._to_all_clients = to_all_clients
        self._subscribers: dict[tuple[str, str], set[Connection]] = {}
        self._rates: dict[tuple[str, str], dict[Connection, float]] = {}
        self._observers: dict[tuple[str, str], dict[str, tuple[float, Callable[[bytes], None]]]] = {}

    def subscribe(self, client: Connection, robot_id: str, kind: RobotEventKind, send: bool) -> None:
        """Start or stop a stream at the streaming period. Raise RequestRefused if it was not subscribed to."""
        clients = self._subscribers.setdefault((robot_id, kind), set())
        if send:
            clients.add(client)
        elif client not in clients:
            raise RequestRefused("This stream is not subscribed to.")
        else:
            clients.discard(client)
        self._update_host(robot_id)

    def at_rate(self, client: Connection, robot_id: str, kind: str, rate: float, send: bool) -> None:
        """Start or stop a stream at `rate`, 1/s. Raise RequestRefused if it was not subscribed to."""
        rates = self._rates.setdefault((robot_id, kind), {})
        if send:
            rates[client] = rate
        elif rates.pop(client, None) is None:
            raise RequestRefused("This stream is not subscribed to.")
        self._update_host_rates(robot_id)

    def observe(self, object_id: str, kind: str, rate: float, receive: Callable[[bytes], None], *, owner: str) -> None:
        """Pass the encoded events of a stream at `rate`, 1/s, to another part of the server.

        `end_observing` or `clear` ends this. `owner` is the name of that part. A second call with the same owner
        and stream replaces rate and function.
        """
        observers = self._observers.setdefault((object_id, kind), {})
        before = observers.get(owner)
        observers[owner] = rate, receive
        if before is None or before[0] != rate:
            self._update_host_rates(object_id)

    def end_observing(self, object_id: str, kind: str, *, owner: str) -> None:
        """End a stream that `observe` has started."""
        if self._observers.get((object_id, kind), {}).pop(owner, None) is not None:
            self._update_host_rates(object_id)

    def publish(self, message: m.StreamEvent) -> None:
        """Publish a message of the host. It is encoded once for all clients."""
        kind = _KINDS.get(message.event)
        if kind is None:
            return
        key, rates = (message.object_id, kind), self._rates.get((message.object_id, kind), {})
        if message.rate:
            for observed_rate, receive in self._observers.get(key, {}).values():
                if observed_rate == message.rate:
                    receive(message.encoded)
            clients = {client for client, rate in rates.items() if rate == message.rate}
            stream = f"{message.object_id}/{message.rate:g}"
        else:
            clients = (self._hub.clients if self._to_all_clients else self._subscribers.get(key, set())) - rates.keys()
            stream = message.object_id
        if clients:
            self._hub.stream(message.event, stream, message.encoded, clients)

    def forget(self, client: Connection) -> None:
        """Remove the subscriptions of a client that disconnected."""
        for (robot_id, _), clients in list(self._subscribers.items()):
            if client in clients:
                clients.discard(client)
                self._update_host(robot_id)
        for (robot_id, _), rates in list(self._rates.items()):
            if rates.pop(client, None) is not None:
                self._update_host_rates(robot_id)

    def clear(self) -> None:
        """Remove all subscriptions, after the scene went offline or the program ended."""
        self._subscribers.clear()
        self._rates.clear()
        self._observers.clear()

    def _update_host(self, robot_id: str) -> None:
        wanted = {what: bool(self._subscribers.get((robot_id, what))) for what in RobotEventKind}
        self._send(m.Subscribe(robot_id, wanted[RobotEventKind.JOINTS], wanted[RobotEventKind.EEF_POSE]))

    def _update_host_rates(self, robot_id: str) -> None:
        rates = []
        for what in _KINDS.values():
            observed = {rate for rate, _ in self._observers.get((robot_id, what), {}).values()}
            rates.append(sorted(observed.union(self._rates.get((robot_id, what), {}).values())))
        self._send(m.Stream(robot_id, *rates))
