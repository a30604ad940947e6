"""Data of earlier runs for a dry run: durations of actions, and usual branches."""

from arcor2_hw.compute.dry_run_tasks import KnownDuration
from arcor2_hw.compute.program_walk import UsualBranch
from arcor2_hw.data.dry_run import ActionDuration, DurationSource
from arcor2_hw.data.run_trace import RunTrace, Span
from arcor2_server.dry_run.past_runs import branches, durations

METHODS = {"a": "Lamp.blink", "b": "Lamp.blink", "c": "Belt.run", "d": "Belt.halt"}
FAILED = Span(4, "c", "c", "belt", 9.0, 60.0, error="It jams.")
RUN = RunTrace(
    5,
    spans=[
        Span(1, "a", "a", "lamp", 0.0, 1.0),
        Span(2, "c", "c", "belt", 1.0, 4.0),
        Span(3, "a", "a", "lamp", 5.0, 3.0),
        FAILED,
        Span(5, "gone", "gone", "lamp", 9.0, 9.0),
    ],
)


def test_durations_are_medians_of_the_action_or_of_its_method() -> None:
    found = durations([RUN, RunTrace(4, spans=[Span(1, "a", "a", "lamp", 0.0, 1.5)])], METHODS)
    assert found == {
        "a": KnownDuration(1.5, ActionDuration("a", DurationSource.ACTION, 3)),
        "b": KnownDuration(1.5, ActionDuration("b", DurationSource.METHOD, 3)),
        "c": KnownDuration(4.0, ActionDuration("c", DurationSource.ACTION, 1)),
    }


def test_functions_other_threads_and_repetitions_are_not_branches() -> None:
    spans = [
        Span(1, "a", "a", "lamp", 0.0, 1.0, error="It is dark."),
        Span(2, "a", "a", "lamp", 1.0, 1.0, attempt=2),
        Span(3, "inside", "inside", "lamp", 1.0, 1.0, call=1),
        Span(4, "other", "other", "lamp", 1.0, 1.0, thread_id=7),
        Span(5, "c", "c", "belt", 2.0, 1.0),
    ]
    assert branches(RunTrace(6, spans=spans), {"a": ["b", "c", "END"]}) == {"a": UsualBranch(6, "c")}
