"""StopAll: stops the program, all devices and the running action."""

import asyncio
from typing import TYPE_CHECKING, Final

import structlog
from msgspec.structs import replace

from arcor2_hw.data.rpc import StopAllData, StopKind, StopOutcome
from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotFound
from arcor2_hw.messages import Message
from arcor2_hw.runtime.messages import DeviceStop
from arcor2_server.documents import Session
from arcor2_server.execution.service import Execution
from arcor2_server.hosts.group import HostGroup
from arcor2_server.online.actions import RunningAction
from arcor2_server.online.online_scene import OnlineScene

if TYPE_CHECKING:
    from arcor2_server.hosts.devices import DeviceBoard

log = structlog.get_logger(__name__)

HOST_SILENT: Final = Message.of("the cell host that controls the devices does not answer; go offline to end it")


async def _stop(host: HostGroup, board: "DeviceBoard") -> tuple[Message | None, list[DeviceStop]]:
    """Stop everything in a host; return the reason for a failure, None on success, and the outcome per device."""
    try:
        return None, await host.stop_all()
    except ConnectionLost:  # before a host ends, it stops and disconnects the devices
        return None, []
    except DeviceTimeout:
        return HOST_SILENT, [
            DeviceStop(status.id, Message.of("{device}: {reason}", device=status.name, reason=HOST_SILENT))
            for status in board.statuses()
        ]


def _outcome(kind: StopKind, key: str, name: str, reason: Message | None) -> StopOutcome:
    outcome = StopOutcome(kind, key, name, reason is None)
    return outcome if reason is None else replace(outcome, reason=reason.text, **reason.translation())


def _of_devices(stops: list[DeviceStop], names: dict[str, str]) -> list[StopOutcome]:
    return [
        _outcome(StopKind.DEVICE, stop.object_id, names.get(stop.object_id, stop.object_id), stop.reason)
        for stop in stops
    ]


class StopAll:
    """Stops the program, all devices and the running action."""

    def __init__(self, session: Session, online: OnlineScene, execution: Execution) -> None:
        self._session = session
        self._online = online
        self._execution = execution

    async def stop_all(self, by: str) -> StopAllData:
        """Stop everything that moves or runs, in any state. Return which parts were stopped and which were not."""
        execution = self._execution
        active, action = execution.active, self._online.running_action
        program, scene = execution.begin_stop_all(by), self._online.begin_stop_all(by)
        parts = [self._program(program)] if active else []
        if scene is not None:
            parts.append(self._scene(scene, action))
        outcomes = [outcome for part in await asyncio.gather(*parts) for outcome in part]
        missed = [outcome.reason for outcome in outcomes if not outcome.stopped]
        log.warning("stop all", by=by, stopped=len(outcomes) - len(missed), not_stopped=missed)
        return StopAllData(outcomes)

    async def _program(self, host: HostGroup | None) -> list[StopOutcome]:
        execution = self._execution
        package, board = execution.program.package_id, execution.board
        names = {status.id: status.name for status in board.statuses()}
        reason, devices = (None, []) if host is None else await _stop(host, board)
        return [_outcome(StopKind.PROGRAM, package, package, reason), *_of_devices(devices, names)]

    async def _scene(self, host: HostGroup, running: RunningAction | None) -> list[StopOutcome]:
        cell = self._online
        names = {status.id: status.name for status in cell.board.statuses()}
        reason, devices = await _stop(host, cell.board)
        if running is None:
            return _of_devices(devices, names)
        for stop in devices:
            if stop.object_id == running.object_id and stop.reason is not None:
                reason = stop.reason
                devices.remove(stop)  # the failure is reported with the action
                break
        if cell.running_action is not running:  # it has ended
            reason = None
        running.cancelled = reason is None
        action = _outcome(StopKind.ACTION, running.action_id, self._name(running.action_id), reason)
        return [*_of_devices(devices, names), action]

    def _name(self, action_id: str) -> str:
        try:
            return self._session.document.action(action_id).name
        except NotFound:  # the package was deleted while it ran
            return action_id
