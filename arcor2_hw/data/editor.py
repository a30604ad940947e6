"""Data that clients share through the server: view states, breakpoints, presence, previews, tasks, runs."""

import enum
from typing import Annotated, Any

from msgspec import Meta, field

from arcor2_hw.data.base import UNSET, Data, Timestamp, TranslatableData, Unset
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.held import ActionHold
from arcor2_hw.data.recipes import UsedRecipe
from arcor2_hw.data.robot import Joint
from arcor2_hw.messages import Message

Name = Annotated[str, Meta(min_length=1, max_length=200)]
"""A key, or an id that need not exist."""


# ---------------------------------------------------------------------------------------------- view state
class ViewScope(enum.StrEnum):
    """Scope of a part of the view state."""

    USER = "user"
    SHARED = "shared"


class ViewState(Data, frozen=True):
    """The view state of a document, or a change of it, in which null is a removed value.

    document: id of a scene, project or package; empty: none. user: the user, with scope user. revision: grows with
    every change, so that answers and events can be ordered.
    """

    scope: ViewScope
    values: dict[str, Any]
    revision: int
    document: str = ""
    user: str | Unset = UNSET


# ---------------------------------------------------------------------------------------------- shared breakpoints
class ProjectBreakpoints(Data, frozen=True):
    """The shared breakpoints of a project: ids of its action points and actions, and the user of the last change."""

    project_id: str
    ids: set[str]
    user: str | Unset = UNSET


# ---------------------------------------------------------------------------------------------- presence
class Presence(Data, frozen=True):
    """The items that a user views and edits, as reported by the client.

    document: id of the viewed scene, project or package. selected, aimed, editing: ids in it. view: name of the screen
    or view. camera: camera pose in the world, as a camera frame.
    """

    document: str = ""
    selected: Annotated[list[Name], Meta(max_length=50)] = field(default_factory=list)
    aimed: Name | Unset = UNSET
    editing: Name | Unset = UNSET
    view: Annotated[str, Meta(max_length=50)] = ""
    camera: Pose | Unset = UNSET


class UserPresenceData(Data, frozen=True):
    """Data of the event UserPresence; `presence` is omitted before the first report of the client."""

    user: str
    online: bool
    role: str
    presence: Presence | Unset = UNSET


# ---------------------------------------------------------------------------------------------- previews
class MovePreview(Data, frozen=True):
    """Pose of an item that a user is dragging, relative to its parent, as it would be stored.

    id: id of an object, action point, orientation or joints. Without position, orientation and joints, dragging has
    ended.
    """

    id: Name
    position: Position | Unset = UNSET
    orientation: Orientation | Unset = UNSET
    joints: Annotated[list[Joint], Meta(max_length=50)] | Unset = UNSET


class MovePreviewData(MovePreview, frozen=True, kw_only=True):
    """Data of the event MovePreview."""

    user: str


# ---------------------------------------------------------------------------------------------- tasks
class TaskKind(enum.StrEnum):
    """Kind of a task."""

    SCENE_START = "scene_start"
    SCENE_STOP = "scene_stop"
    BUILD = "build"
    CALIBRATION = "calibration"
    UPLOAD = "upload"
    DOWNLOAD = "download"
    COMPUTATION = "computation"


class TaskProgress(enum.StrEnum):
    """Progress of a task."""

    RUNNING = "running"
    FINISHED = "finished"
    FAILED = "failed"
    CANCELLED = "cancelled"


class TaskStateData(TranslatableData, frozen=True):
    """Data of the event TaskState.

    title: sentence for users; title_message: the data for its translation. started_by: name of a user or token,
    omitted when it was started automatically. progress: 0 to 1, omitted when unknown. message: present activity, or
    reason of the failure.
    """

    id: str
    kind: TaskKind
    title: str
    state: TaskProgress
    started: Timestamp
    started_by: str | Unset = UNSET
    progress: Annotated[float, Meta(ge=0, le=1)] | Unset = UNSET
    message: str | Unset = UNSET
    title_message: Message | Unset = UNSET


# ---------------------------------------------------------------------------------------------- history
class HistoryStep(TranslatableData, frozen=True):
    """The edit that the next undo or redo of a user reverts.

    request: request that made the edit. text: label of the button, without `Undo` or `Redo`.
    """

    number: int
    request: str
    text: str


class HistoryChangedData(Data, frozen=True):
    """Data of the event HistoryChanged, for the user to whom it is sent."""

    revision: int
    undo: HistoryStep | Unset = UNSET
    redo: HistoryStep | Unset = UNSET


# ---------------------------------------------------------------------------------------------- runs
class RunEnd(enum.StrEnum):
    """Outcome of a run: completed, stopped by a user, failed, or ended with the server or its host."""

    RUNNING = "running"
    FINISHED = "finished"
    STOPPED = "stopped"
    FAILED = "failed"
    LOST = "lost"


class CounterValue(Data, frozen=True):
    """The value of a counter of the program; `id` and `name` are those of its object."""

    id: str
    name: str
    value: int


class VariableValue(Data, frozen=True):
    """The present value of a variable of the project, JSON in a string."""

    id: str
    name: str
    value: str


class RunStatistics(Data, frozen=True):
    """Statistics of a run up to now.

    cycles: completed passes of the program from its start to its end. last_cycle, mean_cycle: durations of the last
    cycle and of all cycles, s, without cycles during which the program was paused; omitted before the first one. good,
    bad: results of actions that judge a part (`verdict`); omitted if the program has no such action. counters: counters
    that the program has used. variables: all variables of the
    project; omitted if it has none. held: time for which the program was held at failed actions, s; omitted for none.
    """

    cycles: int = 0
    last_cycle: float | Unset = UNSET
    mean_cycle: float | Unset = UNSET
    good: int | Unset = UNSET
    bad: int | Unset = UNSET
    counters: list[CounterValue] = field(default_factory=list)
    variables: list[VariableValue] | Unset = UNSET
    held: float | Unset = UNSET


class RunStatisticsData(RunStatistics, frozen=True, kw_only=True):
    """Data of the event RunStatistics; `run` is the number of the run."""

    run: int


class ActionOfRun(Data, frozen=True):
    """An action of a run; `name` is empty when the project does not contain it."""

    id: str
    name: str = ""


class Run(TranslatableData, frozen=True):
    """One run of a package.

    project_modified: modification time of the built project, which identifies its revision. temporary: run from the
    editor; its package is deleted. started_by, stopped_by: name of a user or token. actions: number of started actions.
    last_action: action that was active at the end. error: error that ended the run, with `key` and `values` as in
    ProjectException. statistics: omitted until the devices are connected, and in runs of older servers. recipe: the
    recipe; omitted without one. order: id of the order that was given at the start.
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
    statistics: RunStatistics | Unset = UNSET
    recipe: UsedRecipe | Unset = UNSET
    order: str | Unset = UNSET


class TraceEntry(TranslatableData, frozen=True):
    """One action of a run with its parameters, results and duration.

    number: number of the action in the run from 1, in the order of their start. started: time of the start. duration:
    s, without a pause before it; omitted while it runs. parameters, results: as in ActionStateBefore and
    ActionStateAfter. error: reason of a failure, with `key` and `values`. thread_id: omitted in the main thread of the
    script. call: number of the call of the function that contains the action; omitted in the program itself. attempt:
    number of the attempt of a retried action; omitted for the first one. hold: the hold of the program at the
    action.
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
    attempt: int | Unset = UNSET
    call: int | Unset = UNSET
    hold: ActionHold | Unset = UNSET


# ---------------------------------------------------------------------------------------------- reachability
class Reach(enum.StrEnum):
    """Reachability of a pose by an end effector."""

    REACHABLE = "reachable"
    NEAR_LIMIT = "near_limit"
    IN_COLLISION = "in_collision"
    OUT_OF_REACH = "out_of_reach"
    UNKNOWN = "unknown"


class ReachOfItem(TranslatableData, frozen=True):
    """Reachability of an orientation or joints by an end effector. `reason` is a sentence if they are not reachable.

    `key` and `values` are those of the reason.
    """

    id: str
    reach: Reach
    reason: str | Unset = UNSET


class ReachabilityData(Data, frozen=True):
    """Answer to Reachability for each end effector, and data of the event ReachabilityChanged.

    revision: revision of the document to which it applies. items: orientations and joints of the open project; in the
    event, those that changed.
    """

    robot_id: str
    end_effector_id: str
    revision: int
    items: list[ReachOfItem]
    arm_id: str | Unset = UNSET
