"""The nodes as the server knows them, from their announcements."""

import asyncio
import contextlib
import os
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from typing import Any, Final

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Timestamp
from arcor2_hw.data.nodes import NodeError, NodesData, NodeSession, NodeState, NodeStatus
from arcor2_hw.exceptions import Arcor2Error, ConnectionLost
from arcor2_hw.messages import Message
from arcor2_server.background import BackgroundTasks
from arcor2_server.events import EventHub, make_event
from arcor2_server.nodes.presence import PERIOD, Announcement, own_version, presence_subject

log = structlog.get_logger(__name__)

SILENT_AFTER: Final = 3.0
"""Time without an announcement after which a node counts as silent, s: three periods."""
FORGOTTEN_AFTER: Final = 24 * 3600.0
"""Time after which a silent node that nothing needs is no longer listed, s."""
CHECK_PERIOD: Final = 0.5
"""Period of the search for changes, s."""
LOAD_PERIOD: Final = 10.0
"""Period at which clients are notified if only load and free space have changed, s."""
CLOSE_TIMEOUT: Final = 0.5
"""Time limit for closing the connection, s."""
RETRY_PERIOD: Final = 2.0
"""Period of the attempts to connect to the broker, s."""


class _KnownNode:
    """A node that has announced itself. Time stamps are computed once, so that nothing seems to change later."""

    def __init__(self, announced: Announcement, moment: float) -> None:
        self.since = _time_ago(announced.age)
        self.sessions: dict[str, Timestamp] = {}
        self.error: tuple[Message, Timestamp] | None = None
        self.take(announced, moment)

    def take(self, announced: Announcement, moment: float) -> None:
        """Store an announcement that arrived at this time of the clock of the board, s."""
        self.announced, self.seen, self.seen_at = announced, moment, _time_ago(0.0)
        self.sessions = {each.id: self.sessions.get(each.id) or _time_ago(each.age) for each in announced.sessions}
        error = announced.error
        if error is None:
            self.error = None
        elif self.error is None or self.error[0] != error.text or error.age < PERIOD:
            self.error = (error.text, _time_ago(error.age))


def _time_ago(age: float) -> Timestamp:
    """Return the time stamp of an event that is `age` seconds old."""
    return (datetime.now(UTC) - timedelta(seconds=age)).isoformat(timespec="seconds")


class NodeBoard:
    """Follows the announcements of nodes, and publishes changes.

    Args:
        hub: publishes NodesChanged.
        assigned: nodes that the cell file of the server names, by name of the object.
        needed: returns the names of the objects of the open scene, by the node on which they run.
        configured: returns whether there is a broker; the server may get its credentials while it runs.
        environment: names address or credentials of the broker.
        clock: the monotonic clock, s.
        apart: returns why the objects of the open scene cannot work together where they run; None if they can.
    """

    def __init__(
        self,
        hub: EventHub,
        assigned: Mapping[str, str],
        needed: Callable[[], Mapping[str, list[str]]],
        configured: Callable[[], bool],
        environment: Mapping[str, str] = os.environ,
        clock: Callable[[], float] = time.monotonic,
        apart: Callable[[], Message | None] = lambda: None,
    ) -> None:
        self._hub = hub
        self._assigned = assigned
        self._needed = needed
        self._is_configured, self._environment = configured, environment
        self._clock, self._apart = clock, apart
        self._known: dict[str, _KnownNode] = {}
        self._missing_since: dict[str, float] = {}
        self._problem: Message | None = None
        self._published: NodesData | None = None
        self._published_at = 0.0
        self._background = BackgroundTasks()

    def start(self) -> None:
        """Start to follow the nodes."""
        self._background.spawn(self._follow(), "announcements of nodes")
        self._background.spawn(self._watch(), "state of nodes")

    async def close(self) -> None:
        """Stop following the nodes."""
        await self._background.cancel()

    # -------------------------------------------------------------------------------- announcements
    def take(self, announced: Announcement) -> None:
        """Store an announcement."""
        known, moment = self._known.get(announced.name), self._clock()
        if known is None or known.announced.service != announced.service:
            log.info("node seen", node=announced.name, computer=announced.computer, version=announced.version)
            self._known[announced.name] = _KnownNode(announced, moment)
        else:
            known.take(announced, moment)

    def take_encoded(self, subject: str, body: bytes) -> None:
        """Store an encoded announcement, unless it is invalid or another node pretends to be this one."""
        try:
            announced = msgspec.json.decode(body, type=Announcement)
        except msgspec.MsgspecError as error:
            log.warning("invalid announcement of a node", subject=subject, reason=str(error))
            return
        if subject == presence_subject(announced.name):  # what a node may publish depends on the subject
            self.take(announced)
        else:
            log.warning("announcement of a node with the name of another one", subject=subject, name=announced.name)

    async def _follow(self) -> None:
        """Receive announcements, and connect again when the broker was lost."""
        while True:
            try:
                if self._is_configured():
                    await self._receive()
            except Arcor2Error as error:
                if self._problem is None or self._problem.text != error.message.text:
                    log.warning("nodes are unknown", reason=str(error), detail=error.detail)
                self._problem = error.message
            await asyncio.sleep(RETRY_PERIOD)

    async def _receive(self) -> None:
        """Receive announcements until the broker is lost. Raise Arcor2Error then, or if it cannot be reached."""
        try:
            from nats.aio.msg import Msg
            from nats.errors import Error as NatsError

            from arcor2_server.nodes.confirmation import confirm_sent
            from arcor2_server.nodes.connections import connect_client
            from arcor2_server.nodes.credentials import of_environment
        except ImportError:
            raise Arcor2Error(
                "Devices on nodes need the extra `nodes` of arcor2-hw. Install it on the server."
            ) from None
        lost = asyncio.Event()

        async def received(message: Msg) -> None:
            self.take_encoded(message.subject, message.data)

        client = await connect_client(of_environment(self._environment), "arcor2-hw nodes", lost.set)
        try:
            await client.subscribe(presence_subject("*"), cb=received)
            await confirm_sent(client)
            self._problem = None
            await lost.wait()
            raise ConnectionLost("The broker closed the connection.")
        except (NatsError, OSError) as error:
            raise ConnectionLost("The broker closed the connection.", str(error)) from error
        finally:
            with contextlib.suppress(NatsError, OSError, TimeoutError):
                async with asyncio.timeout(CLOSE_TIMEOUT):
                    await client.close()

    # -------------------------------------------------------------------------------- state
    async def _watch(self) -> None:
        while True:
            self.check()
            await asyncio.sleep(CHECK_PERIOD)

    def check(self) -> None:
        """Publish the nodes if they have changed."""
        data, moment = self.data(), self._clock()
        due = moment - self._published_at >= LOAD_PERIOD
        if data == self._published or (not due and _without_load(data) == _without_load(self._published)):
            return
        self._published, self._published_at = data, moment
        self._hub.broadcast(make_event("NodesChanged", data))

    def data(self) -> NodesData:
        """Return the present state of all nodes."""
        if not self._is_configured():
            return NodesData(False)
        moment, needed = self._clock(), self._needed()
        names = {*needed, *self._assigned.values()}
        names |= {name for name, known in self._known.items() if moment - known.seen < FORGOTTEN_AFTER}
        problem: dict[str, Any] = {}
        if self._problem is not None:
            problem = {"problem": self._problem.text, **self._problem.translation()}
        nodes = [self._status(name, needed.get(name, []), moment) for name in sorted(names)]
        return NodesData(True, nodes, dict(self._assigned), apart=self._apart() or UNSET, **problem)

    def lost(self) -> dict[str, list[str]]:
        """Return the nodes that the open scene needs and that cannot be used, each with its objects.

        A node is not lost before it could have announced itself.
        """
        moment, needed = self._clock(), self._needed() if self._is_configured() else {}
        missing = {name for name in needed if self._state(name, moment) is not NodeState.CONNECTED}
        self._missing_since = {name: self._missing_since.get(name, moment) for name in missing}
        return {
            name: list(needed[name])
            for name in sorted(missing)
            if name in self._known or moment - self._missing_since[name] > SILENT_AFTER
        }

    def _state(self, name: str, moment: float) -> NodeState:
        known = self._known.get(name)
        if known is None or moment - known.seen > SILENT_AFTER:
            return NodeState.SILENT
        return NodeState.CONNECTED if known.announced.version == own_version() else NodeState.OTHER_VERSION

    def _status(self, name: str, objects: list[str], moment: float) -> NodeStatus:
        known, state = self._known.get(name), self._state(name, moment)
        if known is None:
            return NodeStatus(name, state, objects=objects)
        announced = known.announced
        silent = state is NodeState.SILENT
        sessions = [NodeSession(each.kind, each.name, known.sessions[each.id]) for each in announced.sessions]
        return NodeStatus(
            name,
            state,
            announced.version,
            announced.computer,
            known.since,
            known.seen_at if silent else UNSET,
            UNSET if silent else round(announced.load, 2),
            announced.free,
            [] if silent else sessions,
            UNSET if known.error is None else _error(*known.error),
            objects,
        )


def _error(message: Message, at: Timestamp) -> NodeError:
    return NodeError(message.text, at, **message.translation())


def _without_load(data: NodesData | None) -> NodesData | None:
    """Return the nodes without load and free space, which change all the time."""
    return data and replace(data, nodes=[replace(each, load=UNSET, free=UNSET) for each in data.nodes])
