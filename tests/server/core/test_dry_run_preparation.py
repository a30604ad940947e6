"""The dry run of a program whose branches depend on comparisons and variables, and whose actions are retried."""

from arcor2_hw.compute.program_walk import walk
from arcor2_hw.data.project import END, START, LogicComparison, LogicWhen, Match, Operator, Retry
from arcor2_hw.data.rpc import StartDryRunArgs
from arcor2_hw.data.run_trace import RunTrace, Span
from arcor2_server.dry_run.preparation import Device, Experience, prepare
from tests.server.build.projects import DECLARED, OBJECT, SCENE, Draft

DEVICES = {OBJECT: Device("thing", "Thing", DECLARED)}


def draft() -> Draft:
    """Return a program that measures, stores whether the value suffices, and continues by the values of both."""
    made = Draft(methods={"measure": "measure"}, variables={"enabled"})
    made.action("measure", "length").action("ask", "enabled")
    made.chain(START, "measure", "ask").edge("ask", "sort").edge("ask", "drop").edge("ask", END)
    made.chain("sort", END).chain("drop", END)
    made.retries["measure"] = Retry(3, 0.5)
    length = LogicComparison("id_measure/default/0", Operator.RIGHT_OPEN, "1.5", "3")
    made.whens = {
        2: LogicWhen([length, LogicComparison("pco_b", Operator.EQUAL, "true")]),
        3: LogicWhen([length, LogicComparison("pco_n", Operator.GREATER, "4")], Match.ANY),
    }
    return made


def planned(*runs: RunTrace, **asked: str) -> tuple[list[str], list[str]]:
    """Return the names of the executed actions and the texts of the assumptions."""
    args = StartDryRunArgs(branches=asked) if asked else StartDryRunArgs()
    graph = prepare(SCENE, draft().project(), DEVICES, Experience(runs, runs, {}), args).graph
    walked = walk(graph)
    return [graph.steps[each.step].name for each in walked.visits], [each.text for each in walked.assumptions]


def run(*executed: str) -> RunTrace:
    """Return the trace of a run; an action after itself is its repetition."""
    spans: list[Span] = []
    for number, name in enumerate(executed):
        again = {"attempt": 2} if spans and spans[-1].name == name else {}
        spans.append(Span(number, f"id_{name}", name, "thing", float(number), 1.0, **again))
    return RunTrace(7, spans=spans)


def test_a_branch_by_comparisons_is_an_assumption() -> None:
    text = "After ask, the first branch leads to sort, because no run shows which one is usual."
    assert planned() == (["measure", "ask", "sort"], [text])
    assert planned(id_ask="id_drop")[0] == ["measure", "ask", "drop"]
    assert planned(id_ask="END")[0] == ["measure", "ask"]


def test_a_branch_by_comparisons_is_that_of_the_newest_run() -> None:
    names, assumptions = planned(run("measure", "ask", "drop", "measure", "ask", "sort", "measure", "ask", "drop"))
    assert names == ["measure", "ask", "drop"]
    assert assumptions == ["After ask, the branch leads to drop, as most often in run 7."]
    names, _ = planned(run("measure", "ask", "measure", "measure", "ask", "sort", "measure", "ask", "measure"))
    assert names == ["measure", "ask"]  # two steps to END, also before a repeated first action
