"""Requests about the history of runs and the trace of the last run."""

from typing import TypeVar

from arcor2_hw.data.base import Unset
from arcor2_hw.data.rpc import GetExecutionTraceArgs, GetExecutionTraceData, ListRunsArgs, ListRunsData
from arcor2_server.execution.runs import Runs
from arcor2_server.rpc.registry import Context, rpc

T = TypeVar("T")


def _given(value: T | Unset) -> T | None:
    return None if isinstance(value, Unset) else value


class RunRequests:
    """Requests about the runs of packages: their history, and the actions of the last one."""

    def __init__(self, runs: Runs) -> None:
        self._runs = runs

    @rpc("ListRuns")
    async def list_runs(self, context: Context, args: ListRunsArgs) -> ListRunsData:
        """Return the newest runs."""
        return ListRunsData(self._runs.find(args))

    @rpc("GetExecutionTrace")
    async def get_execution_trace(self, context: Context, args: GetExecutionTraceArgs) -> GetExecutionTraceData:
        """Return the newest actions of the present or last run."""
        return GetExecutionTraceData(*self._runs.trace(args.limit, _given(args.before)))
