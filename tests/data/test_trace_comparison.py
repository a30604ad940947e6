"""Times in the trace of a run, and the comparison of two runs."""

import pytest

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.run_trace import RunTrace, Span, TracedDevice
from arcor2_hw.data.trace_comparison import ActionDifference, DeviceWait, Wait, compare, summarize


def trace(*spans: Span) -> RunTrace:
    devices = dict.fromkeys(span.device for span in spans)
    return RunTrace(1, devices=[TracedDevice(device, device.upper(), 0.0) for device in devices], spans=list(spans))


CYCLES = trace(
    Span(1, "act_a", "a", "arm", 0.0, 1.0),
    Span(2, "act_b", "b", "belt", 1.0, 0.5),
    Span(3, "act_a", "a", "arm", 2.0, 1.2),
    Span(4, "act_b", "b", "belt", 3.25, 0.5),
    Span(5, "act_a", "a", "arm", 5.0, 1.4),
)


def test_a_summary_states_cycle_time_bottleneck_and_waits() -> None:
    found = summarize(CYCLES)
    assert [found.whole, found.cycles, found.cycle] == pytest.approx([6.4, 2, 2.5])
    assert [(device.name, device.busy) for device in found.devices] == [("ARM", pytest.approx(3.6)), ("BELT", 1.0)]
    assert found.devices[0].share == pytest.approx(3.6 / 6.4)
    assert [(one.name, one.count, one.median, one.total) for one in found.actions] == [
        ("a", 3, 1.2, pytest.approx(3.6)),
        ("b", 2, 0.5, 1.0),
    ]
    assert found.waits[0] == Wait("a", 3.75, 1.25)
    # The arm waits for the belt, and from 3.75 s on for nothing; the belt waits for the arm.
    assert found.device_waits == [
        DeviceWait("arm", "belt", "a", pytest.approx(3.2), pytest.approx(1.8)),
        DeviceWait("belt", "arm", "b", 1.5, 1.75),
    ]
    assert [round(wait.duration, 6) for wait in found.waits] == [1.25, 0.5, 0.05]


def test_calls_of_functions_do_not_hide_waits() -> None:
    found = summarize(
        trace(
            Span(1, "act_f", "f", "", 0.0, 3.0),
            Span(2, "act_a", "a", "arm", 0.0, 1.0, call=1),
            Span(3, "act_b", "b", "belt", 2.0, 1.0, call=1),
        )
    )
    assert found.waits == [Wait("b", 1.0, 1.0)]


def test_actions_that_overlap_count_once() -> None:
    found = summarize(
        trace(
            Span(1, "act_a", "a", "arm", 0.0, 2.0),
            Span(2, "act_b", "b", "arm", 1.0, 0.5, thread_id=7),
            Span(3, "act_c", "c", "belt", 1.5, 1.5, thread_id=7),
        )
    )
    assert (found.whole, found.cycles, found.cycle, found.waits) == (3.0, 0, 3.0, [])
    assert [(device.id, device.busy) for device in found.devices] == [("arm", 2.0), ("belt", 1.5)]


def test_an_empty_run_has_no_times() -> None:
    found = summarize(RunTrace(1))
    assert (found.whole, found.cycle, found.devices, found.waits) == (0.0, 0.0, [], [])


def test_two_runs_are_compared_action_by_action() -> None:
    later = trace(
        Span(1, "act_a", "new name", "arm", 0.0, 0.9),
        Span(2, "act_c", "c", "belt", 1.0, 0.5),
        Span(3, "", "lamp.blink", "lamp", 1.5, 0.25),
    )
    found = compare(summarize(CYCLES), summarize(later))
    assert found == [
        ActionDifference("new name", "arm", 1.2, 0.9),
        ActionDifference("c", "belt", UNSET, 0.5),
        ActionDifference("lamp.blink", "lamp", UNSET, 0.25),
        ActionDifference("b", "belt", 0.5),
    ]
    assert [one.difference for one in found] == [pytest.approx(-0.3), None, None, None]
    script = summarize(trace(Span(3, "", "lamp.blink", "lamp", 1.5, 0.5)))
    assert compare(script, summarize(later))[2].difference == -0.25
