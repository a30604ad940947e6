"""Builds the parts of the server from the bottom up and passes each its collaborators."""

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass

from arcor2_hw.data.events import Event
from arcor2_server.access.admission import Access
from arcor2_server.build.importing import PackageImport
from arcor2_server.build.service import BuildService
from arcor2_server.collaboration.lock_takeover import LockTakeover
from arcor2_server.collaboration.locks import Locks
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
from arcor2_server.execution.breakpoints import SharedBreakpoints
from arcor2_server.execution.package_runs import PackageRuns
from arcor2_server.execution.run_message import RunMessages
from arcor2_server.execution.runs import Runs
from arcor2_server.execution.service import Execution
from arcor2_server.execution.stop_all import StopAll
from arcor2_server.execution.temporary import TemporaryRuns
from arcor2_server.files import tighten
from arcor2_server.hosts.pool import CellHosts
from arcor2_server.hosts.session import HostSession
from arcor2_server.log.redaction import REDACTION
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.cameras import Cameras
from arcor2_server.online.motion import RobotMotion
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.online.opening import SceneOpening
from arcor2_server.online.scene_calibration import SceneCalibration
from arcor2_server.online.undo import Undo
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import AssetStore, Storage
from arcor2_server.storage.calibrations import Calibrations
from arcor2_server.storage.damage_notices import DataDamage
from arcor2_server.storage.packages import Packages
from arcor2_server.storage.secret_migration import migrate_secrets
from arcor2_server.storage.secret_store import SecretStore
from arcor2_server.storage.setting_secrets import SettingSecrets
from arcor2_server.storage.shared_data import SharedData
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


@dataclass(frozen=True, slots=True)
class Server:
    """The parts of a running server. Only the composition root and tests see all of them."""

    settings: ServerSettings
    access: Access
    hub: Hub
    storage: Storage
    assets: AssetStore
    damage: DataDamage
    secrets: SettingSecrets
    types: ObjectTypes
    type_notifications: TypeNotifications
    compute: Compute
    hosts: CellHosts
    session: Session
    dependents: Dependents
    edit_notifications: EditNotifications
    saved_problems: SavedProblems
    locks: Locks
    users: Users
    lock_takeover: LockTakeover
    tasks: Tasks
    previews: Previews
    view_states: ViewStates
    presence: PresenceBoard
    markers: Markers
    calibration: Calibration
    calibration_records: Calibrations
    scene_calibration: SceneCalibration
    object_aiming: ObjectAimings
    robots: SceneRobots
    robot_calibrations: RobotCalibrations
    robot_models: RobotModels
    collisions: ObstacleRegistry
    scene_collisions: SceneCollisions
    kinematics: Kinematics
    reachability: ReachabilityBoard
    display_models: DisplayModels
    online: OnlineScene
    motion: RobotMotion
    undo: Undo
    cameras: Cameras
    build: BuildService
    package_import: PackageImport
    execution: Execution
    runs: Runs
    breakpoints: SharedBreakpoints
    package_runs: PackageRuns
    temporary_runs: TemporaryRuns
    stop_all: StopAll

    def greeting(self) -> list[Event]:
        """Return the first events for a client: the open document, the running program or main screen, and notices."""
        state = self.session.greeting(self.online.state) or self.execution.greeting() or [self.hub.main_screen]
        return state + self.damage.greeting()


@asynccontextmanager
async def running_server(settings: ServerSettings) -> AsyncIterator[Server]:
    """Build and start all parts; close them in reverse order at the end.

    Raises:
        StorageError: the data directory cannot be used.
    """
    async with AsyncExitStack() as stack:
        # ------------------------------------------------------------------------------------ stores
        tighten(settings.data_dir)
        storage = await Storage.open(settings)
        stack.push_async_callback(storage.close)
        assets = await AssetStore.open(settings.assets_dir)
        hub = Hub()
        types = ObjectTypes(storage, assets, settings.analysis_file)
        await types.load()
        damage = DataDamage(settings.data_dir, hub)
        damage.load()
        access = Access(settings)
        if problem := access.repair():
            damage.report(problem)
        secrets = SettingSecrets(types, SecretStore(settings.secrets_file), settings.cell)
        secrets.store.load(damage)
        storage.secrets = secrets
        REDACTION.secrets = lambda: secrets.store.values
        packages = Packages(settings.packages_dir, secrets.hide_in_package)
        await migrate_secrets(storage, packages, secrets)
        shared = SharedData(storage)
        type_notifications = TypeNotifications(types, hub)
        stack.push_async_callback(type_notifications.close)
        compute = Compute(settings.compute_idle)
        stack.push_async_callback(compute.close)
        hosts = CellHosts(settings.device_files_dirs)
        scene_host = HostSession(hub, hosts, "scene")
        program_host = HostSession(hub, hosts, "program", to_all_clients=True)

        # ------------------------------------------------------------------------------------ session
        session = Session(settings, storage, types, damage, secrets)
        await session.open()
        stack.push_async_callback(session.close)
        dependents = Dependents(storage, types, session)
        saved_problems = SavedProblems(storage, types, settings.problems_file)
        stack.push_async_callback(saved_problems.close)
        edit_notifications = EditNotifications(hub, session)
        stack.callback(edit_notifications.close)
        locks = Locks(session, is_stored(types, storage), settings.lock_retries, settings.lock_retry_wait)
        users = Users(hub, locks, settings)
        stack.callback(users.close)
        lock_takeover = LockTakeover(locks, users, session.name_of)
        tasks = Tasks(hub)
        stack.callback(tasks.close)
        presence = PresenceBoard(hub, users)
        stack.callback(presence.close)
        previews = Previews(hub, locks)
        stack.callback(previews.close)
        view_states = ViewStates(hub, shared)

        # ------------------------------------------------------------------------------------ workspace
        markers = Markers(settings.markers_file, settings.markers)
        markers.load(damage)
        robots = SceneRobots(assets, types, session, scene_host)
        robot_calibrations = RobotCalibrations(settings, hub, types, session, scene_host, compute, damage, robots)
        robot_calibrations.load()
        stack.push_async_callback(robot_calibrations.close)
        robot_models = RobotModels(robots, robot_calibrations)
        collisions = ObstacleRegistry(settings.scene_inflation)
        scene_collisions = SceneCollisions(
            assets, types, session, compute, collisions, robots, robot_models, scene_host, program_host
        )
        host_world = HostWorld(collisions, robot_calibrations, assets, scene_host, program_host)
        kinematics = Kinematics(types, scene_host, compute, robots, robot_models, scene_collisions)
        reachability = ReachabilityBoard(
            hub, types, session, scene_host, compute, collisions, robot_calibrations, robots, robot_models,
            scene_collisions,
        )  # fmt: skip
        stack.push_async_callback(reachability.close)
        display_models = DisplayModels(assets, compute, tasks, settings.prepared_dir)
        stack.push_async_callback(display_models.close)

        # ------------------------------------------------------------------------------------ services
        opening = SceneOpening(settings, types, session, secrets, host_world)
        online = OnlineScene(scene_host, opening, hub, locks, session, robots, tasks, robot_calibrations)
        stack.push_async_callback(online.close)
        motion = RobotMotion(hub, types, session, online, robots, kinematics)
        cameras = Cameras(types, session, online)
        calibration = Calibration(compute, markers)
        calibration_records = Calibrations(storage)
        scene_calibration = SceneCalibration(
            hub, locks, types, session, online, calibration, calibration_records, markers, tasks, robot_models,
            motion, cameras,
        )  # fmt: skip
        build = BuildService(settings, storage, types)
        package_import = PackageImport(storage, assets, types, session, type_notifications)
        runs = Runs(hub)
        await runs.open(shared)
        stack.push_async_callback(runs.close)
        breakpoints = SharedBreakpoints(hub, storage, session, shared)
        connect_edits(edit_notifications, previews, breakpoints)
        messages = RunMessages(settings, secrets, breakpoints, host_world)
        execution = Execution(
            packages, program_host, online, settings, hub, types, runs, breakpoints, secrets, messages
        )
        stack.push_async_callback(execution.close)
        storage.on_deleted += [view_states.forget, breakpoints.forget, session.forget_history]
        package_runs = PackageRuns(hub, users, locks, session, online, execution, presence, lock_takeover)
        temporary_runs = TemporaryRuns(hub, locks, storage, types, session, online, execution, build, tasks)
        await temporary_runs.recover()

        yield Server(
            settings=settings,
            access=access,
            hub=hub,
            storage=storage,
            assets=assets,
            damage=damage,
            secrets=secrets,
            types=types,
            type_notifications=type_notifications,
            compute=compute,
            hosts=hosts,
            session=session,
            dependents=dependents,
            edit_notifications=edit_notifications,
            saved_problems=saved_problems,
            locks=locks,
            users=users,
            lock_takeover=lock_takeover,
            tasks=tasks,
            previews=previews,
            view_states=view_states,
            presence=presence,
            markers=markers,
            calibration=calibration,
            calibration_records=calibration_records,
            scene_calibration=scene_calibration,
            object_aiming=ObjectAimings(),
            robots=robots,
            robot_calibrations=robot_calibrations,
            robot_models=robot_models,
            collisions=collisions,
            scene_collisions=scene_collisions,
            kinematics=kinematics,
            reachability=reachability,
            display_models=display_models,
            online=online,
            motion=motion,
            undo=Undo(locks, storage, types, session, online, dependents),
            cameras=cameras,
            build=build,
            package_import=package_import,
            execution=execution,
            runs=runs,
            breakpoints=breakpoints,
            package_runs=package_runs,
            temporary_runs=temporary_runs,
            stop_all=StopAll(session, online, execution),
        )


def is_stored(types: ObjectTypes, storage: Storage) -> Callable[[str], Awaitable[bool]]:
    """Return a function that returns whether an id names an object type, or a saved scene or project."""

    async def check(item: str) -> bool:
        return types.known(item) or await storage.identify(item) is not None

    return check


def connect_edits(edits: EditNotifications, previews: Previews, breakpoints: SharedBreakpoints) -> None:
    """Subscribe the previews and breakpoints to edits: previews of edited items end, and so do unused breakpoints."""
    edits.on_edit.append(lambda changes: previews.changed({change.id for change in changes}))
    edits.on_pause.append(lambda _: previews.end_changed())
    edits.on_pause.append(breakpoints.changed)
