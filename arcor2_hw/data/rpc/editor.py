"""Arguments and answers of additional requests of the editor."""

from typing import Annotated, Any, Final

from msgspec import Meta, field

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.editor import (
    MovePreview,
    Name,
    Presence,
    ProjectBreakpoints,
    ReachabilityData,
    Run,
    TraceEntry,
    ViewScope,
    ViewState,
)
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc


class GetViewStateArgs(Data, frozen=True):
    """Arguments of GetViewState; `user`: the user, by default the caller."""

    scope: ViewScope
    document: Annotated[str, Meta(max_length=200)] = ""
    user: str | Unset = UNSET


class SetViewStateArgs(Data, frozen=True):
    """Arguments of SetViewState: values by key; null removes a value, other keys are unchanged."""

    scope: ViewScope
    values: Annotated[dict[Name, Any], Meta(min_length=1, max_length=1000)]
    document: Annotated[str, Meta(max_length=200)] = ""


class SetViewStateData(Data, frozen=True):
    """Answer to SetViewState: the new revision of the view state."""

    revision: int


class GetBreakpointsArgs(Data, frozen=True):
    """Arguments of GetBreakpoints: the project, by default the open one."""

    project_id: str | Unset = UNSET


class SetBreakpointsArgs(Data, frozen=True):
    """Arguments of SetBreakpoints: ids of action points and actions, and the project, by default the open one."""

    add: Annotated[set[Name], Meta(max_length=1000)] = field(default_factory=set)
    remove: Annotated[set[Name], Meta(max_length=1000)] = field(default_factory=set)
    project_id: str | Unset = UNSET


class ListRunsArgs(Data, frozen=True):
    """Arguments of ListRuns: maximum number, number before which runs are listed, package or project."""

    limit: Annotated[int, Meta(ge=0, le=500)] = 50
    before: int | Unset = UNSET
    package_id: str | Unset = UNSET
    project_id: str | Unset = UNSET


class ListRunsData(Data, frozen=True):
    """Answer to ListRuns: runs, newest first."""

    runs: list[Run]


class GetExecutionTraceArgs(Data, frozen=True):
    """Arguments of GetExecutionTrace: maximum number of actions of the present or last run."""

    limit: Annotated[int, Meta(ge=0, le=1000)] = 100
    before: int | Unset = UNSET


class GetExecutionTraceData(Data, frozen=True):
    """Answer to GetExecutionTrace: the number of the run (0: none), and its actions, newest first."""

    run: int
    entries: list[TraceEntry]


class ReachabilityArgs(Data, frozen=True):
    """Arguments of Reachability: robot, arm and end effector, by default all; items, by default all.

    ids: orientations and joints of the open project.
    """

    robot_id: str | Unset = UNSET
    arm_id: str | Unset = UNSET
    end_effector_id: str | Unset = UNSET
    ids: Annotated[set[Name], Meta(max_length=10_000)] | Unset = UNSET


EDITOR_RPCS: Final = (
    Rpc("GetBreakpoints", GetBreakpointsArgs, ProjectBreakpoints, Role.OPERATOR, args_optional=True, additional=True),
    Rpc(
        "GetExecutionTrace",
        GetExecutionTraceArgs,
        GetExecutionTraceData,
        Role.OPERATOR,
        args_optional=True,
        additional=True,
    ),
    Rpc("GetViewState", GetViewStateArgs, ViewState, Role.OPERATOR, additional=True),
    Rpc("ListRuns", ListRunsArgs, ListRunsData, Role.OPERATOR, args_optional=True, additional=True),
    Rpc("PreviewMove", MovePreview, None, Role.STANDARD_USER, additional=True),
    Rpc("Reachability", ReachabilityArgs, list[ReachabilityData], Role.OPERATOR, args_optional=True, additional=True),
    Rpc("SetBreakpoints", SetBreakpointsArgs, ProjectBreakpoints, Role.STANDARD_USER, additional=True),
    Rpc("SetViewState", SetViewStateArgs, SetViewStateData, Role.OPERATOR, additional=True),
    Rpc("UpdatePresence", Presence, None, Role.OPERATOR, additional=True),
)
"""Requests of the editor."""
