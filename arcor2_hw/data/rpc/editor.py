"""Arguments and answers of what the editor asks beside the protocol (docs/protocol.md)."""

from typing import Annotated, Any

from msgspec import Meta, field

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.editor import Name, Run, TraceEntry, ViewScope


class GetViewStateArgs(Data, frozen=True):
    """Arguments of GetViewState; `user`: whose, else the caller's."""

    scope: ViewScope
    document: Annotated[str, Meta(max_length=200)] = ""
    user: str | Unset = UNSET


class SetViewStateArgs(Data, frozen=True):
    """Arguments of SetViewState: values by their keys; null takes one away, those that are not named stay."""

    scope: ViewScope
    values: Annotated[dict[Name, Any], Meta(min_length=1, max_length=1000)]
    document: Annotated[str, Meta(max_length=200)] = ""


class SetViewStateData(Data, frozen=True):
    """What SetViewState answers: the revision of the view state that there is now."""

    revision: int


class GetBreakpointsArgs(Data, frozen=True):
    """Arguments of GetBreakpoints: of which project, else of the open one."""

    project_id: str | Unset = UNSET


class SetBreakpointsArgs(Data, frozen=True):
    """Arguments of SetBreakpoints: ids of action points and actions of a project, else of the open one."""

    add: Annotated[set[Name], Meta(max_length=1000)] = field(default_factory=set)
    remove: Annotated[set[Name], Meta(max_length=1000)] = field(default_factory=set)
    project_id: str | Unset = UNSET


class ListRunsArgs(Data, frozen=True):
    """Arguments of ListRuns: at most so many, the newest ones before that number, of a package or a project."""

    limit: Annotated[int, Meta(ge=0, le=500)] = 50
    before: int | Unset = UNSET
    package_id: str | Unset = UNSET
    project_id: str | Unset = UNSET


class ListRunsData(Data, frozen=True):
    """What ListRuns answers: runs, newest first."""

    runs: list[Run]


class GetExecutionTraceArgs(Data, frozen=True):
    """Arguments of GetExecutionTrace: at most so many actions of the present or last run, the newest first."""

    limit: Annotated[int, Meta(ge=0, le=1000)] = 100
    before: int | Unset = UNSET


class GetExecutionTraceData(Data, frozen=True):
    """What GetExecutionTrace answers: the run (0: there was none), and its actions, newest first."""

    run: int
    entries: list[TraceEntry]


class ReachabilityArgs(Data, frozen=True):
    """Arguments of Reachability: of which robot, arm and end effector, else of all; for which items, else for all.

    ids: orientations and joints of the open project.
    """

    robot_id: str | Unset = UNSET
    arm_id: str | Unset = UNSET
    end_effector_id: str | Unset = UNSET
    ids: Annotated[set[Name], Meta(max_length=10_000)] | Unset = UNSET
