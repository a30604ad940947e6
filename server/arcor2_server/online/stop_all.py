"""StopAll: one request that stops the program, every robot and device, and the action that is being tried."""

import asyncio
from typing import TYPE_CHECKING, Final

import structlog

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.rpc import StopAllData, StopKind, StopOutcome
from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotFound
from arcor2_hw.runtime.messages import DeviceStop
from arcor2_server.hosts.process import CellHost
from arcor2_server.online.actions import RunningAction

if TYPE_CHECKING:
    from arcor2_server.hosts.devices import DeviceBoard
    from arcor2_server.services import Services

log = structlog.get_logger(__name__)

SILENT: Final = "the process that controls the devices does not answer; go offline to end it"


async def stop_all(services: "Services", by: str) -> StopAllData:
    """Stop whatever moves or runs, in every state of scene and program; return what was stopped and what was not."""
    execution = services.execution
    active, action = execution.active, services.cell.running_action
    program, scene = execution.begin_stop_all(by), services.cell.begin_stop_all(by)
    parts = [_program(services, program)] if active else []
    if scene is not None:
        parts.append(_scene(services, scene, action))
    outcomes = [outcome for part in await asyncio.gather(*parts) for outcome in part]
    missed = [outcome.reason for outcome in outcomes if not outcome.stopped]
    log.warning("stop all", by=by, stopped=len(outcomes) - len(missed), not_stopped=missed)
    return StopAllData(outcomes)


async def _program(services: "Services", host: CellHost | None) -> list[StopOutcome]:
    execution = services.execution
    package, board = execution.package_id, execution.board
    names = {status.id: status.name for status in board.statuses()}
    reason, devices = ("", []) if host is None else await _stop(host, board)
    outcomes = [_outcome(stop, names) for stop in devices]
    return [StopOutcome(StopKind.PROGRAM, package, package, not reason, reason or UNSET), *outcomes]


async def _scene(services: "Services", host: CellHost, running: RunningAction | None) -> list[StopOutcome]:
    cell = services.cell
    names = {status.id: status.name for status in cell.board.statuses()}
    reason, devices = await _stop(host, cell.board)
    outcomes = [_outcome(stop, names) for stop in devices]
    if running is None:
        return outcomes
    missed = reason
    for outcome in outcomes:
        if outcome.id == running.object_id and not outcome.stopped:
            missed = str(outcome.reason)
            outcomes.remove(outcome)  # the same fact as that of the action
            break
    if cell.running_action is not running:  # it has ended
        missed = ""
    running.cancelled = not missed
    name = _name(services, running.action_id)
    return [*outcomes, StopOutcome(StopKind.ACTION, running.action_id, name, not missed, missed or UNSET)]


async def _stop(host: CellHost, board: "DeviceBoard") -> tuple[str, list[DeviceStop]]:
    """Stop everything in a host; return why that failed, empty if it did not, and what became of the devices."""
    try:
        return "", await host.stop_all()
    except ConnectionLost:  # the host has ended: before it does, it stops and disconnects the devices
        return "", []
    except DeviceTimeout:
        return SILENT, [DeviceStop(one.id, f"{one.name}: {SILENT}") for one in board.statuses()]


def _outcome(stop: DeviceStop, names: dict[str, str]) -> StopOutcome:
    name = names.get(stop.object_id, stop.object_id)
    return StopOutcome(StopKind.DEVICE, stop.object_id, name, not stop.reason, stop.reason or UNSET)


def _name(services: "Services", action_id: str) -> str:
    try:
        return services.session.action(action_id)[1].name
    except NotFound:  # deleted while it ran
        return action_id
