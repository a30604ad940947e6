"""The history of runs and their traces, and the actions of the present or last run with parameters and results."""

import asyncio
from collections import OrderedDict
from collections.abc import Callable, Collection, Mapping
from datetime import UTC, datetime
from itertools import islice
from types import MappingProxyType
from typing import Any, Final

import msgspec
import structlog
from msgspec import UNSET, Struct
from msgspec.structs import replace

from arcor2_hw.data.base import Unset, now
from arcor2_hw.data.editor import ActionOfRun, Run, RunEnd, RunStatistics, RunStatisticsData, TraceEntry
from arcor2_hw.data.events import ActionStateAfterData, ActionStateBeforeData, PackageInfoData
from arcor2_hw.data.held import ActionHold, OnError
from arcor2_hw.data.recipes import UsedRecipe
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import ListRunsArgs
from arcor2_hw.data.run_trace import RunTrace
from arcor2_hw.exceptions import NotFound, StorageError
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_server.events import EventHub, make_event
from arcor2_server.execution.run_trace import RunTraceCollector
from arcor2_server.storage.shared_data import SharedData

log = structlog.get_logger(__name__)

MAX_RUNS: Final = 1000
"""Maximum number of stored runs."""
MAX_TRACES: Final = 10
"""Maximum number of traces in memory while the database cannot be reached."""
TRACE: Final = "ExecutionTrace"
"""The additional event with the start and end of actions."""
STATISTICS: Final = "RunStatistics"
"""The additional event with cycles and counts of a run."""
MAX_ACTIONS: Final = 1000
"""Maximum number of stored actions of the last run."""


class _Before(Struct):
    data: ActionStateBeforeData


class _After(Struct):
    data: ActionStateAfterData


class _Call:
    """The published events of an action. They are decoded only on request."""

    __slots__ = ("before", "end", "failure", "hold")

    def __init__(self, before: m.ProgramEvent) -> None:
        self.before = before
        self.end: m.ProgramEvent | m.ActionFailed | None = None
        self.failure: m.ActionFailed | None = None
        """The failure at which the program was held, if the action has a result nevertheless."""
        self.hold: ActionHold | Unset = UNSET

    def entry(self, run: int) -> TraceEntry:
        announced, end = self.before, self.end
        before = msgspec.json.decode(announced.encoded, type=_Before).data
        entry = TraceEntry(
            run,
            announced.number,
            "" if isinstance(before.action_id, Unset) else before.action_id,
            datetime.fromtimestamp(announced.time, UTC).isoformat(timespec="microseconds"),
            announced.name,
            parameters=before.parameters,
            thread_id=before.thread_id,
            attempt=announced.attempt if announced.attempt > 1 else UNSET,
            call=announced.call or UNSET,
            hold=self.hold,
        )
        if (failure := self.failure) is not None and failure.error is not None:
            entry = replace(entry, error=failure.error.text, **failure.error.translation())
        match end:
            case m.ProgramEvent():
                after = msgspec.json.decode(end.encoded, type=_After).data
                return replace(entry, duration=end.time, results=after.results)
            case m.ActionFailed():
                entry = replace(entry, duration=end.duration)
                return entry if end.error is None else replace(entry, error=end.error.text, **end.error.translation())
        return entry


class RunStart(Struct, frozen=True):
    """Options of a run.

    Args:
        start_paused: pause before the first action.
        breakpoints: ids of action points and actions.
        shared_breakpoints: pause also at the shared breakpoints of the project.
        by: name of the user.
        on_error: reaction of the program if an action fails and no error exit applies.
        checkpoints: store the state before and after each action.
        continues: continue where the program was interrupted.
        continue_at: number of actions of the interrupted cycle that are not repeated; None for all.
        role: role of the user.
        by_plc: whether the PLC above the cell starts it.
        recipe_id: the recipe; empty for none.
        recipe_values: values of this run by name, JSON in a string.
        order: id of the order.
        used: the checked recipe.
        values: its values by the ids of constants and variables of the project, JSON in a string.
    """

    start_paused: bool = False
    breakpoints: Collection[str] = ()
    shared_breakpoints: bool = False
    by: str = ""
    on_error: OnError = OnError.END
    checkpoints: bool = True
    continues: bool = False
    continue_at: int | None = None
    role: Role = Role.OPERATOR
    recipe_id: str = ""
    recipe_values: Mapping[str, str] = MappingProxyType({})
    order: str = ""
    used: UsedRecipe | None = None
    values: Mapping[str, str] = MappingProxyType({})
    by_plc: bool = False

    def continuing(self, former: Run) -> "RunStart":
        """Return these options for a run that continues an interrupted one: it keeps its recipe, values and order."""
        order = self.order if isinstance(former.order, Unset) else former.order
        if isinstance(former.recipe, Unset):
            return replace(self, order=order)
        return replace(self, recipe_id=former.recipe.id, recipe_values=former.recipe.values, order=order)


class Runs:
    """All runs by number. They are stored in the database after `open` was called."""

    def __init__(self, hub: EventHub) -> None:
        self._hub = hub
        self.on_end: list[Callable[[Run], None]] = []
        """Called with each run that has ended, or was found as lost when the server started."""
        self._runs: OrderedDict[int, Run] = OrderedDict()
        self._data: SharedData | None = None
        self._writing: asyncio.Task[None] | None = None
        self._unwritten: dict[int, Run] = {}
        self._unwritten_traces: dict[int, RunTrace] = {}
        self._spans = RunTraceCollector()
        self._trace: OrderedDict[int, _Call] = OrderedDict()
        self._trace_of = 0

    async def open(self, data: SharedData) -> None:
        """Read the stored runs and mark unfinished ones as lost.

        Raises:
            StorageError: the runs cannot be read.
        """
        self._data = data
        for run in await data.runs(MAX_RUNS):
            self._runs[run.number] = run
            if run.end is RunEnd.RUNNING:
                lost = replace(
                    run, end=RunEnd.LOST, error="The server ended during the run.", error_type="ConnectionLost"
                )
                self._put(lost)

    async def close(self) -> None:
        """Wait until all runs are stored, or could not be stored."""
        if self._writing is None and self._unwritten and self._data is not None:
            self._writing = asyncio.create_task(self._write(self._data), name="runs")
        if self._writing is not None:
            await asyncio.gather(self._writing, return_exceptions=True)

    # -------------------------------------------------------------------------------- a run
    def begin(self, package_id: str, how: RunStart, *, temporary: bool) -> int:
        """Add a run that starts now; return its number."""
        number = next(reversed(self._runs), 0) + 1
        run = Run(
            number,
            package_id,
            package_id,
            now(),
            RunEnd.RUNNING,
            temporary=temporary,
            start_paused=how.start_paused,
            started_by=how.by or UNSET,
            recipe=how.used or UNSET,
            order=how.order or UNSET,
        )
        self._trace.clear()
        self._trace_of = number
        self._spans = RunTraceCollector(number)
        self._put(run)
        return number

    def describe(self, number: int, **values: Any) -> None:
        """Set fields of a run that are known after its start, such as names and the project."""
        if (run := self._runs.get(number)) is not None:
            self._put(replace(run, **values))

    def collect_spans(self, number: int, info: PackageInfoData) -> None:
        """Set the scene and project of the package of the present run, whose trace names devices and branches."""
        if number == self._spans.run:
            self._spans.describe(info)

    def end(
        self, number: int, end: RunEnd, *, error: Message | None = None, error_type: str = "", stopped_by: str = ""
    ) -> None:
        """Store the end of a run."""
        if (run := self._runs.get(number)) is None:
            return
        if number == self._spans.run and self._data is not None:
            self._unwritten_traces[number] = self._spans.trace()
        last: ActionOfRun | Any = UNSET
        if self._trace_of == number and self._trace:
            entry = next(reversed(self._trace.values())).entry(number)
            last = ActionOfRun(entry.action_id, entry.name)
            run = replace(run, actions=entry.number)
        self._put(
            replace(
                run,
                end=end,
                ended=now(),
                last_action=last,
                error=UNSET if error is None else error.text,
                **({} if error is None else error.translation()),
                error_type=error_type or UNSET,
                stopped_by=stopped_by or UNSET,
            )
        )

    def set_statistics(self, number: int, statistics: RunStatistics) -> None:
        """Store the statistics of the present run and publish them. They reach the database with the end of the run."""
        if (run := self._runs.get(number)) is None or run.statistics == statistics:
            return
        self._runs[number] = replace(run, statistics=statistics)
        if self._hub.subscribers(STATISTICS):
            data = RunStatisticsData(**msgspec.structs.asdict(statistics), run=number)
            self._hub.broadcast(make_event(STATISTICS, data))

    def announced(self, announced: m.ProgramEvent) -> None:
        """Handle ActionStateBefore or ActionStateAfter of the present run."""
        if announced.event != "ActionStateBefore":
            self.ended(announced)
            return
        self._spans.started(announced)
        call = self._trace[announced.number] = _Call(announced)
        if len(self._trace) > MAX_ACTIONS:
            self._trace.popitem(last=False)
        self._publish(call)

    def ended(self, announced: m.ProgramEvent | m.ActionFailed) -> None:
        """Handle the end (ActionStateAfter) or failure of an action of the present run."""
        match announced:
            case m.ProgramEvent():
                self._spans.ended(announced.number, announced.time, announced.waited)
            case m.ActionFailed():
                error = UNSET if announced.error is None else announced.error.text
                self._spans.ended(announced.number, announced.duration, announced.waited, error)
        if (call := self._trace.get(announced.number)) is not None:
            if isinstance(call.end, m.ActionFailed):
                call.failure = call.end
            call.end = announced
            self._publish(call)

    def set_hold(self, action: int, hold: ActionHold) -> None:
        """Record that the program is or was held at an action of the present run."""
        self._spans.set_hold(action, hold)
        if (call := self._trace.get(action)) is not None:
            call.hold = hold
            self._publish(call)

    def _publish(self, call: "_Call") -> None:
        if self._hub.subscribers(TRACE):
            self._hub.broadcast(make_event(TRACE, call.entry(self._trace_of)))

    # -------------------------------------------------------------------------------- queries
    def get(self, number: int) -> Run | None:
        """Return a run, None if the number is unknown."""
        return self._runs.get(number)

    def error_of(self, number: int) -> Message | None:
        """Return the error that ended a run, None if it has none or is unknown."""
        run = self._runs.get(number)
        return None if run is None or isinstance(run.error, Unset) else run.as_message(run.error)

    def entry(self, number: int) -> TraceEntry | None:
        """Return an action of the present or last run, None if it is unknown."""
        call = self._trace.get(number)
        return None if call is None else call.entry(self._trace_of)

    def starter(self, number: int) -> str:
        """Return the user who started a run; empty if unknown."""
        run = self._runs.get(number)
        return "" if run is None or isinstance(run.started_by, Unset) else run.started_by

    def last_action(self, number: int) -> str:
        """Return the name of the last started action of a run; empty if there is none."""
        if self._trace_of != number or not self._trace:
            return ""
        return next(reversed(self._trace.values())).entry(number).name

    def find(self, args: ListRunsArgs) -> list[Run]:
        """Return the runs selected by the arguments of ListRuns, newest first."""
        found = (
            self._with_action_count(run)
            for run in reversed(self._runs.values())
            if (isinstance(args.before, Unset) or run.number < args.before)
            and args.package_id in (UNSET, run.package_id)
            and args.project_id in (UNSET, run.project_id)
        )
        return [*islice(found, args.limit)]

    def trace(self, limit: int, before: int | None = None) -> tuple[int, list[TraceEntry]]:
        """Return the number of the last run (0: none) and its actions, newest first."""
        calls = (call for number, call in reversed(self._trace.items()) if before is None or number < before)
        return self._trace_of, [call.entry(self._trace_of) for call in islice(calls, limit)]

    async def run_trace(self, number: int) -> RunTrace:
        """Return the trace of a run, during the run that of the actions that have ended.

        Raises:
            NotFound: the number is unknown, or an older server stored no trace of the run.
            StorageError: the trace cannot be read.
        """
        if number == self._spans.run:
            return self._spans.trace()
        stored = self._unwritten_traces.get(number)
        if stored is None and self._data is not None:
            stored = await self._data.run_trace(number)
        if number not in self._runs or stored is None:
            raise NotFound("Run {number} has no trace.", number=number)
        return stored

    # -------------------------------------------------------------------------------- storage
    def _with_action_count(self, run: Run) -> Run:
        if run.end is RunEnd.RUNNING and run.number == self._trace_of and self._trace:
            return replace(run, actions=next(reversed(self._trace)))
        return run

    def _put(self, run: Run) -> None:
        self._runs[run.number] = run
        if len(self._runs) > MAX_RUNS:
            self._runs.popitem(last=False)
        self._hub.broadcast(make_event("RunChanged", run))
        if run.end is not RunEnd.RUNNING:
            for notify in self.on_end:
                notify(run)
        if self._data is not None:
            self._unwritten[run.number] = run
            if self._writing is None:
                self._writing = asyncio.create_task(self._write(self._data), name="runs")

    async def _write(self, data: SharedData) -> None:
        """Store changed runs until none is left. Only the newest state of a run is stored."""
        try:
            while self._unwritten:
                number, run = next(iter(self._unwritten.items()))
                await data.put_run(run, next(iter(self._runs)))
                if (trace := self._unwritten_traces.get(number)) is not None:
                    await data.put_run_trace(trace)
                    del self._unwritten_traces[number]
                if self._unwritten.get(number) is run:
                    del self._unwritten[number]
        except StorageError as error:  # try again with the next change
            log.warning("run not stored", reason=str(error))
            for old in list(self._unwritten_traces)[:-MAX_TRACES]:
                del self._unwritten_traces[old]
        finally:
            self._writing = None
