"""Builds the parts of the server from the bottom up and passes each its collaborators."""

from collections.abc import AsyncIterator, Awaitable
from contextlib import AsyncExitStack, asynccontextmanager
from typing import TYPE_CHECKING, Protocol, TypeVar

from arcor2_hw.data.events import Event
from arcor2_hw.runtime.ring import Rings
from arcor2_server.access.admission import Access
from arcor2_server.alarms.kinds import AlarmKinds
from arcor2_server.alarms.service import Alarms
from arcor2_server.alarms.system import SystemAlarms
from arcor2_server.app.wiring import (
    audit_end_of_force,
    board_of_nodes,
    connect_alarms,
    connect_devices,
    connect_edits,
    connect_production,
    send_to_both_hosts,
    stored_name,
)
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
from arcor2_server.execution.part_inventories import PartInventories
from arcor2_server.execution.run_message import RunMessages
from arcor2_server.execution.runs import Runs
from arcor2_server.execution.service import Execution
from arcor2_server.execution.stop_all import StopAll
from arcor2_server.execution.temporary import TemporaryRuns
from arcor2_server.files import restrict_permissions
from arcor2_server.fleet.link import FleetLink
from arcor2_server.history.service import History
from arcor2_server.hosts.pool import CellHosts
from arcor2_server.hosts.session import HostSession
from arcor2_server.log.redaction import REDACTION
from arcor2_server.maintenance.devices import Devices
from arcor2_server.maintenance.parameters import Parameters
from arcor2_server.object_types.catalog import KnownTypes
from arcor2_server.object_types.installations import InstallationWatch
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.cameras import Cameras
from arcor2_server.online.connection_check import ConnectionCheck
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


class _Closable(Protocol):
    def close(self) -> Awaitable[None] | None: ...


P = TypeVar("P", bound=_Closable)


class Server:
    """The parts of a running server. Only the composition root and tests see all of them."""

    async def start(self, settings: ServerSettings, stack: AsyncExitStack) -> None:
        """Build and start all parts from the lowest layer up; `stack` closes them in reverse order.

        Raises:
            StorageError: the data directory cannot be used.
        """
        self.settings, self._stack = settings, stack
        await self._open_stores()
        await self._open_session()
        self._build_workspace()
        await self._build_online_scene()
        await self._build_execution()
        await self._build_production()
        await self._build_alarms()
        await self._build_plant()

    def _closed(self, part: P) -> P:
        """Close a part at the end, and return it."""
        self._stack.push_async_callback(_close, part)
        return part

    async def _open_stores(self) -> None:
        """Open the stores: documents, assets, object types, credentials and the audit trail."""
        restrict_permissions(self.settings.data_dir)
        hub = self.hub = Hub()
        known_types = KnownTypes()
        secrets = self.secrets = SettingSecrets(
            known_types, SecretStore(self.settings.secrets_file), self.settings.cell
        )
        storage = self.storage = self._closed(await Storage.open(self.settings, secrets))
        assets = self.assets = await AssetStore.open(self.settings.assets_dir)
        types = self.types = ObjectTypes(known_types, storage, assets, self.settings.analysis_file)
        await types.load()
        damage = self.damage = DataDamage(self.settings.data_dir, hub)
        damage.load()
        access = self.access = Access(self.settings)
        if problem := access.repair():
            damage.report(problem)
        secrets.store.load(damage)
        REDACTION.hide(lambda: secrets.store.values)
        audit = self.audit = self._closed(AuditTrail(self.settings.audit_file, REDACTION.in_text))
        if edited := await audit.open():
            damage.report(edited)
        packages = self._packages = Packages(self.settings.packages_dir, secrets.hide_in_package)
        await migrate_secrets(storage, packages, secrets)
        self._shared = SharedData(storage)
        type_notifications = self.type_notifications = self._closed(TypeNotifications(types, hub))
        self.compute = self._closed(Compute(self.settings.compute_idle))
        hosts = self.hosts = CellHosts(
            self.settings.device_files_dirs, self.settings.cell, self.settings.broker_credentials, types.derives_from
        )
        self.scene_host = HostSession(hub, hosts, "scene")
        self.program_host = HostSession(hub, hosts, "program", to_all_clients=True)

        installations = InstallationWatch(types, type_notifications, hosts.renew)
        installations.start()
        self._closed(installations)

    async def _open_session(self) -> None:
        """Restore the open document, and build what several users share."""
        session = self.session = Session(self.settings, self.storage, self.types, self.damage, self.secrets)
        await session.open()
        self._closed(session)
        nodes = self.nodes = self._closed(board_of_nodes(self.settings, self.hub, session, self.hosts))
        nodes.start()
        self.dependents = Dependents(self.storage, self.types, session)
        self.saved_problems = self._closed(SavedProblems(self.storage, self.types, self.settings.problems_file))
        self.edit_notifications = self._closed(EditNotifications(self.hub, session))
        locks = self.locks = Locks(
            session, stored_name(self.types, self.storage), self.settings.lock_retries, self.settings.lock_retry_wait
        )
        users = self.users = self._closed(Users(self.hub, locks, self.settings))
        persons = self.persons = Persons(PersonStore(self.storage), CardHashes(self.settings.data_dir))
        self.log_ons = self._closed(LogOns(self.hub, users, persons, self.audit, self.settings.log_off_after))
        self.lock_takeover = LockTakeover(locks, users, session.name_of)
        self.tasks = self._closed(Tasks(self.hub))
        self.presence = self._closed(PresenceBoard(self.hub, users))
        self.previews = self._closed(Previews(self.hub, locks))
        self.view_states = ViewStates(self.hub, self._shared)

    def _build_workspace(self) -> None:
        """Build the models of the workplace: robots, obstacles and kinematics."""
        markers = self.markers = Markers(self.settings.markers_file, self.settings.markers)
        markers.load(self.damage)
        robots = self.robots = SceneRobots(self.assets, self.types, self.session, self.scene_host)
        robot_calibrations = self.robot_calibrations = self._closed(
            RobotCalibrations(
                self.settings, self.hub, self.types, self.session, self.scene_host, self.compute, self.damage, robots
            )
        )
        robot_calibrations.load()
        robot_models = self.robot_models = RobotModels(robots, robot_calibrations)
        collisions = self.collisions = ObstacleRegistry(self.settings.scene_inflation)
        scene_collisions = self.scene_collisions = SceneCollisions(
            self.assets,
            self.types,
            self.session,
            self.compute,
            collisions,
            robots,
            robot_models,
            self.scene_host,
            self.program_host,
        )
        self._host_world = HostWorld(collisions, robot_calibrations, self.assets, self.scene_host, self.program_host)
        self.kinematics = Kinematics(self.types, self.scene_host, self.compute, robots, robot_models, scene_collisions)
        self.reachability = self._closed(ReachabilityBoard(
            self.hub, self.types, self.session, self.scene_host, self.compute, collisions, robot_calibrations, robots,
            robot_models, scene_collisions,
        ))  # fmt: skip
        self.object_aiming = ObjectAimings()
        self.display_models = self._closed(
            DisplayModels(self.assets, self.compute, self.tasks, self.settings.prepared_dir)
        )

    async def _build_online_scene(self) -> None:
        """Build what works with connected devices."""
        maintenance_store = self._maintenance_store = MaintenanceStore(self.storage)
        devices = self.devices = Devices(
            self.hub, maintenance_store, send_to_both_hosts(self.scene_host, self.program_host)
        )
        await devices.open()
        self._closed(devices)
        opening = SceneOpening(
            self.settings, self.types, self.session, self.secrets, self._host_world, devices.identities
        )
        self.connection_check = ConnectionCheck(self.hosts, opening)
        online = self.online = self._closed(
            OnlineScene(
                self.scene_host,
                opening,
                self.hub,
                self.locks,
                self.session,
                self.robots,
                self.tasks,
                self.robot_calibrations,
            )
        )
        self.log_ons.on_end += [online.held.logged_off, online.forces.logged_off]
        online.forces.on_end.append(audit_end_of_force(self.audit))
        self.undo = Undo(self.locks, self.storage, self.types, self.session, online, self.dependents)
        motion = self.motion = RobotMotion(self.hub, self.types, self.session, online, self.robots, self.kinematics)
        cameras = self.cameras = Cameras(self.types, self.session, online)
        calibration = self.calibration = Calibration(self.compute, self.markers)
        calibration_records = self.calibration_records = Calibrations(self.storage)
        self.scene_calibration = SceneCalibration(
            self.hub, self.locks, self.types, self.session, online, calibration, calibration_records, self.markers,
            self.tasks, self.robot_models, motion, cameras,
        )  # fmt: skip

    async def _build_execution(self) -> None:
        """Build what creates, checks and runs programs."""
        self.build = BuildService(self.settings, self.storage, self.types)
        self.script_editing = ScriptEditing(self.storage, self.types, self.session)
        self.package_import = PackageImport(
            self.storage, self.assets, self.types, self.session, self.type_notifications
        )
        runs = self.runs = Runs(self.hub)
        history = self.history = self._closed(
            History(self.settings, self.compute, (self.scene_host, self.program_host))
        )
        await history.open()
        runs.on_end.append(history.run_ended)
        await runs.open(self._shared)
        self._closed(runs)
        self.dry_runs = self._closed(
            DryRuns(
                self.hub, self.types, self.session, self.tasks, self.compute, self.robots, self.scene_collisions, runs
            )
        )
        breakpoints = self.breakpoints = SharedBreakpoints(self.hub, self.storage, self.session, self._shared)
        connect_edits(self.edit_notifications, self.previews, breakpoints)
        messages = RunMessages(self.settings, self.secrets, breakpoints, self._host_world, self.devices.identities)
        inventory = self._inventories = PartInventories(self.hub, self.settings.checkpoints_dir)
        execution = self.execution = self._closed(
            Execution(
                self._packages,
                self.program_host,
                self.online,
                self.settings,
                self.hub,
                self.types,
                runs,
                breakpoints,
                self.secrets,
                messages,
                inventory,
            )
        )
        execution.before_start.append(lambda _: self.online.forces.require_none())

    async def _build_production(self) -> None:
        """Build the production records: recipes, units, and times of the cell."""
        recipes = self.recipes = Recipes(
            self.hub, RecipeStore(self.storage), self._packages, self.persons, released_only=self.settings.released_only
        )
        await recipes.open()
        unit_outbox = self._unit_outbox = UnitOutbox(self.storage) if self.settings.in_fleet else None
        unit_store = UnitStore(self.storage, unit_outbox)
        units = self.units = self._closed(
            Units(self.hub, unit_store, self.runs, self._packages, self.calibration_records)
        )
        await units.open(self._inventories.all)
        cell_time = self.cell_time = self._closed(CellTime(unit_store, lambda: activity_of(self.execution)))
        cell_time.start()
        connect_production(recipes, units, cell_time, self.execution)

    async def _build_alarms(self) -> None:
        """Build alarms, device cards and recordings."""
        alarm_store = self._alarm_store = self._closed(
            AlarmStore(self.settings.alarms_file, self.storage, sends=self.settings.in_fleet)
        )
        if damaged := await alarm_store.open():
            self.damage.report(damaged)
        alarms = self.alarms = Alarms(
            self.hub,
            alarm_store,
            AlarmKinds(self.types.installed_folder),
            lambda: self.execution.program.number if self.execution.active else 0,
        )
        await alarms.open()
        self._closed(alarms)
        connect_alarms(alarms, self.scene_host, self.program_host, self.execution, self.damage)
        connect_devices(self.devices, self.scene_host, self.program_host, self.online, self.execution)
        self.devices.start()
        self.parameters = Parameters(self.devices, self._maintenance_store, self.online, self.execution)

        def rings() -> Rings | None:
            host = self.program_host.host or self.scene_host.host
            return None if host is None else host.rings

        recordings = self.recordings = self._closed(
            Recordings(self.hub, RecordingFiles(self.settings.recordings_dir), rings)
        )
        await recordings.open(self.runs.error_of)
        alarms.on_raised.append(recordings.alarm)
        self.execution.on_failed.append(
            lambda run, error, host: recordings.run_failed(
                run, None if error is None else error.message, None if host is None else host.rings
            )
        )
        system_alarms = self.system_alarms = self._closed(
            SystemAlarms(
                alarms,
                self.hub,
                self.settings.data_dir,
                self.settings.certificate,
                lambda: self.runs.starter(self.execution.program.number) if self.execution.running else "",
                self.nodes.lost,
            )
        )
        system_alarms.start()

    async def _build_plant(self) -> None:
        """Build the model of the cell for plant systems, and the connections to them."""
        stop_all = self.stop_all = StopAll(self.session, self.online, self.execution)
        self.storage.on_deleted += [self.view_states.forget, self.breakpoints.forget, self.session.forget_history]
        package_runs = PackageRuns(
            self.hub,
            self.users,
            self.locks,
            self.session,
            self.online,
            self.execution,
            self.presence,
            self.lock_takeover,
        )
        self.package_runs = package_runs
        cell_file = CellFile(self.settings.cell_state_file)
        cell_file.load(self.damage)
        cell = self.cell = PackmlCell(self.hub, self.execution, self.runs, self.online, stop_all, cell_file)
        plc = self.plc = self._closed(
            Plc(cell, cell_file, package_runs, self.alarms, self.audit, self.settings.plc_life_timeout)
        )
        feed = CellFeed(
            (self.scene_host, self.program_host),
            cell,
            self.execution,
            self.runs,
            self.units,
            self.types,
            self.devices,
            self.alarms,
        )
        self.opcua = self._closed(
            OpcUa(
                self.settings,
                feed,
                PlantRequests(self.access, self.persons, plc, self.alarms, self.audit),
                cell,
                self.alarms,
            )
        )
        self.mqtt: Mqtt | None = None
        if self.settings.mqtt is not None:
            from arcor2_server.mqtt import service  # imported only if needed, because it takes time

            self.mqtt = self._closed(service.Mqtt(self.settings, feed, self.alarms))
        outboxes = [each for each in (self._unit_outbox, self._alarm_store.outbox) if each is not None]
        self.fleet = self._closed(
            FleetLink(
                self.settings,
                outboxes,
                feed,
                cell,
                self.execution,
                self.runs,
                self.units,
                self.alarms,
                self.users,
                self.locks,
                self.types,
            )
        )
        temporary_runs = self.temporary_runs = TemporaryRuns(
            self.hub,
            self.locks,
            self.storage,
            self.types,
            self.session,
            self.online,
            self.execution,
            self.build,
            self.tasks,
        )
        await temporary_runs.recover()

    def greeting(self) -> list[Event]:
        """Return the first events for a client: the open document, the running program or main screen, and notices."""
        state = self.session.greeting(self.online.state) or self.execution.greeting() or [self.hub.main_screen]
        return state + self.damage.greeting()


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
