"""What clients tell each other through the server: views, breakpoints, presence, previews, tasks (docs/protocol.md)."""

import enum
from typing import Annotated, Any

from msgspec import Meta, field

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint

Name = Annotated[str, Meta(min_length=1, max_length=200)]
"""A key, or an id that need not exist here."""


# ---------------------------------------------------------------------------------------------- view state
class ViewScope(enum.StrEnum):
    """Whose a part of the view state is."""

    USER = "user"
    SHARED = "shared"


class ViewState(Data, frozen=True):
    """The view state of a document, or what of it was changed: there, null stands for a value that went.

    document: id of a scene, project or package; empty: of none. user: whose, with scope user. revision: grows with
    every change, so that an answer and an event can be put in order.
    """

    scope: ViewScope
    values: dict[str, Any]
    revision: int
    document: str = ""
    user: str | Unset = UNSET


# ---------------------------------------------------------------------------------------------- shared breakpoints
class ProjectBreakpoints(Data, frozen=True):
    """The shared breakpoints of a project: ids of its action points and actions, and who changed them last."""

    project_id: str
    ids: set[str]
    user: str | Unset = UNSET


# ---------------------------------------------------------------------------------------------- presence
class Presence(Data, frozen=True):
    """What a user looks at and edits, as his client says.

    document: id of the scene, project or package that he sees. selected, aimed, editing: ids in it. view: the screen
    or view he is in, in his client's words. camera: from where he looks, in the world, as the frame of a camera.
    """

    document: str = ""
    selected: Annotated[list[Name], Meta(max_length=50)] = field(default_factory=list)
    aimed: Name | Unset = UNSET
    editing: Name | Unset = UNSET
    view: Annotated[str, Meta(max_length=50)] = ""
    camera: Pose | Unset = UNSET


class UserPresenceData(Data, frozen=True):
    """What the event UserPresence carries; without `presence` the user's client has not said anything yet."""

    user: str
    online: bool
    role: str
    presence: Presence | Unset = UNSET


# ---------------------------------------------------------------------------------------------- previews
class MovePreview(Data, frozen=True):
    """Where somebody drags an item just now, relative to its parent, as it would be stored.

    id: of an object, action point, orientation or joints. None of position, orientation, joints: it is over.
    """

    id: Name
    position: Position | Unset = UNSET
    orientation: Orientation | Unset = UNSET
    joints: Annotated[list[Joint], Meta(max_length=50)] | Unset = UNSET


class MovePreviewData(MovePreview, frozen=True, kw_only=True):
    """What the event MovePreview carries."""

    user: str


# ---------------------------------------------------------------------------------------------- tasks
class TaskKind(enum.StrEnum):
    """What kind of work takes its time."""

    SCENE_START = "scene_start"
    SCENE_STOP = "scene_stop"
    BUILD = "build"
    CALIBRATION = "calibration"
    UPLOAD = "upload"
    DOWNLOAD = "download"
    COMPUTATION = "computation"


class TaskProgress(enum.StrEnum):
    """How a task stands."""

    RUNNING = "running"
    FINISHED = "finished"
    FAILED = "failed"
    CANCELLED = "cancelled"


class TaskStateData(Data, frozen=True):
    """What the event TaskState carries.

    title: a sentence for people. started_by: a user's or token's name, left out where nobody asked for it.
    progress: 0..1, left out where it is not known. message: what is being done, or why it failed.
    """

    id: str
    kind: TaskKind
    title: str
    state: TaskProgress
    started: Timestamp
    started_by: str | Unset = UNSET
    progress: Annotated[float, Meta(ge=0, le=1)] | Unset = UNSET
    message: str | Unset = UNSET


# ---------------------------------------------------------------------------------------------- history
class HistoryStep(Data, frozen=True):
    """What Undo or Redo of a user would take back now.

    request: what made it. text: the sentence for the button, without `Undo` or `Redo` before it.
    """

    number: int
    request: str
    text: str


class HistoryChangedData(Data, frozen=True):
    """What the event HistoryChanged carries: of the user to whom it is sent."""

    revision: int
    undo: HistoryStep | Unset = UNSET
    redo: HistoryStep | Unset = UNSET


# ---------------------------------------------------------------------------------------------- runs
class RunEnd(enum.StrEnum):
    """How a run ended: as meant, by somebody, by an error, or with the server or its host."""

    RUNNING = "running"
    FINISHED = "finished"
    STOPPED = "stopped"
    FAILED = "failed"
    LOST = "lost"


class ActionOfRun(Data, frozen=True):
    """An action that a run was in; `name` is empty where the project does not know it."""

    id: str
    name: str = ""


class Run(Data, frozen=True):
    """One run of a package.

    project_modified: of the project that was built, which says its revision. temporary: run from the editor, its
    package is gone. started_by, stopped_by: a user's or token's name. actions: how many were begun. last_action: what
    it was in when it ended. error: what ended it, as ProjectException has it.
    """

    number: int
    package_id: str
    package_name: str
    started: Timestamp
    end: RunEnd
    actions: int = 0
    temporary: bool = False
    start_paused: bool = False
    ended: Timestamp | Unset = UNSET
    started_by: str | Unset = UNSET
    stopped_by: str | Unset = UNSET
    project_id: str | Unset = UNSET
    project_name: str | Unset = UNSET
    project_modified: Timestamp | Unset = UNSET
    last_action: ActionOfRun | Unset = UNSET
    error: str | Unset = UNSET
    error_type: str | Unset = UNSET


class TraceEntry(Data, frozen=True):
    """One action of a run, from its end: what went in, what came out, how long it took.

    number: counts the actions of the run from 1, in the order in which they were announced. started: when that was.
    duration: s, without a pause before it; left out while it runs. parameters, results: as in ActionStateBefore and
    ActionStateAfter. error: why it failed. thread_id: left out in the script's main thread.
    """

    run: int
    number: int
    action_id: str
    started: Timestamp
    name: str = ""
    duration: float | Unset = UNSET
    parameters: list[str] | Unset = UNSET
    results: list[str] | Unset = UNSET
    error: str | Unset = UNSET
    thread_id: int | Unset = UNSET


# ---------------------------------------------------------------------------------------------- reachability
class Reach(enum.StrEnum):
    """Whether an end effector gets somewhere."""

    REACHABLE = "reachable"
    NEAR_LIMIT = "near_limit"
    IN_COLLISION = "in_collision"
    OUT_OF_REACH = "out_of_reach"
    UNKNOWN = "unknown"


class ReachOfItem(Data, frozen=True):
    """Whether an end effector gets to an orientation or joints; `reason` is a sentence, where it does not."""

    id: str
    reach: Reach
    reason: str | Unset = UNSET


class ReachabilityData(Data, frozen=True):
    """What Reachability answers for each end effector, and the event ReachabilityChanged carries.

    revision: of the document for which it holds. items: orientations and joints of the open project; in the event,
    those that changed.
    """

    robot_id: str
    end_effector_id: str
    revision: int
    items: list[ReachOfItem]
    arm_id: str | Unset = UNSET
