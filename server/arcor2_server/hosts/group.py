"""The cell hosts of one scene or program, one for each computer with its objects. They are used like one host."""

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.data.held import HoldChoice
from arcor2_hw.data.interlocks import Interlock
from arcor2_hw.data.operation import HoldKind
from arcor2_hw.data.parts import ConfirmedPart
from arcor2_hw.exceptions import Arcor2Error, Cancelled, ConnectionLost, DeviceTimeout, OutcomeUnknown
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.ring import Rings
from arcor2_server.background import BackgroundTasks
from arcor2_server.hosts.placement import Placement, shown
from arcor2_server.hosts.process import EXIT_TIMEOUT, CellError, CellHost

log = structlog.get_logger(__name__)

CLOSE_TIMEOUT: Final = 3.0
"""Time limit for the other hosts to close their devices after the end of a program, s; a host allows 1.2 s."""

JOINED_WITHIN: Final = 10.0
"""Time limit for another host to open a scene of which it has no objects, s."""


class GroupUser(Protocol):
    """The user of a group. It receives the messages of all hosts as if they were one host."""

    def host_message(self, host: "HostGroup", message: m.ServerBound) -> None:
        """Handle a message."""

    def host_silent(self, host: "HostGroup", silent: bool) -> None:
        """Handle that a host has stopped answering, or that all hosts answer again."""

    def host_ended(self, host: "HostGroup", reason: Message) -> None:
        """Handle the end of a host, which ends the other hosts, too. This is the last call."""


@dataclass(slots=True, eq=False)
class _Member:
    """A host of the group, and its reported state."""

    host: CellHost
    silent: bool = False
    opened: bool = False
    leaving: bool = False
    """Whether the host was requested to end, or has announced its end."""
    closed: asyncio.Event = field(default_factory=asyncio.Event)
    """Set when the host has closed its devices, or has ended."""
    error: m.ErrorData | None = None
    calls: dict[int, str] = field(default_factory=dict)
    """Names of the methods that the main host is calling on objects of this host, by call number."""


class HostGroup:
    """The hosts of a scene or program.

    The main host has the robots, the interlocks and the program. Its calls of objects of other hosts pass through this
    class. If one host ends, all others stop their devices and end.

    Args:
        user: receives the messages.
        placement: nodes of the objects.
        hosts: a host for each node of the placement.
        retire: closes a host in the background.
    """

    def __init__(
        self, user: GroupUser, placement: Placement, hosts: Sequence[CellHost], retire: Callable[[CellHost], None]
    ) -> None:
        self.user = user
        self.placement = placement
        self.reason: Message | None = None
        """Reason for the end of the group; None while it runs."""
        self._members = {host.node: _Member(host) for host in hosts}
        self._main = self._members[placement.main]
        self.rings: Rings = [host.ring for host in hosts]
        """The recent values of the devices of each host, the main one first."""
        self._nodes = dict(placement.nodes)
        self._owners: dict[str, _Member] = {key: self._members[node] for key, node in self._nodes.items()}
        self._interlocked: frozenset[str] = frozenset()
        """Ids of objects whose actions have interlocks, which the main host checks."""
        self._forces: dict[int, _Member] = {}
        self._sent_stops = 0
        self._stopped: dict[str, int] = {}
        """Number of the last stop by id of the object; key "" for stops of all objects."""
        self._runs_package = self._scene_closed = False
        self._retire = retire
        self._background = BackgroundTasks()
        for host in hosts:
            host.user = self

    # -------------------------------------------------------------------------------- members
    @property
    def pid(self) -> int:
        """Return the process id of the main host."""
        return self._main.host.pid

    @property
    def others(self) -> list[_Member]:
        """Return the members without the main host."""
        return [each for each in self._members.values() if each is not self._main]

    def has(self, node: str) -> bool:
        """Return whether a host runs on a node; empty for this computer."""
        return node in self._members

    async def join(self, host: CellHost, opening: m.OpenScene) -> None:
        """Open the scene in another host, which has no objects yet, and add it.

        Args:
            host: the host.
            opening: the scene.

        Raises:
            ConnectionLost: the host or the scene has ended in the meantime.
            DeviceTimeout: the host does not open the scene.
        """
        member = _Member(host, opened=True)
        host.send(self._part(opening, member))
        try:
            await host.expect(m.SceneOpened, JOINED_WITHIN)
        except TimeoutError as error:
            raise DeviceTimeout("{computer} does not open the scene", computer=shown(host.node)) from error
        if self.reason is not None or self._main.leaving or self.has(host.node):
            raise ConnectionLost("The scene went offline in the meantime.")
        self._members[host.node] = member
        self.rings.append(host.ring)
        host.user = self

    def _owner(self, object_id: str) -> _Member:
        return self._owners.get(object_id, self._main)

    # -------------------------------------------------------------------------------- sending
    def send(self, message: m.ToHost) -> None:
        """Send a message to the hosts that it concerns."""
        main, others = self._main.host, self.others
        match message:
            case m.OpenScene():
                self._set_interlocked(message.scene.interlocks)
                for each in self._members.values():
                    each.host.send(self._part(message, each))
            case m.RunPackage():
                self._runs_package = True
                for each in self._members.values():
                    each.host.send(self._part(message, each))
            case m.StopProgram():
                self._note_stop("")
                main.send(message)
                for each in others:
                    each.host.send(m.StopAll(0))
            case m.CloseScene() | m.RenewForces():
                for each in self._members.values():
                    each.leaving = each.leaving or isinstance(message, m.CloseScene)
                    each.host.send(message)
            case m.SetInterlocks():
                self._set_interlocked(message.interlocks)
                main.send(message)
            case m.Subscribe() | m.Stream() | m.ConfirmIdentity():
                self._owner(message.object_id).host.send(message)
            case _:
                main.send(message)

    def _set_interlocked(self, interlocks: Iterable[Interlock] | Unset) -> None:
        found = () if isinstance(interlocks, Unset) else interlocks
        self._interlocked = frozenset(one.object_id for one in found if one.object_id)

    def _part(self, message: Any, member: _Member) -> Any:
        """Return the part of a message that opens a scene or runs a package for one host."""
        own = {key for key, owner in self._owners.items() if owner is member}
        remote = {key: shown(node) for key, node in self._nodes.items() if key not in own}
        main = member is self._main
        if main and not remote:
            return message
        secrets = {key: value for key, value in message.secrets.items() if key in own}
        identities = {key: value for key, value in message.identities.items() if key in own}
        message = replace(message, remote=remote, main=main, secrets=secrets, identities=identities)
        if main:
            return message
        message = replace(message, assets={}, bodies=[], calibrations={})
        if isinstance(message, m.OpenScene):
            return replace(message, scene=replace(message.scene, interlocks=UNSET))
        return replace(message, records="", continues=False, breakpoints=[], shared_breakpoints=[])

    def _note_stop(self, object_id: str) -> None:
        """Record a stop that is also sent to the main host, because the main host counts stops."""
        self._sent_stops += 1
        self._stopped[object_id] = self._sent_stops

    # -------------------------------------------------------------------------------- calls
    async def call(
        self,
        object_id: str,
        method: str,
        arguments: Mapping[str, bytes] | None = None,
        *,
        control: bool = False,
        cancel: bool = False,
        deadline: float | None = None,
    ) -> bytes:
        """Call a method of a device as `CellHost.call`.

        Calls that interlocks may prevent, and changes of poses, which robots avoid, pass through the main host.
        """
        through_main = method == "set_pose" or (object_id in self._interlocked and (control or cancel))
        member = self._main if through_main else self._owner(object_id)
        return await member.host.call(object_id, method, arguments, control=control, cancel=cancel, deadline=deadline)

    async def stop_motion(self, object_id: str) -> None:
        """Stop a device as `CellHost.stop_motion`."""
        member = self._owner(object_id)
        self._note_stop(object_id)
        if member is not self._main:
            self._main.host.send(m.StopMotion(0, object_id))
        await member.host.stop_motion(object_id)

    async def stop_all(self) -> list[m.DeviceStop]:
        """Stop all hosts at the same time as `CellHost.stop_all`.

        For hosts that do not answer, the outcome states this.
        """
        self._note_stop("")
        members = list(self._members.values())
        stops = await asyncio.gather(*(each.host.stop_all() for each in members), return_exceptions=True)
        found: list[m.DeviceStop] = []
        for member, stopped in zip(members, stops, strict=True):
            if not isinstance(stopped, BaseException):
                found += [each for each in stopped if self._owner(each.object_id) is member]
            elif member is self._main or not isinstance(stopped, Arcor2Error):
                raise stopped
            else:
                ids = (key for key, owner in self._owners.items() if owner is member)
                found += [m.DeviceStop(key, stopped.message) for key in ids]
        return found

    async def lease(self, object_id: str, hold: int, kind: HoldKind, until: float, **motion: Any) -> bytes:
        """Allow a robot to move as `CellHost.lease`."""
        return await self._owner(object_id).host.lease(object_id, hold, kind, until, **motion)

    async def force(self, object_id: str, point: str, force: int, value: bool | float, until: float) -> bytes:
        """Force an output as `CellHost.force`."""
        member = self._forces[force] = self._owner(object_id)
        return await member.host.force(object_id, point, force, value, until)

    async def end_force(self, force: int) -> None:
        """End a force as `CellHost.end_force`."""
        await self._forces.pop(force, self._main).host.end_force(force)

    async def decide(self, number: int, choice: HoldChoice, results: Sequence[str], exit_id: str) -> None:
        """Continue a held program as `CellHost.decide`."""
        await self._main.host.decide(number, choice, results, exit_id)

    async def confirm_parts(self, parts: Sequence[ConfirmedPart]) -> None:
        """Record where a person has found parts as `CellHost.confirm_parts`."""
        await self._main.host.confirm_parts(parts)

    async def retry(self, object_id: str) -> None:
        """Create and connect a failed object again as `CellHost.retry`; the main host connects its stub again."""
        member = self._owner(object_id)
        await member.host.retry(object_id)
        if member is not self._main:
            await self._main.host.retry(object_id)

    async def add(self, opening: m.OpenScene, node: str) -> None:
        """Create and connect the only object of a scene in addition to the present ones as `CellHost.add`.

        Args:
            opening: the scene.
            node: node on which the object runs. One of the hosts runs on this node.
        """
        (added,) = opening.scene.objects
        member = self._owners[added.id] = self._members[node]
        self._nodes[added.id] = node
        self.placement.names[added.id] = added.name
        await member.host.add(opening)
        if member is not self._main:
            remote = {added.id: shown(node)}
            await self._main.host.add(replace(opening, remote=remote, secrets={}, identities={}))

    # -------------------------------------------------------------------------------- end
    def kill(self) -> None:
        """Kill all processes."""
        for each in self._members.values():
            each.host.kill()

    async def close(self) -> None:
        """Close all hosts and wait for their end. The hosts stop all motion, disconnect and end."""
        self.reason = self.reason or Message.of("the devices were closed")
        await asyncio.gather(*(each.host.close() for each in self._members.values()))

    async def wait_or_kill(self, timeout: float = EXIT_TIMEOUT) -> None:
        """Wait until all processes have ended, and kill them after `timeout` s."""
        await asyncio.gather(*(each.host.wait_or_kill(timeout) for each in self._members.values()))

    def host_silent(self, host: CellHost, silent: bool) -> None:
        """Report whether all hosts answer."""
        before = any(each.silent for each in self._members.values())
        self._members[host.node].silent = silent
        if before != any(each.silent for each in self._members.values()):
            self.user.host_silent(self, silent)

    def host_ended(self, host: CellHost, reason: Message) -> None:
        """End the other hosts, unless the end of this one is expected. They stop their devices at once."""
        member = self._members[host.node]
        expected = member.leaving and (member.closed.is_set() or member is not self._main)
        member.closed.set()
        if self.reason is not None:
            return
        if expected:
            self._check_closed()
            return
        if host.node and host.node not in reason.text:
            reason = Message.of("{computer}: {reason}", computer=shown(host.node), reason=reason)
        if member.calls:
            unknown = ", ".join(dict.fromkeys(member.calls.values()))
            reason = Message.of("{reason}. It is not known whether {calls} was executed", reason=reason, calls=unknown)
        self.reason = reason
        for each in self._members.values():
            if each is not member:
                each.host.send(m.StopAll(0))  # is sent before waiting messages, at the end of the connection
                self._retire(each.host)
        self.user.host_ended(self, reason)

    # -------------------------------------------------------------------------------- receiving
    def host_message(self, host: CellHost, message: m.ServerBound) -> None:
        """Pass a message to the user, to the main host, or combine it with those of other hosts."""
        member = self._members[host.node]
        match message:
            case m.RemoteCall():
                self._call_remote(message)
            case m.DeviceChanged():
                if self._owner(message.object_id) is not member:
                    return  # the main host receives the state of this device from here
                if member is not self._main:
                    self._main.host.send(_state(message))
                self.user.host_message(self, message)
            case m.SceneOpened():
                member.opened = True
                if not self._runs_package and all(each.opened for each in self._members.values()):
                    self.user.host_message(self, message)
            case m.SceneFailed():
                self._failed(member, message)
            case m.SceneClosed():
                self._closed(member, message)
            case m.ProgramChanged(state="stopped") if self.others:
                member.leaving = True
                member.closed.set()
                self._background.spawn(self._program_over(message), "end of the hosts of a program")
            case _:
                self.user.host_message(self, message)

    def _failed(self, member: _Member, message: m.SceneFailed) -> None:
        """Report that an object cannot be connected. A program ends with the error of its stub."""
        error = message.error
        member.leaving = True
        if member.host.node and self.others:
            text = Message.of("{reason} ({computer})", reason=error.message, computer=shown(member.host.node))
            error = replace(error, message=text)
        if not self._runs_package:
            self.user.host_message(self, m.SceneFailed(error))
            return
        for key, owner in self._owners.items():
            if owner is member and error.object_id in ("", key):
                self._main.host.send(m.RemoteChanged(key, Connection.FAILED, Health.FAILURE, error.message))

    def _closed(self, member: _Member, message: m.SceneClosed) -> None:
        member.error = message.error
        member.closed.set()
        self._check_closed()

    def _check_closed(self) -> None:
        """Report when all hosts have closed the scene."""
        if (
            not self._runs_package
            and not self._scene_closed
            and all(each.closed.is_set() for each in self._members.values())
        ):
            self._scene_closed = True
            errors = (each.error for each in self._members.values() if each.error is not None)
            self.user.host_message(self, m.SceneClosed(next(errors, None)))

    async def _program_over(self, message: m.ProgramChanged) -> None:
        """Report the end of a program when the other hosts have closed their devices."""
        for each in self.others:
            each.leaving = True
            each.host.send(m.CloseScene())
        try:
            async with asyncio.timeout(CLOSE_TIMEOUT):
                await asyncio.gather(*(each.closed.wait() for each in self.others))
        except TimeoutError:
            log.warning("the devices of another host could not be closed in time")
        if self.reason is None:
            self.user.host_message(self, message)

    # -------------------------------------------------------------------------------- calls of the main host
    def _call_remote(self, message: m.RemoteCall) -> None:
        stopped = max(self._stopped.get("", 0), self._stopped.get(message.object_id, 0))
        if message.kind is m.RemoteKind.CALL and message.stops < stopped:
            error = Cancelled("{method} was stopped before it began", method=message.method)
            self._main.host.send(m.RemoteFailed(message.id, _data(error)))
            return
        self._background.spawn(self._forward(message), f"call of {message.method}")

    async def _forward(self, message: m.RemoteCall) -> None:
        """Call an object for the main host, and answer."""
        member = self._owner(message.object_id)
        host, calls = member.host, member.calls
        if message.kind is m.RemoteKind.CALL:
            name = self.placement.names.get(message.object_id, message.object_id)
            calls[message.id] = f"{name}.{message.method}"
        answer: m.ToHost
        try:
            if message.kind is m.RemoteKind.STOP:
                await host.stop_motion(message.object_id)
                answer = m.RemoteDone(message.id)
            else:
                done = await host.ask(
                    message.object_id,
                    message.method,
                    message.arguments,
                    cancel=message.kind is m.RemoteKind.CANCEL,
                    deadline=message.deadline,
                )
                answer = m.RemoteDone(message.id, done.value, done.stamp)
        except OutcomeUnknown as error:
            answer = m.RemoteFailed(message.id, _data(error))
        except Arcor2Error as error:
            answer = m.RemoteFailed(message.id, error.data if isinstance(error, CellError) else _data(error))
        finally:
            calls.pop(message.id, None)
        self._main.host.send(answer)


def _state(report: m.DeviceChanged) -> m.RemoteChanged:
    return m.RemoteChanged(
        report.object_id, report.connection, report.health, report.reason, report.in_the_way, report.values
    )


def _data(error: Arcor2Error) -> m.ErrorData:
    return m.ErrorData(error.code, type(error).__name__, error.message, error.detail)
