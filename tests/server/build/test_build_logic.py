"""Programs do what their logic defines: random graphs run directly and as programs, typical shapes as text."""

import json
import random
import sys
from types import FrameType
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.data.project import END, START, LogicComparison, LogicWhen, Match, Operator, Retry
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build.frame import TypeFacts
from arcor2_server.build.layout import MAX_NESTING, Tree
from arcor2_server.build.script import from_logic
from tests.server.build.projects import (
    DECLARED,
    SCENE,
    TYPES,
    Draft,
    random_draft,
    random_oracle,
    run,
    same_runs,
    with_choices,
    with_exits,
)


@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.integers(0, 2**32),
    st.integers(1, 30),
    st.sampled_from([0.0, 0.2, 0.5, 0.9]),
    st.sampled_from([0.0, 0.1, 0.3]),
    st.sampled_from([1, 2, 3, 20]),
    st.booleans(),
    st.booleans(),
)
def test_a_program_does_what_its_logic_defines(
    seed: int, size: int, merging: float, end_rate: float, window: int, choices: bool, exits: bool
) -> None:
    draft = random_draft(random.Random(seed), size, merging, end_rate, window)
    if choices:
        draft = with_choices(draft, random.Random(seed))
    if exits:
        draft = with_exits(draft, random.Random(seed))
    for draw in range(4):
        same_runs(draft, random_oracle(seed + draw), 4 * size)


def test_programs_of_large_graphs_do_what_their_logic_defines() -> None:
    rng = random.Random(7)
    for size in (200, 400):
        for merging, window in ((0.3, 5), (0.6, 50), (0.05, 3)):
            draft = random_draft(rng, size, merging, 0.05, window)
            same_runs(draft, random_oracle(rng.randrange(1000)), 3 * size)


# ------------------------------------------------------------------------------------------------ shapes
def loop(source: str) -> str:
    """Return the unindented body of the main loop."""
    lines = source.splitlines()
    start = lines.index("    while True:") + 1
    body = lines[start : lines.index('if __name__ == "__main__":')]
    return "\n".join(line[8:] for line in body).strip()


def test_a_diamond_joins_behind_the_branch() -> None:
    draft = Draft().edge(START, "a").branch("a", "b", "c").chain("b", "d").chain("c", "d").chain("d", END)
    assert (
        loop(draft.script())
        == """\
r_a = thing.ask(an="a")
if r_a == True:
    thing.do(an="b")
else:
    thing.do(an="c")

thing.do(an="d")"""
    )


def test_branches_that_both_end_become_if_and_else() -> None:
    draft = Draft().edge(START, "a").branch("a", "b", "c").chain("b", END).chain("c", END)
    assert (
        loop(draft.script())
        == """\
r_a = thing.ask(an="a")
if r_a == True:
    thing.do(an="b")
else:
    thing.do(an="c")"""
    )


def test_an_early_end_is_written_without_else() -> None:
    draft = Draft().edge(START, "a").branch("a", "b", "c").chain("b", END).branch("c", "d", END).chain("d", END)
    assert (
        loop(draft.script())
        == """\
r_a = thing.ask(an="a")
if r_a == True:
    thing.do(an="b")
    continue

r_c = thing.ask(an="c")
if r_c == True:
    thing.do(an="d")"""
    )


def test_an_empty_branch_is_omitted() -> None:
    draft = Draft().edge(START, "a").branch("a", "d", "c").chain("c", "d").chain("d", END)
    assert (
        loop(draft.script())
        == """\
r_a = thing.ask(an="a")
if r_a == False:
    thing.do(an="c")

thing.do(an="d")"""
    )


def test_more_than_two_branches_become_elif() -> None:
    draft = Draft().action("a", "x", "y").chain(START, "a").chain("b", "e").chain("c", "e").chain("d", "e", END)
    draft.edge("a", "b", ("a", "x", True)).edge("a", "c", ("a", "y", True)).edge("a", "d", ("a", "y", False))
    assert (
        loop(draft.script())
        == """\
x, y = thing.ask2(an="a")
if x == True:
    thing.do(an="b")
elif y == True:
    thing.do(an="c")
else:
    thing.do(an="d")

thing.do(an="e")"""
    )


def test_a_join_that_can_be_bypassed_is_written_once() -> None:
    draft = (
        Draft().edge(START, "a").branch("a", "b", "c").branch("b", "d", "e").chain("c", "e", "f", END).chain("d", "f")
    )
    source = draft.script()
    assert (
        loop(source)
        == """\
r_a = thing.ask(an="a")
if r_a == True:
    r_b = thing.ask(an="b")
    if r_b == True:
        thing.do(an="d")
        next_action = "f"
    else:
        next_action = "e"
else:
    thing.do(an="c")
    next_action = "e"

if next_action == "e":
    thing.do(an="e")

thing.do(an="f")"""
    )
    for seed in range(8):
        same_runs(draft, random_oracle(seed), 12)


def nested(depth: int) -> Draft:
    """Return nested branches that all join again, one level after the other."""
    draft = Draft().edge(START, "a0")
    for n in range(depth):
        draft.branch(f"a{n}", f"a{n + 1}" if n < depth - 1 else "deepest", f"b{n}")
        draft.chain(f"b{n}", f"j{n}").chain(f"j{n}", f"j{n - 1}" if n else END)
    return draft.chain("deepest", f"j{depth - 1}")


@pytest.mark.parametrize("depth", [MAX_NESTING, MAX_NESTING + 1, 3 * MAX_NESTING, 400])
def test_deeply_nested_branches_become_functions(depth: int) -> None:
    draft = nested(depth)
    deepest = max(len(line) - len(line.lstrip()) for line in draft.script().splitlines()) // 4
    assert deepest <= MAX_NESTING + 4
    for seed in range(3):
        same_runs(draft, random_oracle(seed), 60)
    # The path to the innermost branch, which random values hardly ever take.
    same_runs(draft, lambda *_: (True, True), 3 * depth)


def diamonds(count: int) -> Draft:
    draft = Draft().edge(START, "a0")
    for n in range(count):
        draft.branch(f"a{n}", f"y{n}", f"n{n}")
        after = f"a{n + 1}" if n < count - 1 else END
        draft.chain(f"y{n}", after).chain(f"n{n}", after)
    return draft


def exits(count: int) -> Draft:
    """Return a long chain in which each action may also lead directly to the last one."""
    draft = Draft().edge(START, "a0")
    for n in range(count - 1):
        draft.branch(f"a{n}", f"a{n + 1}", "last")
    return draft.chain(f"a{count - 1}", "last", END)


def chain(count: int) -> Draft:
    return Draft().chain(START, *[f"a{n}" for n in range(count)], END)


def ladder(count: int) -> Draft:
    """Return two parallel chains with crossings at every action: completely unstructured logic."""
    draft = Draft().edge(START, "l0")
    for n in range(count):
        last = n == count - 1
        draft.branch(f"l{n}", END if last else f"l{n + 1}", f"r{n}")
        draft.branch(f"r{n}", END, END if last else f"l{n + 1}") if n % 2 else draft.chain(
            f"r{n}", END if last else f"r{n + 1}"
        )
    return draft


@pytest.mark.parametrize(
    ("make", "count"), [(diamonds, 18), (diamonds, 300), (exits, 300), (ladder, 200), (chain, 1000)]
)
def test_a_long_chain_is_built(make: Any, count: int) -> None:
    draft = make(count)
    for seed in range(3):
        same_runs(draft, random_oracle(seed), 1000)
    same_runs(draft, lambda *_: (True, True), 1000)
    same_runs(draft, lambda *_: (False, False), 1000)


def _steps(draft: Draft) -> int:
    """Count the lines of our code that a build executes: a measure that does not depend on other load."""
    project = draft.project()
    count = 0

    def trace(frame: FrameType, event: str, _: object) -> Any:
        nonlocal count
        if "arcor2_server" not in frame.f_code.co_filename:
            return None
        count += event == "line"
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        from_logic(SCENE, project, TYPES)
    finally:
        sys.settrace(before)
    return count


@pytest.mark.parametrize("make", [chain, diamonds, exits, ladder, nested])
def test_build_time_grows_linearly(make: Any) -> None:
    small, large = _steps(make(60)), _steps(make(480))
    assert large / small < 8 * 1.35, f"eight times the actions take {large / small:.1f} times the steps"


def test_the_tree_finds_the_nearest_common_ancestor() -> None:
    rng = random.Random(1)
    tree = Tree()
    ancestors: list[list[int]] = []
    for n in range(400):
        parent = rng.randrange(max(n - 3, 0), n) if n else 0
        tree.add(parent)
        ancestors.append([*ancestors[parent], n] if n else [0])
    for _ in range(2000):
        a, b = rng.randrange(400), rng.randrange(400)
        assert tree.common(a, b) == max(set(ancestors[a]) & set(ancestors[b]), key=lambda x: tree.depths[x])


# ------------------------------------------------------------------------------------------------ refusals
def _no_condition() -> Draft:
    return Draft().action("a", "x").chain(START, "a").chain("a", "b", END).edge("a", END, ("a", "x", True))


def _never_taken() -> Draft:
    draft = Draft().action("a", "x", "y").chain(START, "a").chain("b", END).chain("c", END).chain("d", END)
    return draft.edge("a", "b", ("a", "x", True)).edge("a", "c", ("a", "x", False)).edge("a", "d", ("a", "y", True))


def _linked_from_a_branch() -> Draft:
    draft = (
        Draft().edge(START, "a").branch("a", "b", "c").action("b", "x").chain("b", "d").chain("c", "d").chain("d", END)
    )
    draft.links["d"] = ("b", 0)
    return draft


def _linked_to_itself() -> Draft:
    draft = Draft().chain(START, "a", END)
    draft.links["a"] = ("a", 0)
    return draft


@pytest.mark.parametrize(
    ("draft", "text"),
    [
        (Draft().chain("a", END), "START"),
        (Draft().chain(START, "a", END).chain(START, "b", END), "more than one first action"),
        (Draft().edge(START, END), "without an action"),
        (Draft().chain(START, "first", "second"), "'second': no action follows"),
        (Draft().chain(START, "a", "b", "c", "b"), "'b': the logic forms a loop"),
        (Draft().action("a", "x").chain(START, "a").edge("a", "b", ("a", "x", True)).chain("b", END), "x is false"),
        (_no_condition(), "'a': one of its connections has no condition"),
        (_never_taken(), "'a': the connection to 'd' is never taken"),
        (_linked_from_a_branch(), "'d' uses a result of 'b', which does not run before it on all paths"),
        (_linked_to_itself(), "'a' uses a result of 'a'"),
    ],
)
def test_the_refusal_of_invalid_logic_names_the_action(draft: Draft, text: str) -> None:
    with pytest.raises(InvalidProject) as caught:
        draft.script()
    assert text in str(caught.value)


def test_unreachable_actions_are_omitted() -> None:
    draft = Draft().chain(START, "a", END).chain("lost", "also lost")
    assert "lost" not in draft.script()
    assert run(draft.script(), random_oracle(0), 2) == [("a", ()), ("a", ())]


# ------------------------------------------------------------------------------------------------ numbers and texts
def choosing(*values: int | str | None) -> Draft:
    """Return a project whose first action leads to b0, b1 ... by the values of its result, all merging in z."""
    method = "count" if isinstance(values[0], int) else "sort"
    draft = Draft(methods={"a": method}).action("a", "r").edge(START, "a")
    for number, value in enumerate(values):
        draft.action(f"b{number}").edge("a", f"b{number}", None if value is None else ("a", "r", value))
        draft.chain(f"b{number}", "z")
    return draft.chain("z", END)


def test_a_choice_between_numbers_becomes_if_elif_else() -> None:
    draft = choosing(0, None, 2)
    assert (
        loop(draft.script())
        == """\
r = thing.count(an="a")
if r == 0:
    thing.do(an="b0")
elif r == 2:
    thing.do(an="b2")
else:
    thing.do(an="b1")

thing.do(an="z")"""
    )
    same_runs(draft, random_oracle(1), 60)


def test_a_choice_between_texts_compares_strings() -> None:
    draft = choosing("low", "high", None)
    assert 'if r == "low":' in draft.script()
    same_runs(draft, random_oracle(2), 60)


def test_a_default_branch_to_the_end_is_omitted() -> None:
    draft = Draft(methods={"a": "count"}).action("a", "r").edge(START, "a").action("b")
    draft.edge("a", "b", ("a", "r", 1)).edge("a", END).edge("b", END)
    assert loop(draft.script()).splitlines()[1:] == ["if r == 1:", '    thing.do(an="b")']
    same_runs(draft, random_oracle(3), 40)


def test_a_default_branch_inverts_the_only_condition() -> None:
    draft = Draft(methods={"a": "count"}).action("a", "r").edge(START, "a").action("b").chain("b", "z", END)
    draft.edge("a", "z", ("a", "r", 1)).edge("a", "b")
    assert loop(draft.script()).splitlines()[1:3] == ["if r != 1:", '    thing.do(an="b")']
    same_runs(draft, random_oracle(4), 40)


@pytest.mark.parametrize(
    ("draft", "text"),
    [
        (choosing(0, 1), "no action follows it when no condition holds"),
        (choosing(0, None, None), "one of its connections has no condition"),
        (choosing(0, 0, None), "is never taken"),
        (choosing(0, "low", None), "can compare it with integers, not with 'low'"),
        (choosing(0, True, None), "one of its connections has no condition"),
        (choosing("low", 1, None), "can compare it with strings, not with 1"),
        (choosing(0, 1.5, None), "compares with true, false, an integer or a text"),  # type: ignore[arg-type]
    ],
)
def test_invalid_choices_are_refused(draft: Draft, text: str) -> None:
    with pytest.raises(InvalidProject) as caught:
        draft.script()
    assert "'a'" in str(caught.value)
    assert text in str(caught.value)


def test_a_boolean_has_no_default_branch() -> None:
    draft = Draft().action("a", "r").edge(START, "a").action("b").edge("a", "b", ("a", "r", True)).edge("a", END)
    with pytest.raises(InvalidProject, match="one of its connections has no condition"):
        draft.chain("b", END).script()


def test_branching_requires_a_supported_result_type() -> None:
    draft = choosing("low", None)
    project = draft.project()
    types = {
        "Thing": TypeFacts(
            "object_types.thing", "Thing", {**DECLARED, "sort": ObjectAction("sort", returns=["double"])}
        )
    }
    with pytest.raises(InvalidProject, match="r is double, which a condition cannot use"):
        from_logic(SCENE, project, types)


# ------------------------------------------------------------------------------------------------ comparisons
N, X, P, LIMIT = "id_a/default/0", "id_x/default/0", "id_p/default/0", "pco_n"


def compared(what: str, operator: str, value: object, upper: object = UNSET) -> LogicComparison:
    limit = UNSET if upper is UNSET else json.dumps(upper)
    return LogicComparison(what, Operator(operator), json.dumps(value), limit)


def comparing(*conditions: list[LogicComparison] | None, match: Match = Match.ALL) -> Draft:
    """Return a project whose action a leads to b0, b1 ... by comparisons of the results of x, p and a, merging in z."""
    draft = Draft(methods={"a": "count", "x": "measure", "p": "ask"})
    draft.action("x", "x").action("p", "passed").action("a", "n").chain(START, "x", "p", "a")
    for number, comparisons in enumerate(conditions):
        draft.action(f"b{number}").edge("a", f"b{number}")
        if comparisons is not None:
            draft.whens[len(draft.edges) - 1] = LogicWhen(comparisons, match)
        draft.chain(f"b{number}", "z")
    return draft.chain("z", END)


def test_comparisons_become_conditions() -> None:
    draft = comparing(
        [compared(N, "[)", 3, 7), compared(P, "==", True)],
        [compared(X, "<", -0.5)],
        [compared(LIMIT, "!=", 2), compared(P, "==", False)],
        None,
    )
    assert loop(draft.script()).splitlines()[3:11] == [
        "if 3 <= n < 7 and passed:",
        '    thing.do(an="b0")',
        "elif x < -0.5:",
        '    thing.do(an="b1")',
        "elif limit != 2 and not passed:",
        '    thing.do(an="b2")',
        "else:",
        '    thing.do(an="b3")',
    ]
    same_runs(draft, random_oracle(1), 60)


def pair(what: str, operator: str, other: str) -> LogicComparison:
    return LogicComparison(what, Operator(operator), other=other)


def test_two_values_are_compared() -> None:
    draft = comparing([pair(N, ">=", LIMIT)], [pair(X, "<", N), compared(P, "==", True)], None)
    assert loop(draft.script()).splitlines()[3:7] == [
        "if n >= limit:",
        '    thing.do(an="b0")',
        "elif x < n and passed:",
        '    thing.do(an="b1")',
    ]
    same_runs(draft, random_oracle(4), 60)
    comparing([pair(N, "<", LIMIT)], [pair(LIMIT, "<=", N)]).script()
    # Two values may be in any order, between constants or outside of them.
    high = [compared(N, ">", 5), compared(LIMIT, ">", 5)]
    for operator in ("<", "==", ">"):
        comparing([*high, pair(N, operator, LIMIT)], None).script()


def test_many_comparisons_are_written_one_per_line() -> None:
    ranges = [compared(N, "[]", first, first + 3) for first in range(100000, 100100, 10)]
    lines = loop(comparing(ranges, None, match=Match.ANY).script()).splitlines()
    assert lines[3:6] == ["if (", "    100000 <= n <= 100003", "    or 100010 <= n <= 100013"]
    assert lines[14] == "):"


def test_complete_comparisons_need_no_default_branch() -> None:
    draft = comparing([compared(N, "<=", 0)], [compared(N, "==", 1)], [compared(N, ">=", 2)])
    assert "else:" in draft.script()
    same_runs(draft, random_oracle(2), 60)
    passed, failed = [compared(P, "==", True)], [compared(P, "==", False), compared(LIMIT, ">", 0)]
    comparing(passed, failed, [compared(LIMIT, "<", 1)]).script()
    # Overlapping conditions apply in their order, also when the first one leads to the next action of the program.
    overlapping = Draft(methods={"a": "count"}).action("a", "n").chain(START, "a").action("b").action("z")
    overlapping.edge("a", "z").edge("a", "b").chain("b", "z", END)
    overlapping.whens = {1: LogicWhen([compared(N, "<", 2)]), 2: LogicWhen([compared(N, ">=", 1)])}
    assert "if not n < 2:" in overlapping.script()
    same_runs(overlapping, random_oracle(3), 60)


@pytest.mark.parametrize(
    ("draft", "text"),
    [
        (comparing([compared(N, "<", 3)], [compared(N, ">", 3)]), "no action follows it when n = 3"),
        (comparing([compared(X, "<=", 3)], [compared(X, ">=", 4)]), "no action follows it when x = 3.5"),
        (comparing([compared(N, "<", 3), compared(P, "==", True)], [compared(N, ">=", 3)]), "n = 2, passed = false"),
        (comparing([compared(N, "<", 3)], [compared(N, "<", 2)], None), "the connection to 'b1' is never taken"),
        (comparing([compared(N, "<", 3)], [compared(N, ">=", 3)], None), "the connection to 'b2' is never taken"),
        (comparing([compared(N, "[)", 3, 3)], None), "the range of n from 3 to 3 is empty"),
        (comparing([compared(N, "()", 3, 4)], None), "the range of n from 3 to 4 is empty"),
        (comparing([compared(N, "<", 0.5)], None), "n is integer and cannot be compared with 0.5"),
        (comparing([compared(N, "<", True)], None), "n is integer and cannot be compared with True"),
        (comparing([compared(X, "==", 0.5)], None), "x is a measured number"),
        (comparing([compared(P, "<", True)], None), "passed is boolean, which cannot be compared by <"),
        (comparing([compared(N, "[]", 3)], None), "A range has two limits"),
        (comparing([pair(N, "<", LIMIT)], [pair(N, ">", LIMIT)]), "no action follows it when n = 0, limit = 0"),
        (comparing([pair(X, "<", LIMIT)], [pair(X, ">=", LIMIT)], None), "the connection to 'b2' is never taken"),
        (comparing([pair(N, "<", P)], None), "n is integer and cannot be compared with passed, which is boolean"),
        (comparing([pair(X, "==", LIMIT)], None), "x is a measured number"),
        (comparing([pair(N, "[]", LIMIT)], None), "A comparison with another value has no constants"),
        (comparing([pair(N, "<", "pco_none")], None), "a condition refers to 'pco_none', which does not exist"),
        (comparing([compared(N, "<", [3])], None), "A comparison has an invalid value: [3]."),
        (comparing([compared("id_b0/default/0", "<", 3)], None), "refers to a result that 'b0' does not name"),
        (comparing([compared("pco_none", "<", 3)], None), "a condition refers to 'pco_none', which does not exist"),
        (comparing([compared("id_a/error/0", "<", 3)], None), "a condition cannot be read"),
        (comparing([compared(N, "==", n) for n in range(2001)], [compared(N, "<", 5)]), "too many to prove"),
    ],
)
def test_invalid_comparisons_are_refused(draft: Draft, text: str) -> None:
    with pytest.raises(InvalidProject) as caught:
        draft.script()
    assert str(caught.value).startswith("action 'a': ")
    assert text in str(caught.value)


def test_a_compared_result_is_set_on_all_paths() -> None:
    draft = Draft(methods={"c": "count"}).action("a", "r").chain(START, "a").branch("a", "c", "d")
    draft.action("c", "n").chain("c", "d").action("d").edge("d", "e").edge("d", END).chain("e", END)
    draft.whens = {len(draft.edges) - 3: LogicWhen([compared("id_c/default/0", "<", 3)])}
    with pytest.raises(InvalidProject, match="'d' uses a result of 'c', which does not run before it on all paths"):
        draft.script()


# ------------------------------------------------------------------------------------------------ retries
def test_a_retry_is_part_of_the_call() -> None:
    draft = Draft(methods={"a": "measure", "b": "measure"}).action("a", "x").action("b").chain(START, "a", "b", END)
    draft.retries = {"a": Retry(3, 0.5), "b": Retry(1)}
    assert loop(draft.script()).splitlines() == [
        'x = res.retry(thing, 3, pause=0.5).measure(an="a")',
        'res.retry(thing, 1).measure(an="b")',
    ]


@pytest.mark.parametrize(
    ("method", "retry", "text"),
    [
        ("count", Retry(1), "'a': a: count cannot be retried, because repeating it may do harm"),
        ("measure", Retry(101), "'a': a: a retry has a count from 1 to 100 and a pause of 0 to 3600 s"),
        ("measure", Retry(1, -1.0), "a pause of 0 to 3600 s"),
    ],
)
def test_invalid_retries_are_refused(method: str, retry: Retry, text: str) -> None:
    draft = Draft(methods={"a": method}).action("a", "x").chain(START, "a", END)
    draft.retries = {"a": retry}
    with pytest.raises(InvalidProject, match=text):
        draft.script()
