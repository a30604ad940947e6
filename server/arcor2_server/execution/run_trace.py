"""Collects the trace of a run from the events of its actions."""

from collections import deque
from datetime import UTC, datetime
from typing import Final

import msgspec
from msgspec import UNSET, Struct
from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.events import PackageInfoData
from arcor2_hw.data.held import ActionHold
from arcor2_hw.data.position import MAIN_BRANCH
from arcor2_hw.data.run_trace import RunTrace, Span, traced_devices
from arcor2_hw.runtime import messages as m

MAX_SPANS: Final = 10_000
"""Maximum number of stored actions of a run."""


class _Data(Struct):
    action_id: str | Unset = UNSET
    thread_id: int | Unset = UNSET


class _Before(Struct):
    data: _Data


class RunTraceCollector:
    """Collects the trace of one run; the oldest actions of a long run are dropped."""

    def __init__(self, run: int = 0) -> None:
        self.run = run
        self._running: dict[int, m.ProgramEvent] = {}
        self._spans: deque[Span] = deque(maxlen=MAX_SPANS)
        self._began: float | None = None
        self._ended = 0
        self._holds: dict[int, ActionHold] = {}
        self._names: dict[str, str] = {}
        self._branches: dict[tuple[str, str], str] = {}
        self._last: dict[int | Unset, str] = {}
        """The id of the last action of each thread."""

    def describe(self, info: PackageInfoData) -> None:
        """Set the scene and project of the running package."""
        self._names = {each.id: each.name for each in info.scene.objects}
        self._branches = {
            (item.start, item.end): item.condition.value
            for item in (*info.project.logic, *(item for each in info.project.functions for item in each.logic))
            if not isinstance(item.condition, Unset)
        }

    def started(self, announced: m.ProgramEvent) -> None:
        """Handle the start of an action."""
        self._running[announced.number] = announced

    def set_hold(self, number: int, hold: ActionHold) -> None:
        """Set the time for which the program was held at an action."""
        self._holds[number] = hold

    def ended(self, number: int, duration: float, waited: float, error: str | Unset = UNSET) -> None:
        """Handle the end of an action.

        Args:
            number: the number of the action in the run.
            duration: the duration, s.
            waited: pause between announcement and start, s.
            error: reason of a failure.
        """
        before = self._running.pop(number, None)
        if before is None:
            return
        data = msgspec.json.decode(before.encoded, type=_Before).data
        action_id = "" if isinstance(data.action_id, Unset) else data.action_id
        start = before.time + waited
        if self._began is None:
            self._began = start
        branch = self._branches.get((self._last.get(data.thread_id, ""), action_id), UNSET)
        # An action after an error exit did not follow a condition.
        self._last[data.thread_id] = action_id if isinstance(error, Unset) else ""
        self._ended += 1
        self._spans.append(
            Span(
                number,
                action_id,
                before.name,
                before.device,
                round(start - self._began, 6),
                round(duration, 6),
                branch,
                error,
                data.thread_id,
                before.call or UNSET,
                before.attempt if before.attempt > 1 else UNSET,
                UNSET if before.branch == MAIN_BRANCH else before.branch,
            )
        )

    def trace(self) -> RunTrace:
        """Return the trace of the actions that have ended so far."""
        if self._began is None:
            return RunTrace(self.run)
        spans = sorted(self._spans, key=lambda span: span.number)
        spans = [replace(span, hold=self._holds.get(span.number, UNSET)) for span in spans]
        return RunTrace(
            self.run,
            datetime.fromtimestamp(self._began, UTC).isoformat(timespec="microseconds"),
            traced_devices(spans, self._names),
            spans,
            self._ended - len(spans),
        )
