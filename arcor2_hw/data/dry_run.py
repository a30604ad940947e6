"""A dry run: the predicted times of one cycle of a program, computed without devices."""

import enum

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, TranslatableData, Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.run_trace import RunTrace
from arcor2_hw.data.trace_comparison import TraceSummary


class DryRunState(enum.StrEnum):
    """State of a dry run."""

    RUNNING = "running"
    FINISHED = "finished"
    FAILED = "failed"
    CANCELLED = "cancelled"


class DurationSource(enum.StrEnum):
    """Source of the duration of an action.

    planned: the timing of its planned motion. action: the median of this action in earlier runs. method: the median of
    other actions of the same object type that call the same method. unknown: no duration is known, and 0 s are counted.
    """

    PLANNED = "planned"
    ACTION = "action"
    METHOD = "method"
    UNKNOWN = "unknown"


class ActionDuration(Data, frozen=True):
    """The source of the duration of an action. count: number of executions of which it is the median."""

    action_id: str
    source: DurationSource
    count: int = 0


class Assumption(TranslatableData, frozen=True):
    """An assumption of a dry run, as a sentence. action_id: the action to which it applies."""

    text: str
    action_id: str | Unset = UNSET


class DryRunProblem(TranslatableData, frozen=True):
    """The first action that would fail. reason: a sentence. pose: pose in the world at which it fails."""

    action_id: str
    name: str
    reason: str
    pose: Pose | Unset = UNSET


class Prediction(Data, frozen=True):
    """The result of a dry run.

    trace: as of a real run, with the number 0; `error` of a span is the reason why the action would fail. durations:
    the source of the duration of each action. problem: the first one, omitted if there is none.
    """

    trace: RunTrace
    summary: TraceSummary
    durations: list[ActionDuration] = field(default_factory=list)
    assumptions: list[Assumption] = field(default_factory=list)
    problem: DryRunProblem | Unset = UNSET


class DryRunHead(TranslatableData, frozen=True):
    """A dry run without its result, and data of the event DryRunChanged.

    number: grows by one with each dry run since the start of the server. revision: revision of the project (see
    History) that was checked. from_action: the first action, omitted for START. error: reason of a failure, with
    `key` and `values`. cycle: the predicted cycle time, s.
    """

    number: int
    project_id: str
    project_name: str
    revision: int
    state: DryRunState
    started: Timestamp
    started_by: str | Unset = UNSET
    from_action: str | Unset = UNSET
    error: str | Unset = UNSET
    cycle: float | Unset = UNSET
