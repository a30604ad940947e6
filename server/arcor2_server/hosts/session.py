"""The use of cell hosts by the online scene or a program: process, device states, calls and streams."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

import msgspec
import structlog

from arcor2_hw.data.events import PackageInfoData
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub
from arcor2_server.hosts.devices import DeviceBoard
from arcor2_server.hosts.group import HostGroup
from arcor2_server.hosts.placement import Placement
from arcor2_server.hosts.pool import CellHosts
from arcor2_server.hosts.process import json_of
from arcor2_server.hosts.streams import RobotStreams

log = structlog.get_logger(__name__)

READ_TIMEOUT: Final = 5.0
"""Time limit for reading a value, s; a device on a local network needs less than 1 s."""
CANCEL_TIMEOUT: Final = 5.0
"""Time limit for cancelling an action, s."""


class HostSession:
    """The cell host of the online scene or of the running program.

    Args:
        hub: publishes the states and streams of the devices.
        pool: provides the hosts.
        what: name of the session in the log, "scene" or "program".
        to_all_clients: send streams at the streaming period to all clients, as the protocol requires for a program.
    """

    def __init__(self, hub: EventHub, pool: CellHosts, what: str, *, to_all_clients: bool = False) -> None:
        self.host: HostGroup | None = None
        self.online = False
        """Whether the devices are in operation. Set by the owner of the session."""
        self.package_info: bytes | None = None
        """The encoded event PackageInfo while a program runs. Set by the owner of the session."""
        self.board = DeviceBoard(hub)
        self.streams = RobotStreams(hub, self.send, to_all_clients=to_all_clients)
        self.deaths = 0
        """Number of hosts that have ended by themselves since the start of the server."""
        self.on_death: list[Callable[[Message], None]] = []
        """Called with the reason when the host has ended by itself, before the devices are removed."""
        self._on_message: Callable[[HostGroup, m.ServerBound], None] = lambda _host, _message: None
        self._on_end: Callable[[Message], None] = lambda _reason: None
        self._pool = pool
        self._what = what
        hub.on_leave.append(self.streams.forget)

    def observe(
        self, on_message: Callable[[HostGroup, m.ServerBound], None], on_end: Callable[[Message], None]
    ) -> None:
        """Register the owner of the session.

        Args:
            on_message: receives the messages that the session does not handle.
            on_end: called with the reason when the host has ended by itself.
        """
        self._on_message, self._on_end = on_message, on_end

    # -------------------------------------------------------------------------------- the process
    async def take(self, placement: Placement) -> HostGroup:
        """Take hosts for a placement from the pool. Raise Arcor2Error if one cannot be started.

        The caller assigns them to `host`; their messages may arrive before.
        """
        return await self._pool.take_all(self, placement)

    def place(self, objects: Iterable[SceneObject]) -> Placement:
        """Return the placement of the objects of a scene. The main host of an online scene keeps its node.

        Raises:
            SeveralNodes: they cannot work together on these nodes.
        """
        running = self.host.placement.main if self.online and self.host is not None else None
        return self._pool.place(objects, running)

    def node_of(self, scene_object: SceneObject) -> str:
        """Return the node that an object names; empty for this computer."""
        return self._pool.node_of(scene_object)

    def prepare(self) -> None:
        """Start a spare host if there is none."""
        self._pool.prepare()

    def send(self, message: m.ToHost) -> None:
        """Send a message to the host, if there is one."""
        if self.host is not None:
            self.host.send(message)

    def host_message(self, host: HostGroup, message: m.ServerBound) -> None:
        """Handle a message of the host."""
        match message:
            case m.StreamEvent():
                if host is self.host:
                    self.streams.publish(message)
            case m.DeviceChanged():
                self.board.changed(message)
                log.info(
                    "device",
                    id=message.object_id,
                    connection=message.connection.value,
                    reason="" if message.reason is None else message.reason.text,
                    health=message.health.value,
                    alarms=[alarm.text for alarm in message.alarms],
                    control=message.control_owner,
                )
            case m.DeviceIdentified():
                self.board.identified(message)
            case m.InterlocksChanged():
                self.board.interlocks_changed(message.states)
            case m.LogLine():
                log.info(self._what, level=message.level, text=message.text, object=message.object_id)
            case _:
                self._on_message(host, message)

    def host_silent(self, host: HostGroup, silent: bool) -> None:
        """Record whether the host answers."""
        if host is self.host:
            self.board.set_answering(not silent)
            log.warning(f"{self._what} does not answer" if silent else f"{self._what} answers again", pid=host.pid)

    def host_ended(self, host: HostGroup, reason: Message) -> None:
        """Report that the host has ended."""
        if host is self.host:
            self.deaths += 1
            for notify in self.on_death:
                notify(reason)
            self._on_end(reason)

    async def close(self) -> None:
        """Close all hosts of the pool when the server ends."""
        self.host = None
        await self._pool.close()

    # -------------------------------------------------------------------------------- calls
    def require_online(self) -> HostGroup:
        """Return the host. Raise RequestRefused unless the devices are in operation."""
        if not self.online or self.host is None:
            raise RequestRefused("The scene is offline. Start it first.")
        return self.host

    async def call(
        self,
        object_id: str,
        method: str,
        args: Mapping[str, Any] | None = None,
        *,
        control: bool = False,
        deadline: float | None = None,
    ) -> bytes:
        """Call a method of a device.

        Args:
            object_id: the device.
            method: the name of the method.
            args: its arguments.
            control: take control of the device first.
            deadline: time limit, s; None: the limit of the host.

        Returns:
            The result as JSON, empty for None.

        Raises:
            CellError: the device refused the call or failed.
            ConnectionLost: the host ended.
            DeviceTimeout: the device or the host did not answer in time.
            RequestRefused: the scene is offline.
        """
        encoded = {name: json_of(value) for name, value in (args or {}).items()}
        return await self.require_online().call(object_id, method, encoded, control=control, deadline=deadline)

    async def ask(self, kind: type[Any], object_id: str, method: str, args: Mapping[str, Any] | None = None) -> Any:
        """Call a method that only reads, and decode its result as `kind`. Raise the same errors as `call`."""
        raw = await self.call(object_id, method, args, deadline=READ_TIMEOUT)
        try:
            return msgspec.json.decode(raw, type=kind)
        except msgspec.MsgspecError as error:
            raise Arcor2Error("{method} returned an invalid value.", str(error), method=method) from error

    async def cancel(self, object_id: str, action: str) -> None:
        """Cancel the running action of a device."""
        await self.require_online().call(object_id, action, cancel=True, deadline=CANCEL_TIMEOUT)

    async def retry(self, object_id: str) -> None:
        """Create and connect a failed device again."""
        await self.require_online().retry(object_id)

    async def add(self, opening: m.OpenScene, node: str) -> None:
        """Create and connect the only object of a scene in addition to the present ones, on the node of a host."""
        await self.require_online().add(opening, node)

    async def extend(self, node: str, opening: m.OpenScene) -> None:
        """Start another host for the scene as `CellHosts.extend`."""
        await self._pool.extend(self.require_online(), node, opening)

    async def stop_motion(self, object_id: str) -> None:
        """Stop a device, also while it executes a call."""
        await self.require_online().stop_motion(object_id)


class _InfoEvent(msgspec.Struct):
    data: PackageInfoData


def decoded_info(event: bytes) -> PackageInfoData:
    """Return the scene and project of a running program, from the encoded event PackageInfo."""
    return msgspec.json.decode(event, type=_InfoEvent).data
