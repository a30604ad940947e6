"""Durations and usual branches from the traces of earlier runs."""

import statistics
from collections.abc import Mapping, Sequence
from typing import Final

from arcor2_hw.compute.dry_run_tasks import KnownDuration
from arcor2_hw.compute.program_walk import UsualBranch, usual_branches
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.dry_run import ActionDuration, DurationSource
from arcor2_hw.data.run_trace import RunTrace

MAX_RUNS: Final = 5
"""Number of newest runs with a trace that are used."""

Method = str
"""Object type and method of an action, as "UR5e.pick"."""


def durations(traces: Sequence[RunTrace], methods: Mapping[str, Method]) -> dict[str, KnownDuration]:
    """Return the durations of actions: the median of the action, otherwise the median of the same method.

    Failed actions are not counted.

    Args:
        traces: the traces.
        methods: type and method of the actions of the project, by id.
    """
    by_action: dict[str, list[float]] = {}
    by_method: dict[Method, list[float]] = {}
    for trace in traces:
        for span in trace.spans:
            method = methods.get(span.action_id)
            if method is not None and isinstance(span.error, Unset):
                by_action.setdefault(span.action_id, []).append(span.duration)
                by_method.setdefault(method, []).append(span.duration)
    found: dict[str, KnownDuration] = {}
    for action, method in methods.items():
        if (own := by_action.get(action)) is not None:
            source = ActionDuration(action, DurationSource.ACTION, len(own))
        elif (own := by_method.get(method)) is not None:
            source = ActionDuration(action, DurationSource.METHOD, len(own))
        else:
            continue
        found[action] = KnownDuration(statistics.median(own), source)
    return found


def branches(trace: RunTrace, edges: Mapping[str, list[str]]) -> dict[str, UsualBranch]:
    """Return the branches that a run took most often, by id of the action. Repetitions after an error do not count.

    For a function, all executions by the same call are counted together.

    Args:
        trace: the trace of the run.
        edges: ids of the actions that may follow each action, or END.
    """
    actions = {span.number: span.action_id for span in trace.spans}
    executed: dict[str, list[str]] = {"": []}
    for span in trace.spans:
        if span.attempt is UNSET and (span.thread_id is UNSET or span.lane is not UNSET):
            call = "" if isinstance(span.call, Unset) else actions.get(span.call, "?")
            executed.setdefault(call, []).append(span.action_id)
    found: dict[str, UsualBranch] = {}
    for call, of_call in executed.items():
        # After the end of a function, its next execution starts.
        found |= usual_branches(trace.run, of_call + of_call[:1] if call else of_call, edges)
    return found
