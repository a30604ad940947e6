"""The walk through the logic of a program: branches, loops, and the branches that a run took."""

from arcor2_hw.compute.program_walk import END_STEP, OUTSIDE, Edge, Graph, Step, UsualBranch, usual_branches, walk


def graph(edges: dict[str, list[str]], **more: object) -> Graph:
    """Build a graph from the ids of the actions that follow each action; conditions are the numbers of the edges."""
    numbers = {name: number for number, name in enumerate(edges)} | {"END": END_STEP}
    steps = [
        Step(name, name.upper(), "dev", [Edge(numbers[each], str(n)) for n, each in enumerate(following)])
        for name, following in edges.items()
    ]
    return Graph(steps, **more)  # type: ignore[arg-type]


def names(program: Graph, first: int = 0) -> str:
    return " ".join(program.steps[visit.step].action_id for visit in walk(program, first).visits)


BRANCHED = {"a": ["b", "c"], "b": ["d"], "c": ["d"], "d": ["END"]}


def test_without_runs_the_first_branch_is_taken_and_named() -> None:
    walked = walk(graph(BRANCHED))
    assert [(visit.step, visit.branch) for visit in walked.visits][:2] == [(0, walked.visits[0].branch), (1, "0")]
    assert names(graph(BRANCHED)) == "a b d"
    (assumption,) = walked.assumptions
    assert assumption.action_id == "a"
    assert assumption.text == "After A, the first branch leads to B, because no run shows which one is usual."
    assert assumption.values == {"name": "A", "next": "B"}


def test_the_branch_of_the_newest_run_is_taken_unless_the_client_asks_for_another() -> None:
    usual = {"a": UsualBranch(7, "c")}
    program = graph(BRANCHED, usual=usual)
    assert names(program) == "a c d"
    assert walk(program).assumptions[0].text == "After A, the branch leads to C, as most often in run 7."
    requested = graph(BRANCHED, usual=usual, wanted={"a": "b"})
    assert names(requested) == "a b d"
    assert walk(requested).assumptions[0].text == "After A, the requested branch leads to B."
    # A run of an older version took a branch that no longer exists.
    assert names(graph(BRANCHED, usual={"a": UsualBranch(7, "gone")})) == "a b d"


def test_a_loop_ends_after_one_cycle_and_a_walk_may_start_anywhere() -> None:
    looping = graph({"a": ["b"], "b": ["c"], "c": ["a"]})
    assert names(looping) == "a b c"
    assert walk(looping).assumptions[0].text == "The loop back to A ends after one cycle."
    assert names(looping, 1) == "b c a"
    assert names(graph(BRANCHED), 2) == "c d"


def test_the_usual_branch_is_the_most_frequent_one() -> None:
    edges = {"a": ["b", "END"], "b": ["a", "c"], "c": ["END"]}
    # Four cycles; the third one ended after a, and the next started with a again.
    found = usual_branches(3, [*"ab", "c", *"ab", "c", "a", *"ab"], edges)
    assert found == {"a": UsualBranch(3, "b"), "b": UsualBranch(3, "c"), "c": UsualBranch(3, "END")}


def test_branches_of_parallel_work_and_functions_are_walked() -> None:
    end = [Edge(END_STEP)]
    program = Graph(
        [
            Step("both", "Both", "", end, branches=[1, 2]),
            Step("call a", "Call a", "", end, function="a"),
            Step("call b", "Call b", "", end, function="b"),
            Step("a1", "A1", "arm", [Edge(4)]),
            Step("a2", "A2", "arm", end),
            Step("b1", "B1", "press", end, function="b"),  # damaged data: it calls itself
        ],
        functions={"a": 3, "b": 5},
    )
    visits = walk(program).visits
    assert [program.steps[visit.step].action_id for visit in visits] == ["both", "call a", "a1", "a2", "call b", "b1"]
    assert [visit.call for visit in visits] == [OUTSIDE, 0, 1, 1, 0, 4]
    assert [visit.lane for visit in visits] == ["", "call a", "call a", "call a", "call b", "call b"]
