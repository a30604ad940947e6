"""Requests about the runs of packages: their history, and the actions of the last one."""

from typing import TypeVar

from arcor2_hw.data.base import Unset
from arcor2_hw.data.editor import Run
from arcor2_hw.data.rpc import GetExecutionTraceArgs, GetExecutionTraceData, ListRunsArgs, ListRunsData
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.services import Services

T = TypeVar("T")


def _given(value: T | Unset) -> T | None:
    return None if isinstance(value, Unset) else value


def newest_runs(services: Services, args: ListRunsArgs) -> list[Run]:
    """Give the newest runs."""
    package, project = _given(args.package_id), _given(args.project_id)
    return services.runs.newest(args.limit, _given(args.before), package, project)


@rpc("ListRuns")
async def list_runs(context: Context, args: ListRunsArgs) -> ListRunsData:
    """Give the newest runs."""
    return ListRunsData(newest_runs(context.services, args))


@rpc("GetExecutionTrace")
async def get_execution_trace(context: Context, args: GetExecutionTraceArgs) -> GetExecutionTraceData:
    """Give the newest actions of the present or last run."""
    return GetExecutionTraceData(*context.services.runs.trace(args.limit, _given(args.before)))
