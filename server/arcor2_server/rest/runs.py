"""The history of runs over REST."""

import asyncio
from dataclasses import dataclass

import msgspec

from arcor2_hw.data.editor import Run
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import ListRunsArgs
from arcor2_hw.data.run_trace import RunTrace, chrome_trace
from arcor2_hw.data.trace_comparison import TraceSummary, summarize
from arcor2_hw.exceptions import NotFound
from arcor2_server.execution.runs import Runs
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import Binary, operation


@dataclass(frozen=True, slots=True)
class RunOperations:
    """The history of runs over REST."""

    _runs: Runs

    @operation("GET", "/api/runs", SERVER, Role.OPERATOR, plain=True)
    async def list_runs(self, query: ListRunsArgs) -> list[Run]:
        """Return the newest runs of packages: user, package, time and result."""
        return self._runs.find(query)

    @operation("GET", "/api/runs/{number}/trace", SERVER, Role.OPERATOR, plain=True)
    async def run_trace(self, number: str) -> RunTrace:
        """Return the executed actions of a run by device."""
        return await self._runs.run_trace(_number(number))

    @operation("GET", "/api/runs/{number}/summary", SERVER, Role.OPERATOR, plain=True)
    async def run_summary(self, number: str) -> TraceSummary:
        """Return cycle time, bottleneck and waits of a run."""
        trace = await self._runs.run_trace(_number(number))
        return await asyncio.to_thread(summarize, trace)

    @operation("GET", "/api/runs/{number}/chrome-trace", SERVER, Role.OPERATOR, media_type="application/octet-stream")
    async def run_chrome_trace(self, number: str) -> Binary:
        """Return the executed actions of a run in the Trace Event Format of chrome://tracing and Perfetto."""
        trace = await self._runs.run_trace(_number(number))
        title = f"run {trace.run}"
        content = await asyncio.to_thread(
            lambda: msgspec.json.encode(chrome_trace(title, trace.devices, trace.spans)),
        )
        return Binary(content, "application/octet-stream", f"run-{trace.run}.trace.json")


def _number(text: str) -> int:
    """Return the number of a run. Raise NotFound if the text is not a number."""
    if not (text.isascii() and text.isdecimal() and len(text) < 10):
        raise NotFound("Run {number} has no trace.", number=text[:20])
    return int(text)
