"""Builds the parts of the server from the bottom up and passes each its collaborators."""

import os
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

from arcor2_hw.data.audit import AuditOutcome
from arcor2_hw.data.cell import BROKER_CREDENTIALS, BROKER_URL, assigned_nodes, objects_by_node
from arcor2_hw.data.events import Event
from arcor2_hw.messages import Message
from arcor2_hw.runtime.messages import ToHost
from arcor2_hw.runtime.ring import Ring
from arcor2_server.access.admission import Access
from arcor2_server.alarms.kinds import AlarmKinds
from arcor2_server.alarms.service import Alarms
from arcor2_server.alarms.system import SystemAlarms
from arcor2_server.audit.trail import AuditTrail
from arcor2_server.build.importing import PackageImport
from arcor2_server.build.script_editing import ScriptEditing
from arcor2_server.build.service import BuildService
from arcor2_server.collaboration.lock_takeover import LockTakeover
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.log_ons import LogOns
from arcor2_server.collaboration.persons import Persons
from arcor2_server.collaboration.pins import CardHashes
from arcor2_server.collaboration.presence import PresenceBoard
from arcor2_server.collaboration.previews import Previews
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.collaboration.users import Users
from arcor2_server.collaboration.view_states import ViewStates
from arcor2_server.compute.workers import Compute
from arcor2_server.documents import Session
from arcor2_server.documents.dependents import Dependents
from arcor2_server.documents.edit_notifications import EditNotifications
from arcor2_server.documents.saved_problems import SavedProblems
from arcor2_server.dry_run.service import DryRuns
from arcor2_server.execution.breakpoints import SharedBreakpoints
from arcor2_server.execution.package_runs import PackageRuns
from arcor2_server.execution.part_books import AllPartBooks
from arcor2_server.execution.run_message import RunMessages
from arcor2_server.execution.runs import Runs
from arcor2_server.execution.service import Execution
from arcor2_server.execution.stop_all import StopAll
from arcor2_server.execution.temporary import TemporaryRuns
from arcor2_server.files import tighten
from arcor2_server.fleet.link import FleetLink
from arcor2_server.history.service import History
from arcor2_server.hosts.pool import CellHosts
from arcor2_server.hosts.session import HostSession
from arcor2_server.log.redaction import REDACTION
from arcor2_server.maintenance.devices import Devices
from arcor2_server.maintenance.parameters import Parameters
from arcor2_server.nodes.board import NodeBoard
from arcor2_server.object_types.catalog import KnownTypes
from arcor2_server.object_types.installations import InstallationWatch
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.cameras import Cameras
from arcor2_server.online.connection_check import ConnectionCheck
from arcor2_server.online.forces import Force
from arcor2_server.online.motion import RobotMotion
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.online.scene_calibration import SceneCalibration
from arcor2_server.online.scene_opening import SceneOpening
from arcor2_server.online.undo import Undo
from arcor2_server.opcua.requests import PlantRequests
from arcor2_server.opcua.service import OpcUa
from arcor2_server.packml.cell import PackmlCell
from arcor2_server.packml.plc import Plc
from arcor2_server.packml.record import CellFile
from arcor2_server.plant.feed import CellFeed
from arcor2_server.production.cell_time import CellTime, activity_of
from arcor2_server.production.recipes import Recipes
from arcor2_server.production.units import Units
from arcor2_server.recordings.service import Recordings
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import AssetStore, Storage
from arcor2_server.storage.alarms import AlarmStore
from arcor2_server.storage.calibrations import Calibrations
from arcor2_server.storage.damage_notices import DataDamage
from arcor2_server.storage.maintenance import MaintenanceStore
from arcor2_server.storage.outbox import UnitOutbox
from arcor2_server.storage.packages import Packages
from arcor2_server.storage.persons import PersonStore
from arcor2_server.storage.recipes import RecipeStore
from arcor2_server.storage.recordings import RecordingFiles
from arcor2_server.storage.secret_migration import migrate_secrets
from arcor2_server.storage.secret_store import SecretStore
from arcor2_server.storage.setting_secrets import SettingSecrets
from arcor2_server.storage.shared_data import SharedData
from arcor2_server.storage.units import UnitStore
from arcor2_server.websocket.hub import Hub
from arcor2_server.workspace.calibration import Calibration
from arcor2_server.workspace.display_models import DisplayModels
from arcor2_server.workspace.host_world import HostWorld
from arcor2_server.workspace.kinematics import Kinematics
from arcor2_server.workspace.markers import Markers
from arcor2_server.workspace.object_aiming import ObjectAimings
from arcor2_server.workspace.obstacles import ObstacleRegistry
from arcor2_server.workspace.reachability import ReachabilityBoard
from arcor2_server.workspace.robot_calibrations import RobotCalibrations
from arcor2_server.workspace.robot_models import RobotModels
from arcor2_server.workspace.robots import SceneRobots
from arcor2_server.workspace.scene_collisions import SceneCollisions

if TYPE_CHECKING:
    from arcor2_server.mqtt.service import Mqtt


class Server:
    """The parts of a running server. Only the composition root and tests see all of them."""

    async def start(self, settings: ServerSettings, stack: AsyncExitStack) -> None:
        """Build and start all parts; `stack` closes them in reverse order.

        Raises:
            StorageError: the data directory cannot be used.
        """

        def closed(part: P) -> P:
            stack.push_async_callback(_close, part)
            return part

        self.settings = settings
        # ------------------------------------------------------------------------------------ stores
        tighten(settings.data_dir)
        hub = self.hub = Hub()
        known_types = KnownTypes()
        secrets = self.secrets = SettingSecrets(known_types, SecretStore(settings.secrets_file), settings.cell)
        storage = self.storage = closed(await Storage.open(settings, secrets))
        assets = self.assets = await AssetStore.open(settings.assets_dir)
        types = self.types = ObjectTypes(known_types, storage, assets, settings.analysis_file)
        await types.load()
        damage = self.damage = DataDamage(settings.data_dir, hub)
        damage.load()
        access = self.access = Access(settings)
        if problem := access.repair():
            damage.report(problem)
        secrets.store.load(damage)
        REDACTION.hide(lambda: secrets.store.values)
        audit = self.audit = closed(AuditTrail(settings.audit_file, REDACTION.in_text))
        if edited := await audit.open():
            damage.report(edited)
        packages = Packages(settings.packages_dir, secrets.hide_in_package)
        await migrate_secrets(storage, packages, secrets)
        shared = SharedData(storage)
        type_notifications = self.type_notifications = closed(TypeNotifications(types, hub))
        compute = self.compute = closed(Compute(settings.compute_idle))
        hosts = self.hosts = CellHosts(
            settings.device_files_dirs, settings.cell, settings.broker_credentials, types.derives_from
        )
        scene_host = self.scene_host = HostSession(hub, hosts, "scene")
        program_host = self.program_host = HostSession(hub, hosts, "program", to_all_clients=True)

        installations = InstallationWatch(types, type_notifications, hosts.renew)
        installations.start()
        closed(installations)

        # ------------------------------------------------------------------------------------ session
        session = self.session = Session(settings, storage, types, damage, secrets)
        await session.open()
        closed(session)
        nodes = self.nodes = closed(board_of_nodes(settings, hub, session))
        nodes.start()
        dependents = self.dependents = Dependents(storage, types, session)
        self.saved_problems = closed(SavedProblems(storage, types, settings.problems_file))
        edit_notifications = self.edit_notifications = closed(EditNotifications(hub, session))
        locks = self.locks = Locks(
            session, stored_name(types, storage), settings.lock_retries, settings.lock_retry_wait
        )
        users = self.users = closed(Users(hub, locks, settings))
        persons = self.persons = Persons(PersonStore(storage), CardHashes(settings.data_dir))
        log_ons = self.log_ons = closed(LogOns(hub, users, persons, audit, settings.log_off_after))
        lock_takeover = self.lock_takeover = LockTakeover(locks, users, session.name_of)
        tasks = self.tasks = closed(Tasks(hub))
        presence = self.presence = closed(PresenceBoard(hub, users))
        previews = self.previews = closed(Previews(hub, locks))
        view_states = self.view_states = ViewStates(hub, shared)

        # ------------------------------------------------------------------------------------ workspace
        markers = self.markers = Markers(settings.markers_file, settings.markers)
        markers.load(damage)
        robots = self.robots = SceneRobots(assets, types, session, scene_host)
        robot_calibrations = self.robot_calibrations = closed(
            RobotCalibrations(settings, hub, types, session, scene_host, compute, damage, robots)
        )
        robot_calibrations.load()
        robot_models = self.robot_models = RobotModels(robots, robot_calibrations)
        collisions = self.collisions = ObstacleRegistry(settings.scene_inflation)
        scene_collisions = self.scene_collisions = SceneCollisions(
            assets, types, session, compute, collisions, robots, robot_models, scene_host, program_host
        )
        host_world = HostWorld(collisions, robot_calibrations, assets, scene_host, program_host)
        kinematics = self.kinematics = Kinematics(types, scene_host, compute, robots, robot_models, scene_collisions)
        self.reachability = closed(ReachabilityBoard(
            hub, types, session, scene_host, compute, collisions, robot_calibrations, robots, robot_models,
            scene_collisions,
        ))  # fmt: skip
        self.object_aiming = ObjectAimings()
        self.display_models = closed(DisplayModels(assets, compute, tasks, settings.prepared_dir))

        # ------------------------------------------------------------------------------------ services
        maintenance_store = MaintenanceStore(storage)
        devices = self.devices = Devices(hub, maintenance_store, to_both(scene_host, program_host))
        await devices.open()
        closed(devices)
        opening = SceneOpening(settings, types, session, secrets, host_world, devices.identities)
        self.connection_check = ConnectionCheck(hosts, opening)
        online = self.online = closed(
            OnlineScene(scene_host, opening, hub, locks, session, robots, tasks, robot_calibrations)
        )
        log_ons.on_end += [online.held.logged_off, online.forces.logged_off]
        online.forces.on_end.append(audit_end_of_force(audit))
        self.undo = Undo(locks, storage, types, session, online, dependents)
        motion = self.motion = RobotMotion(hub, types, session, online, robots, kinematics)
        cameras = self.cameras = Cameras(types, session, online)
        calibration = self.calibration = Calibration(compute, markers)
        calibration_records = self.calibration_records = Calibrations(storage)
        self.scene_calibration = SceneCalibration(
            hub, locks, types, session, online, calibration, calibration_records, markers, tasks, robot_models,
            motion, cameras,
        )  # fmt: skip
        build = self.build = BuildService(settings, storage, types)
        self.script_editing = ScriptEditing(storage, types, session)
        self.package_import = PackageImport(storage, assets, types, session, type_notifications)
        runs = self.runs = Runs(hub)
        history = self.history = closed(History(settings, compute, (scene_host, program_host)))
        await history.open()
        runs.on_end.append(history.run_ended)
        await runs.open(shared)
        closed(runs)
        self.dry_runs = closed(DryRuns(hub, types, session, tasks, compute, robots, scene_collisions, runs))
        breakpoints = self.breakpoints = SharedBreakpoints(hub, storage, session, shared)
        connect_edits(edit_notifications, previews, breakpoints)
        messages = RunMessages(settings, secrets, breakpoints, host_world, devices.identities)
        books = AllPartBooks(hub, settings.checkpoints_dir)
        execution = self.execution = closed(
            Execution(packages, program_host, online, settings, hub, types, runs, breakpoints, secrets, messages, books)
        )
        execution.before_start.append(lambda _: online.forces.require_none())
        recipes = self.recipes = Recipes(
            hub, RecipeStore(storage), packages, persons, released_only=settings.released_only
        )
        await recipes.open()
        unit_outbox = UnitOutbox(storage) if settings.in_fleet else None
        unit_store = UnitStore(storage, unit_outbox)
        units = self.units = closed(Units(hub, unit_store, runs, packages, calibration_records))
        await units.open(books.all)
        cell_time = self.cell_time = closed(CellTime(unit_store, lambda: activity_of(execution)))
        cell_time.start()
        connect_production(recipes, units, cell_time, execution)
        alarm_store = closed(AlarmStore(settings.alarms_file, storage, sends=settings.in_fleet))
        if damaged := await alarm_store.open():
            damage.report(damaged)
        alarms = self.alarms = Alarms(
            hub,
            alarm_store,
            AlarmKinds(types.installed_folder),
            lambda: execution.program.number if execution.active else 0,
        )
        await alarms.open()
        closed(alarms)
        connect_alarms(alarms, scene_host, program_host, execution, damage)
        connect_devices(devices, scene_host, program_host, online, execution)
        devices.start()
        self.parameters = Parameters(devices, maintenance_store, online, execution)

        def ring() -> Ring | None:
            host = program_host.host or scene_host.host
            return None if host is None else host.ring

        recordings = self.recordings = closed(Recordings(hub, RecordingFiles(settings.recordings_dir), ring))
        await recordings.open(runs.error_of)
        alarms.on_raised.append(recordings.alarm)
        execution.on_failed.append(
            lambda run, error, host: recordings.run_failed(
                run, None if error is None else error.message, None if host is None else host.ring
            )
        )
        system_alarms = self.system_alarms = closed(
            SystemAlarms(
                alarms,
                hub,
                settings.data_dir,
                settings.certificate,
                lambda: runs.starter(execution.program.number) if execution.running else "",
                nodes.lost,
            )
        )
        system_alarms.start()
        stop_all = self.stop_all = StopAll(session, online, execution)
        storage.on_deleted += [view_states.forget, breakpoints.forget, session.forget_history]
        package_runs = PackageRuns(hub, users, locks, session, online, execution, presence, lock_takeover)
        self.package_runs = package_runs
        cell_file = CellFile(settings.cell_state_file)
        cell_file.load(damage)
        cell = self.cell = PackmlCell(hub, execution, runs, online, stop_all, cell_file)
        plc = self.plc = closed(Plc(cell, cell_file, package_runs, alarms, audit, settings.plc_life_timeout))
        feed = CellFeed((scene_host, program_host), cell, execution, runs, units, types, devices, alarms)
        self.opcua = closed(OpcUa(settings, feed, PlantRequests(access, persons, plc, alarms, audit), cell, alarms))
        self.mqtt: Mqtt | None = None
        if settings.mqtt is not None:
            from arcor2_server.mqtt import service  # imported only if needed, because it takes time

            self.mqtt = closed(service.Mqtt(settings, feed, alarms))
        outboxes = [each for each in (unit_outbox, alarm_store.outbox) if each is not None]
        self.fleet = closed(
            FleetLink(settings, outboxes, feed, cell, execution, runs, units, alarms, users, locks, types)
        )
        temporary_runs = self.temporary_runs = TemporaryRuns(
            hub, locks, storage, types, session, online, execution, build, tasks
        )
        await temporary_runs.recover()

    def greeting(self) -> list[Event]:
        """Return the first events for a client: the open document, the running program or main screen, and notices."""
        state = self.session.greeting(self.online.state) or self.execution.greeting() or [self.hub.main_screen]
        return state + self.damage.greeting()


class _Closable(Protocol):
    def close(self) -> Awaitable[None] | None: ...


P = TypeVar("P", bound=_Closable)


async def _close(part: _Closable) -> None:
    if (closing := part.close()) is not None:
        await closing


@asynccontextmanager
async def running_server(settings: ServerSettings) -> AsyncIterator[Server]:
    """Start the parts, and close them in reverse order at the end.

    Raises:
        StorageError: the data directory cannot be used.
    """
    async with AsyncExitStack() as stack:
        server = Server()
        await server.start(settings, stack)
        yield server


def stored_name(types: ObjectTypes, storage: Storage) -> Callable[[str], Awaitable[str | None]]:
    """Return a function that returns the name of an object type, or of a saved scene or project; None if unknown."""

    async def find(item: str) -> str | None:
        return item if types.known(item) else await storage.name_of(item)

    return find


def board_of_nodes(settings: ServerSettings, hub: Hub, session: Session) -> NodeBoard:
    """Return the board of nodes, which follows the open scene."""
    assigned = assigned_nodes(settings.cell)

    def needed() -> dict[str, list[str]]:
        scene = session.document.scene
        return {} if scene is None else objects_by_node(settings.cell, scene.objects)

    environment = {BROKER_CREDENTIALS: str(settings.broker_credentials)} | os.environ
    credentials = Path(environment[BROKER_CREDENTIALS])

    def configured() -> bool:
        return bool(environment.get(BROKER_URL) or assigned or needed()) or credentials.is_file()

    return NodeBoard(hub, assigned, needed, configured, environment)


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


def to_both(scene_host: HostSession, program_host: HostSession) -> Callable[[ToHost], None]:
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
    """Let recipes decide what runs, and let the records of units and the times of the cell follow the program."""
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
