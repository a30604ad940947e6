"""StopAll: stops the program, all devices and the running action."""

import asyncio
from typing import TYPE_CHECKING, Final

import structlog

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.rpc import StopAllData, StopKind, StopOutcome
from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotFound
from arcor2_hw.runtime.messages import DeviceStop
from arcor2_server.documents import Session
from arcor2_server.execution.service import Execution
from arcor2_server.hosts.process import CellHost
from arcor2_server.online.actions import RunningAction
from arcor2_server.online.online_scene import OnlineScene

if TYPE_CHECKING:
    from arcor2_server.hosts.devices import DeviceBoard

log = structlog.get_logger(__name__)

SILENT: Final = "the cell host that controls the devices does not answer; go offline to end it"


async def _stop(host: CellHost, board: "DeviceBoard") -> tuple[str, list[DeviceStop]]:
    """Stop everything in a host; return the reason for a failure, empty on success, and the outcome per device."""
    try:
        return "", await host.stop_all()
    except ConnectionLost:  # before a host ends, it stops and disconnects the devices
        return "", []
    except DeviceTimeout:
        return SILENT, [DeviceStop(status.id, f"{status.name}: {SILENT}") for status in board.statuses()]


def _outcome(stop: DeviceStop, names: dict[str, str]) -> StopOutcome:
    name = names.get(stop.object_id, stop.object_id)
    return StopOutcome(StopKind.DEVICE, stop.object_id, name, not stop.reason, stop.reason or UNSET)


class StopAll:
    """Stops the program, all devices and the running action."""

    def __init__(self, session: Session, online: OnlineScene, execution: Execution) -> None:
        self._session = session
        self._online = online
        self._execution = execution

    async def stop_all(self, by: str) -> StopAllData:
        """Stop everything that moves or runs, in any state; return what was stopped and what was not."""
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

    async def _program(self, host: CellHost | None) -> list[StopOutcome]:
        execution = self._execution
        package, board = execution.package_id, execution.board
        names = {status.id: status.name for status in board.statuses()}
        reason, devices = ("", []) if host is None else await _stop(host, board)
        outcomes = [_outcome(stop, names) for stop in devices]
        return [StopOutcome(StopKind.PROGRAM, package, package, not reason, reason or UNSET), *outcomes]

    async def _scene(self, host: CellHost, running: RunningAction | None) -> list[StopOutcome]:
        cell = self._online
        names = {status.id: status.name for status in cell.board.statuses()}
        reason, devices = await _stop(host, cell.board)
        outcomes = [_outcome(stop, names) for stop in devices]
        if running is None:
            return outcomes
        missed = reason
        for outcome in outcomes:
            if outcome.id == running.object_id and not outcome.stopped:
                missed = str(outcome.reason)
                outcomes.remove(outcome)  # reported with the action
                break
        if cell.running_action is not running:  # it has ended
            missed = ""
        running.cancelled = not missed
        name = self._name(running.action_id)
        return [*outcomes, StopOutcome(StopKind.ACTION, running.action_id, name, not missed, missed or UNSET)]

    def _name(self, action_id: str) -> str:
        try:
            return self._session.document.action(action_id)[1].name
        except NotFound:  # deleted while it ran
            return action_id
