"""Requests about the history of runs and the trace of the last run."""

from dataclasses import dataclass

from arcor2_hw.data.base import Unset
from arcor2_hw.data.rpc import GetExecutionTraceArgs, GetExecutionTraceData, ListRunsArgs, ListRunsData
from arcor2_server.execution.runs import Runs
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class RunRequests:
    """Requests about the history of runs and the trace of the last run."""

    _runs: Runs

    @rpc("ListRuns")
    async def list_runs(self, context: Context, args: ListRunsArgs) -> ListRunsData:
        """Return the newest runs."""
        return ListRunsData(context.translatable(self._runs.find(args)))

    @rpc("GetExecutionTrace")
    async def get_execution_trace(self, context: Context, args: GetExecutionTraceArgs) -> GetExecutionTraceData:
        """Return the newest actions of the present or last run."""
        before = None if isinstance(args.before, Unset) else args.before
        run, entries = self._runs.trace(args.limit, before)
        return GetExecutionTraceData(run, context.translatable(entries))
