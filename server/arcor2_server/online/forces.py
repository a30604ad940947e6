"""Forced outputs: their persons and clients, and the reasons for their end.

The cell host switches an output back when its lease expires. This module handles persons and connections.
"""

import asyncio
import itertools
from collections.abc import Callable
from typing import Final

import msgspec
import structlog

from arcor2_hw.data.base import Data, now
from arcor2_hw.data.events import NotificationData, NotificationLevel
from arcor2_hw.data.points import ForcedPoint, ForcesChangedData, PointValue
from arcor2_hw.data.rpc import ForcePointArgs
from arcor2_hw.exceptions import Arcor2Error, NotFound
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_server.audit.changes import record
from arcor2_server.background import BackgroundTasks
from arcor2_server.errors import RequestRefused
from arcor2_server.events import Connection, EventHub, encode, make_event
from arcor2_server.hosts.session import HostSession

log = structlog.get_logger(__name__)

CHANGED: Final = "ForcesChanged"
"""The additional event with all forced outputs."""


class ForceChange(Data, frozen=True):
    """The values of an output before and after forcing, for the audit trail."""

    kind: str
    id: str
    before: dict[str, PointValue]
    after: dict[str, PointValue]


class Force:
    """A forced output.

    Args:
        client: the client that holds the lease.
        point: the published data.
        number: its number in the cell host.
        before: value of the output before.
    """

    def __init__(self, client: Connection, point: ForcedPoint, number: int, before: bool | float) -> None:
        self.client = client
        self.point = point
        self.number = number
        self.before = before
        self.reason: Message | None = None
        """Reason if the server ended it."""

    @property
    def output(self) -> str:
        """Name of the output in the audit trail."""
        return f"{self.point.object}: {self.point.point}"

    def change(self, before: PointValue, after: PointValue) -> ForceChange:
        """Return the change of the output for the audit trail."""
        return ForceChange(
            "force", self.point.id, {"name": self.output, "value": before}, {"name": self.output, "value": after}
        )


def shown(point: ForcedPoint) -> object:
    """Return the value of a forced output for messages."""
    if isinstance(point.value, bool):
        return Message.of("on") if point.value else Message.of("off")
    return f"{point.value:g} {point.unit}".rstrip()


class Forces:
    """The forced outputs of the online scene.

    Args:
        host: the devices.
        hub: publishes ForcesChanged, and a Notification for clients that do not support this event.
        background: the tasks that end forces.
    """

    def __init__(self, host: HostSession, hub: EventHub, background: BackgroundTasks) -> None:
        self._host = host
        self._hub = hub
        self._background = background
        self._numbers = itertools.count(1)
        self._forces: dict[str, Force] = {}
        self._starting: dict[int, m.ForceEnded | None] = {}
        """The numbers of the forces that are being started, with their end if it comes before the answer is handled."""
        self.on_end: list[Callable[[Force, Message], None]] = []
        """Called with each force that has ended without a request, and the reason."""

    def states(self) -> ForcesChangedData:
        """Return all forced outputs, oldest first."""
        return ForcesChangedData([force.point for force in self._forces.values()])

    def require_none(self) -> None:
        """Raise RequestRefused while an output is forced, naming device, output, value and person."""
        if self._starting:
            raise RequestRefused("An output is being forced. Try again.")
        if not self._forces:
            return
        points = [force.point for force in self._forces.values()]
        which = Message.listed(
            [
                Message.of(
                    "{object}: {point} is forced to {value} by {user}",
                    object=each.object,
                    point=each.point,
                    value=shown(each),
                    user=each.user,
                )
                for each in points
            ]
        )
        raise RequestRefused(
            "No program starts while an output is forced: {forces}. End the force first.", forces=which
        )

    # -------------------------------------------------------------------------------- requests
    async def start(self, client: Connection, user: str, args: ForcePointArgs) -> str:
        """Force an output; return the id of the force.

        Raises:
            RequestRefused: the scene is offline.
            CellError: the output cannot be forced.
            ConnectionLost, DeviceTimeout: the host or the device did not answer.
        """
        host = self._host.require_online()
        found = self._host.board.object(args.object_id)
        self._host.board.require_not_failed(args.object_id)
        number = next(self._numbers)
        self._starting[number] = None
        try:
            raw = await host.force(args.object_id, args.point, number, args.value, self._until(args.valid_ms))
        finally:
            early = self._starting.pop(number)
        started = msgspec.json.decode(raw, type=m.ForceStarted)
        point = ForcedPoint(f"force_{number}", found.id, found.name, args.point, args.value, started.unit, user, now())
        force = self._forces[point.id] = Force(client, point, number, started.before)
        record([force.change(started.before, args.value)])
        log.warning("output forced", output=force.output, value=args.value, user=user)
        self._changed(
            NotificationLevel.WARN,
            Message.of(
                "{user} has forced {object}: {point} to {value}.",
                user=user,
                object=found.name,
                point=args.point,
                value=shown(point),
            ),
        )
        if early is not None:
            self.ended(early)
        elif self._host.host is not host:  # the host has ended in the meantime, and with it all forces
            self._finish(force, Message.of("the scene is offline"))
        elif client not in self._hub.clients:
            self._end(force, Message.of("{user} is no longer connected", user=user))
        elif client.user != user:
            self._end(force, Message.of("{user} was logged off", user=user))
        return point.id

    def renew(self, client: Connection, ids: list[str], valid_ms: int) -> None:
        """Renew the forces of a client.

        Raise NotFound for an ended force, RequestRefused for a force of another client.
        """
        found = []
        for force_id in ids:
            force = self._require(force_id)
            if force.client is not client:
                raise RequestRefused("Another device has forced {output}.", output=force.output)
            found.append(force.number)
        self._host.send(m.RenewForces(found, self._until(valid_ms)))

    async def end(self, force_id: str) -> None:
        """End a force. Return when the output has its previous value again.

        Raises:
            NotFound: it has ended.
            CellError: the output could not be switched back.
            ConnectionLost, DeviceTimeout: the host or the device did not answer.
        """
        force = self._require(force_id)
        await self._host.require_online().end_force(force.number)
        record([force.change(force.point.value, force.before)])

    def _require(self, force_id: str) -> Force:
        if (found := self._forces.get(force_id)) is None:
            raise NotFound("This force has ended.")
        return found

    @staticmethod
    def _until(valid_ms: int) -> float:
        return asyncio.get_running_loop().time() + valid_ms / 1e3

    # -------------------------------------------------------------------------------- ends
    def _end(self, force: Force, reason: Message) -> None:
        """Start switching an output back."""
        force.reason = force.reason or reason
        self._background.spawn(self._release(force), f"end of the force of {force.output}")

    async def _release(self, force: Force) -> None:
        try:
            await self._host.require_online().end_force(force.number)
        except Arcor2Error as error:  # ForceEnded reports it, unless the host has ended
            log.warning("forced output not released", output=force.output, reason=str(error), detail=error.detail)

    def ended(self, message: m.ForceEnded) -> None:
        """Finish a force that the cell host has ended."""
        if message.force in self._starting:
            self._starting[message.force] = message
        for force in list(self._forces.values()):
            if force.number == message.force:
                self._finish(force, force.reason if message.error is None else message.error.message)

    def _finish(self, force: Force, reason: Message | None) -> None:
        """Publish the end of a force. `reason`: None if a request ended it."""
        if self._forces.pop(force.point.id, None) is None:
            return
        log.warning("force ended", output=force.output, user=force.point.user, reason=str(reason or ""))
        names = {"object": force.point.object, "point": force.point.point}
        if reason is None:
            self._changed(NotificationLevel.INFO, Message.of("{object}: {point} is no longer forced.", **names))
            return
        why = Message.of("{object}: {point} is no longer forced: {reason}", **names, reason=reason)
        self._changed(NotificationLevel.WARN, why, surprising=True)
        for notify in self.on_end:
            notify(force, reason)

    def _changed(self, level: NotificationLevel, message: Message, *, surprising: bool = False) -> None:
        """Publish the forces, and a message to clients that do not show them.

        Unexpected changes are reported to all clients.
        """
        hub = self._hub
        hub.broadcast(make_event(CHANGED, self.states()))
        event = make_event("Notification", NotificationData(message.text, level, **message.translation()))
        others = None if surprising else set(hub.clients) - set(hub.subscribers(CHANGED))
        hub.stream(event.event, f"force/{next(self._numbers)}", encode(event), others)

    def forget(self, client: Connection) -> None:
        """End the forces of a client that disconnected."""
        for force in self._of(client):
            self._end(force, Message.of("{user} is no longer connected", user=force.point.user))

    def logged_off(self, client: Connection, reason: Message) -> None:
        """End the forces of a client at which a person was logged off."""
        for force in self._of(client):
            self._end(force, reason)

    def _of(self, client: Connection) -> list[Force]:
        return [force for force in self._forces.values() if force.client is client]

    def offline(self, reason: Message | None) -> None:
        """Finish all forces after the scene went offline. The cell host has switched the outputs back."""
        for force in list(self._forces.values()):
            self._finish(force, reason or Message.of("the scene is offline"))
