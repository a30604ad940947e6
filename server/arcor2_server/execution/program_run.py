"""One run of a package: the reports of its program, its error, and its entry in the history of runs."""

import asyncio
from collections.abc import Set
from typing import Any

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.editor import RunEnd
from arcor2_hw.data.events import PackageInfoData, ProjectExceptionData
from arcor2_hw.data.position import MAIN_BRANCH, Branch, Frame, ProgramPosition
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_server.execution.run_statistics import RunStatisticsCollector
from arcor2_server.execution.runs import Runs, RunStart
from arcor2_server.storage.package_versions import check_versions
from arcor2_server.storage.packages import Packages

log = structlog.get_logger(__name__)


class _ExceptionEvent(msgspec.Struct):
    data: ProjectExceptionData


class ProgramRun:
    """The present or last run of a package.

    Args:
        runs: the history of runs.
        package_id: the package; empty before the first run.
        shared_of: the project with the shared breakpoints of the program; empty for none.
    """

    def __init__(self, runs: Runs, package_id: str = "", shared_of: str = "") -> None:
        self.package_id = package_id
        self.shared_of = shared_of
        self.stopped_by: str | None = None
        """The user who stopped the program."""
        self.error: m.ErrorData | None = None
        """The error that ended the program, None if it finished or was stopped."""
        self.action: bytes | None = None
        """The encoded ActionStateBefore of the running action, or of the action before which the program is paused.

        For actions of a function, it is that of the outermost call.
        """
        self._runs = runs
        self._statistics: RunStatisticsCollector | None = None
        self._exception: ProjectExceptionData | None = None
        self._frames: dict[str, list[Frame]] = {}
        self._branches: dict[int, str] = {}
        """The branches by the number of the call that each of them runs."""
        self._number = 0

    def begin(self, how: RunStart, *, temporary: bool) -> None:
        """Add the run to the history."""
        self._number = self._runs.begin(self.package_id, how, temporary=temporary)

    async def describe(self, packages: Packages) -> None:
        """Store the names of package and project with the run, and log differences of package versions."""
        try:
            summary = await asyncio.to_thread(packages.mark_executed, self.package_id)
            project = summary.project_meta
            of: dict[str, Any] = {}
            if not isinstance(project, Unset):
                of = {"project_id": project.id, "project_name": project.name, "project_modified": project.modified}
            self._runs.describe(self._number, package_name=summary.package_meta.name, **of)
            directory = packages.path_of(self.package_id)
            for difference in await asyncio.to_thread(check_versions, directory):
                log.warning("package was built with another version", package=self.package_id, difference=difference)
        except Arcor2Error as error:
            log.warning("package of the run cannot be read", package=self.package_id, reason=str(error))

    def collect_statistics(self, info: PackageInfoData, verdicts: Set[str]) -> None:
        """Start to collect statistics, and name the devices of the trace.

        `verdicts`: ids of the actions whose result says that a part is good.
        """
        self._statistics = RunStatisticsCollector(info, verdicts)
        self._runs.set_statistics(self._number, self._statistics.statistics())
        self._runs.collect_spans(self._number, info)

    def handle_held(self, seconds: float) -> None:
        """Store the time for which the program has been held, s."""
        if self._statistics is not None:
            self._statistics.set_held(seconds)
            self._runs.set_statistics(self._number, self._statistics.statistics())

    def handle_paused(self) -> None:
        """Handle a pause of the program."""
        if self._statistics is not None:
            self._statistics.handle_paused()

    @property
    def number(self) -> int:
        """The number of the run in the history; 0 before the first one."""
        return self._number

    @property
    def position(self) -> ProgramPosition:
        """The present position of the program."""
        return ProgramPosition(self._number, [Branch(key, frames) for key, frames in self._frames.items()])

    def handle_event(self, message: m.ProgramEvent) -> None:
        """Store an event of the program."""
        if message.number:
            self._runs.announced(message)
        if message.frames:
            if message.call and message.branch != MAIN_BRANCH and message.branch not in self._frames:
                self._branches[message.number] = message.branch
            self._frames[message.branch] = message.frames
        statistics, changed = self._statistics, False
        match message.event:
            case "ActionStateBefore":
                if not message.call:
                    self.action = message.encoded
                changed = statistics is not None and statistics.handle_start(message.encoded, message.attempt)
            case "ActionStateAfter":
                self.action_over(message.number)
                if not message.call:
                    self.action = None
                changed = statistics is not None and statistics.handle_result(message.encoded)
            case "ProjectException":
                self._exception = msgspec.json.decode(message.encoded, type=_ExceptionEvent).data
        if statistics is not None and changed:
            self._runs.set_statistics(self._number, statistics.statistics())

    def action_over(self, number: int) -> bool:
        """Handle the end of an action. Return whether a branch has ended with it."""
        return self._frames.pop(self._branches.pop(number, ""), None) is not None

    def handle_end(self, error: m.ErrorData | None) -> None:
        """Store the error with which the program ended, None if it finished."""
        self.error = error
        if error is not None and (published := self._exception) is not None:  # the published text names the device
            key, values = published.key or published.message, published.values or {}
            self.error = replace(error, type=published.type, message=Message(published.message, key, values))

    def end(self, *, lost: bool) -> RunEnd:
        """Store the end of the run and return it."""
        error = self.error
        self._frames.clear()
        end = RunEnd.FINISHED if error is None else RunEnd.LOST if lost else RunEnd.FAILED
        if self.stopped_by is not None:
            end = RunEnd.STOPPED
        if self._statistics is not None:
            if end is RunEnd.FINISHED:
                self._statistics.handle_finished()
            self._runs.set_statistics(self._number, self._statistics.statistics())
        self._runs.end(
            self._number,
            end,
            error=None if error is None else error.message,
            error_type="" if error is None else error.type,
            stopped_by=self.stopped_by or "",
        )
        self.action = None
        return end
