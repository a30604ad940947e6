"""The trace of a run: spans by device, branches, and the Chrome trace."""

import json

import msgspec
import pytest

from arcor2_hw.data.events import PackageInfoData
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.project import Action, ActionPoint, LogicItem, Project, ProjectLogicIf
from arcor2_hw.data.run_trace import Span, TracedDevice, chrome_trace
from arcor2_hw.data.scene import Scene
from arcor2_hw.runtime import messages as m
from arcor2_server.execution import run_trace
from arcor2_server.execution.run_trace import RunTraceCollector
from tests.runtime.conftest import scene_object

TAKEN = ProjectLogicIf("act_a/default/0", "true")
OTHER = ProjectLogicIf("act_a/default/0", "false")
INFO = PackageInfoData(
    "pkg_1",
    "package",
    Scene("scene", id="scn_1", objects=[scene_object("lamp", "Lamp"), scene_object("belt", "Belt")]),
    Project(
        "project",
        "scn_1",
        id="pro_1",
        action_points=[
            ActionPoint("p", Position(), id="acp", actions=[Action(n, "obj_lamp/blink", f"act_{n}") for n in "abc"])
        ],
        logic=[
            LogicItem("START", "act_a"),
            LogicItem("act_a", "act_b", TAKEN),
            LogicItem("act_a", "act_c", OTHER),
            LogicItem("act_b", "act_c"),
        ],
    ),
)


def begin(trace: RunTraceCollector, number: int, action: str, device: str, time: float) -> None:
    data = {"event": "ActionStateBefore", "data": {"action_id": action}}
    encoded = msgspec.json.encode(data)
    trace.started(m.ProgramEvent("ActionStateBefore", encoded, number, action[4:], time, device))


def test_spans_name_device_and_branch_and_exclude_pauses() -> None:
    trace = RunTraceCollector(3)
    trace.describe(INFO)
    assert trace.trace().spans == []
    begin(trace, 1, "act_a", "obj_lamp", 1000.0)
    trace.ended(1, 0.5, 0.0)
    begin(trace, 2, "act_b", "obj_belt", 1000.5)
    trace.ended(2, 0.25, 4.0)  # the program was paused before
    begin(trace, 3, "act_c", "obj_lamp", 1004.75)
    trace.ended(3, 0.5, 0.0, "It jams.")
    trace.ended(9, 0.5, 0.0)  # this action never started
    begin(trace, 4, "act_a", "obj_lamp", 1010.0)  # still running
    found = trace.trace()
    assert found.spans == [
        Span(1, "act_a", "a", "obj_lamp", 0.0, 0.5),
        Span(2, "act_b", "b", "obj_belt", 4.5, 0.25, "true"),
        Span(3, "act_c", "c", "obj_lamp", 4.75, 0.5, error="It jams."),
    ]
    assert found.devices == [TracedDevice("obj_lamp", "lamp", 1.0), TracedDevice("obj_belt", "belt", 0.25)]
    assert (found.run, found.started) == (3, "1970-01-01T00:16:40.000000+00:00")


def test_a_span_after_an_error_exit_names_no_branch() -> None:
    trace = RunTraceCollector(3)
    trace.describe(INFO)
    begin(trace, 1, "act_a", "obj_lamp", 1000.0)
    trace.ended(1, 0.5, 0.0, "It jams.")
    begin(trace, 2, "act_b", "obj_belt", 1000.5)
    trace.ended(2, 0.25, 0.0)
    assert trace.trace().spans[1] == Span(2, "act_b", "b", "obj_belt", 0.5, 0.25)


def test_the_oldest_actions_of_a_long_run_are_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_trace, "MAX_SPANS", 2)
    trace = RunTraceCollector(1)
    for number in (1, 2, 3):
        begin(trace, number, "act_a", "obj_lamp", 1000.0 + number)
        trace.ended(number, 0.5, 0.0)
    found = trace.trace()
    assert ([span.start for span in found.spans], found.omitted) == ([1.0, 2.0], 1)


def test_a_chrome_trace_has_a_row_for_each_device_and_overlap() -> None:
    spans = [
        Span(1, "act_a", "a", "obj_lamp", 0.0, 1.0),
        Span(2, "act_b", "b", "obj_lamp", 0.5, 1.0, "true", thread_id=5),
        Span(3, "act_c", "c", "obj_belt", 1.0, 0.25, error="It jams."),
        Span(4, "act_d", "d", "obj_lamp", 1.0, 0.25),
    ]
    devices = [TracedDevice("obj_lamp", "lamp", 2.25), TracedDevice("obj_belt", "belt", 0.25)]
    made = json.loads(json.dumps(chrome_trace("run 1", devices, spans)))
    names = {event["tid"]: event["args"]["name"] for event in made["traceEvents"] if event["ph"] == "M"}
    assert names == {0: "run 1", 1: "lamp", 2: "lamp (2)", 3: "belt"}
    shown = [(event["name"], event["tid"], event["ts"], event["dur"]) for event in made["traceEvents"][4:]]
    second = 1_000_000
    assert shown == [
        ("a", 1, 0, second),
        ("b", 2, second // 2, second),
        ("c", 3, second, 250_000),
        ("d", 1, second, 250_000),
    ]
    assert made["traceEvents"][5]["args"] == {"number": 2, "action_id": "act_b", "branch": "true"}


def test_a_chrome_trace_has_a_lane_for_each_branch() -> None:
    spans = [
        Span(1, "act_both", "both", "", 0.0, 2.0),
        Span(2, "act_a", "call a", "", 0.0, 2.0, call=1, lane="act_a"),
        Span(3, "act_b", "call b", "", 0.0, 1.0, call=1, lane="act_b"),
        Span(4, "act_a1", "a1", "arm", 0.0, 2.0, call=2, lane="act_a"),
        Span(5, "act_b1", "b1", "press", 0.0, 1.0, call=3, lane="act_b"),
    ]
    made = chrome_trace("run 1", [TracedDevice("arm", "arm", 2.0), TracedDevice("press", "press", 1.0)], spans)
    events = made["traceEvents"]
    titles = {(e["pid"], e["tid"]): e["args"]["name"] for e in events if e["name"] == "thread_name"}
    lanes = {title: tid for (pid, tid), title in titles.items() if pid == 2}
    assert list(lanes) == ["program", "call a", "call b"]
    shown = {(e["tid"], e["name"]) for e in events if e["ph"] == "X" and e["pid"] == 2}
    assert shown == {
        (lanes["program"], "both"),
        (lanes["call a"], "call a"),
        (lanes["call a"], "a1"),
        (lanes["call b"], "call b"),
        (lanes["call b"], "b1"),
    }
    assert {e["name"] for e in events if e["ph"] == "X" and e["pid"] == 1} == {span.name for span in spans}
