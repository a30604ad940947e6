"""Statistics of a run: cycles and their durations, verdicts and counters."""

import msgspec

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.editor import CounterValue, RunStatistics, VariableValue
from arcor2_hw.data.events import ActionStateAfterData, ActionStateBeforeData, Event, PackageInfoData
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import Action, ActionPoint, Flow, LogicItem, Project, ProjectParameter
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_server.execution.run_statistics import RunStatisticsCollector

METHODS = {
    "first": "obj_flow/repeat",
    "test": "obj_tester/test",
    "count": "obj_boards/increment",
    "set": "obj_boards/set_value",
    "reset": "obj_boards/reset",
    "below": "obj_boards/below",
}


class Run:
    """A run whose clock and events are controlled by the test."""

    def __init__(self, *, logic: bool = True, verdicts: bool = True) -> None:
        objects = [
            SceneObject("flow", "FlowActions", id="obj_flow"),
            SceneObject("tester", "Tester", id="obj_tester"),
            SceneObject("boards", "CounterActions", id="obj_boards", parameters=[Parameter("start", "integer", "7")]),
        ]
        scene = Scene("cell", id="scn_1", objects=objects)
        actions = [Action(name, kind, name) for name, kind in METHODS.items()]
        project = Project(
            "project",
            "scn_1",
            id="pro_1",
            action_points=[ActionPoint("p", Position(), id="acp_1", actions=actions)],
            logic=[LogicItem("START", "first"), LogicItem("first", "test"), LogicItem("test", "END")] if logic else [],
        )
        self.now = 100.0
        info = PackageInfoData("pkg_1", "package", scene, project)
        self.collector = RunStatisticsCollector(info, {"test"} if verdicts else set(), lambda: self.now)

    def start(self, action: str, *parameters: str, thread: int | None = None, attempt: int = 1) -> bool:
        data = ActionStateBeforeData(action, [*parameters] or UNSET, thread_id=UNSET if thread is None else thread)
        return self.collector.handle_start(msgspec.json.encode(Event("ActionStateBefore", data=data)), attempt)

    def end(self, action: str, *results: str) -> bool:
        data = ActionStateAfterData(action, [*results] or UNSET)
        return self.collector.handle_result(msgspec.json.encode(Event("ActionStateAfter", data=data)))

    @property
    def statistics(self) -> RunStatistics:
        return self.collector.statistics()


def test_a_cycle_lasts_from_the_first_action_to_the_next_start_of_it() -> None:
    run = Run()
    assert not run.start("first")
    run.now += 1.0
    assert not run.start("test")
    assert run.statistics == RunStatistics(0, good=0, bad=0)
    run.now += 3.0
    assert run.start("first")
    assert (run.statistics.cycles, run.statistics.last_cycle, run.statistics.mean_cycle) == (1, 4.0, 4.0)
    assert not run.start("first", thread=5), "an action of another thread starts no cycle"
    assert not run.start("first", attempt=2), "a repeated action starts no cycle"
    run.now += 2.0
    run.start("first")
    assert (run.statistics.cycles, run.statistics.last_cycle, run.statistics.mean_cycle) == (2, 2.0, 3.0)


def test_a_cycle_with_a_pause_counts_without_its_duration() -> None:
    run = Run()
    run.start("first")
    run.collector.handle_paused()
    run.now += 60.0
    run.start("first")
    assert (run.statistics.cycles, run.statistics.last_cycle) == (1, UNSET)
    run.now += 5.0
    run.start("first")
    assert (run.statistics.cycles, run.statistics.last_cycle, run.statistics.mean_cycle) == (2, 5.0, 5.0)


def test_a_run_that_finishes_in_its_first_cycle_is_one_cycle() -> None:
    run = Run()
    run.collector.handle_finished()
    assert run.statistics.cycles == 0, "nothing was started"
    run.start("first")
    run.now += 8.0
    run.collector.handle_finished()
    assert (run.statistics.cycles, run.statistics.last_cycle) == (1, 8.0)
    run.collector.handle_finished()
    assert run.statistics.cycles == 1


def test_a_script_without_logic_repeats_its_first_action() -> None:
    run = Run(logic=False)
    run.start("test")
    run.start("first")
    run.now += 1.5
    assert run.start("test")
    assert (run.statistics.cycles, run.statistics.last_cycle) == (1, 1.5)


def test_verdicts_are_counted() -> None:
    run = Run()
    assert [run.end("test", each) for each in ("true", "false", "true")] == [True] * 3
    assert not run.end("test"), "it returned nothing"
    assert not run.end("first", "true"), "no verdict"
    assert (run.statistics.good, run.statistics.bad) == (2, 1)
    other = Run(verdicts=False)
    other.end("test", "true")
    assert (other.statistics.good, other.statistics.bad) == (UNSET, UNSET)


def test_counters_are_followed() -> None:
    run = Run()
    run.start("below", "3")
    assert not run.end("below", "false")
    assert run.statistics.counters == []

    def value() -> list[CounterValue]:
        return run.statistics.counters

    run.start("count", "1")
    assert run.end("count", "8")
    assert value() == [CounterValue("obj_boards", "boards", 8)]
    run.start("below", "3")
    assert not run.end("below", "false")
    run.start("set", "42")
    assert run.end("set")
    assert value()[0].value == 42
    run.start("reset")
    assert run.end("reset")
    assert value()[0].value == 7


def test_variables_have_their_start_values_until_actions_store_results_in_them() -> None:
    parameters = [
        ProjectParameter("last", "string", '""', id="pco_1", variable=True),
        ProjectParameter("limit", "integer", "3", id="pco_2"),
    ]
    flows = [Flow(outputs=["last"])]
    actions = [Action("scan", "obj_reader/scan", "scan", flows=flows), Action("other", "obj_reader/scan", "other")]
    point = ActionPoint("p", Position(), id="acp_1", actions=actions)
    project = Project("project", "scn_1", id="pro_1", action_points=[point], parameters=parameters)
    run = Run()
    run.collector = RunStatisticsCollector(PackageInfoData("p", "p", Scene("cell", id="scn_1"), project), set())
    assert run.statistics.variables == [VariableValue("pco_1", "last", '""')]
    assert not run.end("other", '"x"')
    assert run.end("scan", '"A1"')
    assert not run.end("scan", '"A1"')
    assert run.statistics.variables == [VariableValue("pco_1", "last", '"A1"')]
    assert Run().statistics.variables is UNSET
