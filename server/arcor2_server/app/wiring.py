"""Connects independent parts of the server: forwards the reports of one part to others."""

import os
from collections.abc import Awaitable, Callable
from pathlib import Path

from arcor2_hw.data.audit import AuditOutcome
from arcor2_hw.data.cell import BROKER_CREDENTIALS, BROKER_URL, assigned_nodes, objects_by_node
from arcor2_hw.exceptions import SeveralNodes
from arcor2_hw.messages import Message
from arcor2_hw.runtime.messages import ToHost
from arcor2_server.alarms.service import Alarms
from arcor2_server.audit.trail import AuditTrail
from arcor2_server.collaboration.previews import Previews
from arcor2_server.documents import Session
from arcor2_server.documents.edit_notifications import EditNotifications
from arcor2_server.execution.breakpoints import SharedBreakpoints
from arcor2_server.execution.service import Execution
from arcor2_server.hosts.pool import CellHosts
from arcor2_server.hosts.session import HostSession
from arcor2_server.maintenance.devices import Devices
from arcor2_server.nodes.board import NodeBoard
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.forces import Force
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.production.cell_time import CellTime
from arcor2_server.production.recipes import Recipes
from arcor2_server.production.units import Units
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from arcor2_server.storage.damage_notices import DataDamage
from arcor2_server.websocket.hub import Hub


def stored_name(types: ObjectTypes, storage: Storage) -> Callable[[str], Awaitable[str | None]]:
    """Return a function that returns the name of an object type, or of a saved scene or project; None if unknown."""

    async def find(item: str) -> str | None:
        return item if types.known(item) else await storage.name_of(item)

    return find


def board_of_nodes(settings: ServerSettings, hub: Hub, session: Session, hosts: CellHosts) -> NodeBoard:
    """Return the board of nodes, which follows the open scene."""
    assigned = assigned_nodes(settings.cell)

    def needed() -> dict[str, list[str]]:
        scene = session.document.scene
        return {} if scene is None else objects_by_node(settings.cell, scene.objects)

    def apart() -> Message | None:
        try:
            hosts.place([] if session.document.scene is None else session.document.scene.objects)
        except SeveralNodes as error:
            return error.message
        return None

    environment = {BROKER_CREDENTIALS: str(settings.broker_credentials)} | os.environ
    credentials = Path(environment[BROKER_CREDENTIALS])

    def configured() -> bool:
        return bool(environment.get(BROKER_URL) or assigned or needed()) or credentials.is_file()

    return NodeBoard(hub, assigned, needed, configured, environment, apart=apart)


def connect_alarms(
    alarms: Alarms, scene_host: HostSession, program_host: HostSession, execution: Execution, damage: DataDamage
) -> None:
    """Connect the alarm service to the reports of the hosts, the program and the storage."""
    for host, what in ((scene_host, "scene"), (program_host, "program")):
        alarms.watch(host.board, what)
        host.on_death.append(lambda reason: alarms.system("host_died", None, reason, with_devices=True))
    execution.on_error.append(alarms.failed)
    execution.on_decided.append(alarms.decided)
    for notice in damage.notices:
        alarms.data_damaged(notice)
    damage.on_report.append(alarms.data_damaged)


def audit_end_of_force(audit: AuditTrail) -> Callable[[Force, Message], None]:
    """Return a function that notes the end of a force without a request."""

    def note(force: Force, reason: Message) -> None:
        audit.note(
            AuditOutcome.DONE,
            "EndForce",
            target=force.output,
            user=force.point.user,
            role=force.client.role,
            address=force.client.address,
            reason=str(reason),
            changes=[force.change(force.point.value, force.before)],
        )

    return note


def send_to_both_hosts(scene_host: HostSession, program_host: HostSession) -> Callable[[ToHost], None]:
    """Return a function that sends a message to the host of the scene and to that of the program."""

    def send(message: ToHost) -> None:
        scene_host.send(message)
        program_host.send(message)

    return send


def connect_devices(
    devices: Devices, scene_host: HostSession, program_host: HostSession, online: OnlineScene, execution: Execution
) -> None:
    """Connect the device cards to the reports of the hosts, and count the actions of devices."""
    for host, what in ((scene_host, "scene"), (program_host, "program")):
        devices.watch(host.board, what)
    online.on_device_action.append(devices.acted)
    execution.on_device_action.append(devices.acted)


def connect_production(recipes: Recipes, units: Units, cell_time: CellTime, execution: Execution) -> None:
    """Let recipes select what runs, and update units and cell times from the program."""
    execution.before_run.append(recipes.prepare_run)
    execution.before_replacing.append(recipes.require_unused)
    execution.on_begin.append(units.begin_run)
    execution.on_part_step.append(units.concern)
    execution.on_action_end.append(units.action_ended)
    execution.parts.on_change.append(units.follow)
    execution.on_state.append(cell_time.changed)


def connect_edits(edits: EditNotifications, previews: Previews, breakpoints: SharedBreakpoints) -> None:
    """Subscribe the previews and breakpoints to edits: previews of edited items end, and so do unused breakpoints."""
    edits.on_edit.append(lambda changes: previews.changed({change.id for change in changes}))
    edits.on_pause.append(lambda _: previews.end_changed())
    edits.on_pause.append(breakpoints.changed)
