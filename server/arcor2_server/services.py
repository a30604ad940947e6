"""The parts of the server, each made once, known to each other through this one object."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from arcor2_server.collaboration.presence import PresenceBoard
from arcor2_server.collaboration.previews import Previews
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.collaboration.view_states import ViewStates
from arcor2_server.compute.calibration import Calibration, CalibrationService, RunningCalibrations
from arcor2_server.compute.workers import Compute
from arcor2_server.documents.edit_notifications import EditNews
from arcor2_server.documents.saved_problems import SavedProblems
from arcor2_server.documents.setting_secrets import SettingSecrets
from arcor2_server.execution.breakpoints import SharedBreakpoints
from arcor2_server.execution.runs import Runs
from arcor2_server.object_types.notifications import TypeNews
from arcor2_server.rpc.answer_cache import KeptAnswers
from arcor2_server.storage.calibrations import Calibrations
from arcor2_server.storage.damage_notices import DataDamage
from arcor2_server.storage.secret_store import SecretStore
from arcor2_server.storage.shared_data import SharedData
from arcor2_server.workspace.collisions import CollisionWorld
from arcor2_server.workspace.display_models import PreparedAssets
from arcor2_server.workspace.markers import Markers
from arcor2_server.workspace.object_aiming import Aiming
from arcor2_server.workspace.reachability import ReachabilityBoard
from arcor2_server.workspace.robot_calibrations import ArmCalibrations

if TYPE_CHECKING:
    from arcor2_hw.data.events import Event
    from arcor2_server.access.admission import Access
    from arcor2_server.build.service import BuildService
    from arcor2_server.collaboration.locks import Locks
    from arcor2_server.collaboration.users import Users
    from arcor2_server.documents import Session
    from arcor2_server.execution.service import Execution
    from arcor2_server.object_types.registry import ObjectTypes
    from arcor2_server.online.online_scene import OnlineCell
    from arcor2_server.settings import ServerSettings
    from arcor2_server.storage import AssetStore, Storage
    from arcor2_server.websocket.hub import Hub


@dataclass(slots=True)
class Services:
    """What handlers work with.

    access: who gets in. hub: the connected clients. users: who is logged in. locks: who holds what.
    storage: saved documents. assets: meshes and the like. types: what is known of object types.
    session: the open scene or project.
    cell: the scene when online. execution: packages and the running program. build: project to package.
    compute: what needs numerics. calibration: poses from pictures. calibrations: what is being calibrated.
    calibration_records: what was. markers: which stand where. aiming: who points a robot at an object.
    collisions: what is in the way. type_news: object types that clients have to be told of. kept: encoded answers.
    saved_problems: what prevents saved documents from being opened. runs: their history.
    tasks: work under way. previews: what is dragged. views: what clients show, by user and shared.
    breakpoints: the shared ones. presence: who looks at what. edit_news: what follows from edits.
    reachability: what robots reach of the open project. prepared: meshes and robots as clients show them.
    arm_calibrations: what controllers told of their very arms. damage: notices about damaged files.
    secrets: takes secret settings out of documents.
    """

    settings: "ServerSettings"
    access: "Access"
    hub: "Hub"
    users: "Users"
    locks: "Locks"
    storage: "Storage"
    assets: "AssetStore"
    types: "ObjectTypes"
    session: "Session"
    cell: "OnlineCell"
    execution: "Execution"
    build: "BuildService"
    calibration: Calibration = field(init=False)
    calibration_records: Calibrations = field(init=False)
    compute: Compute = field(init=False)
    markers: Markers = field(init=False)
    calibrations: RunningCalibrations = field(default_factory=RunningCalibrations)
    aiming: Aiming = field(default_factory=Aiming)
    collisions: CollisionWorld = field(default_factory=CollisionWorld)
    type_news: TypeNews = field(default_factory=TypeNews)
    kept: KeptAnswers = field(default_factory=KeptAnswers)
    saved_problems: SavedProblems = field(init=False)
    runs: Runs = field(init=False)
    tasks: Tasks = field(init=False)
    previews: Previews = field(init=False)
    views: ViewStates = field(init=False)
    breakpoints: SharedBreakpoints = field(init=False)
    presence: PresenceBoard = field(init=False)
    edit_news: EditNews = field(init=False)
    reachability: ReachabilityBoard = field(init=False)
    prepared: PreparedAssets = field(init=False)
    arm_calibrations: ArmCalibrations = field(init=False)
    damage: DataDamage = field(init=False)
    secrets: SettingSecrets = field(init=False)

    def __post_init__(self) -> None:
        """Make what needs no more than these."""
        self.damage = DataDamage(self.settings.data_dir, self.hub)
        self.secrets = SettingSecrets(self.types, SecretStore(self.settings.secrets_file), self.settings.cell)
        self.compute = Compute(self.settings.compute_idle)
        self.calibration = CalibrationService(self)
        self.calibration_records = Calibrations(self.storage)
        self.arm_calibrations = ArmCalibrations(self, self.settings.arm_calibrations_file)
        self.prepared = PreparedAssets(self, self.settings.prepared_dir)
        self.markers = Markers(self.settings.markers_file, self.settings.markers)
        self.saved_problems = SavedProblems(self.storage, self.types, self.settings.problems_file)
        data = SharedData(self.storage)
        self.runs = Runs(self.hub)
        self.tasks = Tasks(self.hub)
        self.previews = Previews(self.hub, self.locks)
        self.views = ViewStates(self.hub, data)
        self.breakpoints = SharedBreakpoints(self, data)

    async def share(self) -> None:
        """Bring up what clients share, once the session is there. StorageError."""
        await self.runs.open(SharedData(self.storage))
        self.presence = PresenceBoard(self.hub, self.users)
        self.edit_news = EditNews(self)
        self.reachability = ReachabilityBoard(self)
        self.storage.on_deleted += [self.views.forget, self.breakpoints.forget, self.session.forget_history]

    async def close_shared(self) -> None:
        """End what `share` brought up."""
        await self.saved_problems.close()
        await self.prepared.close()
        await self.arm_calibrations.close()
        await self.reachability.close()
        self.edit_news.close()
        self.presence.close()
        self.previews.close()
        self.tasks.close()
        await self.runs.close()

    def greeting(self) -> list["Event"]:
        """Return what a client is sent when it is let in: what is open, what runs, or the main screen; then notices."""
        state = self.session.greeting() or self.execution.greeting() or [self.hub.main_screen]
        return state + self.damage.greeting()
