"""Parallel work in scripts: its form, refusals of Build, and refusals of the import with their line."""

import itertools
import json

import pytest
from msgspec.structs import replace

from arcor2_hw.data.geometry import Position
from arcor2_hw.data.project import (
    END,
    PARALLEL,
    START,
    Action,
    ActionParameter,
    ActionPoint,
    Flow,
    FunctionReturns,
    LogicItem,
    Project,
    ProjectFunction,
    ProjectLogicIf,
)
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build.reading import NotUnderstood, from_script
from arcor2_server.build.script import from_logic
from tests.server.build.projects import TYPES

SCENE = Scene("scene", objects=[SceneObject(name, "Thing", id=f"obj_{name}") for name in ("arm", "press")], id="scn_1")


def action(name: str, kind: str, *outputs: str, **more: object) -> Action:
    return Action(name, kind, f"act_{name}", flows=[Flow(outputs=list(outputs))], **more)  # type: ignore[arg-type]


def step(start: str, end: str, kinds: tuple[str, ...] = (), **more: object) -> LogicItem:
    ids = [place if place in (START, END) else f"act_{place}" for place in (start, end)]
    exits = {"error_kinds": list(kinds)} if kinds else {}
    return LogicItem(*ids, id=f"lit_{start}_{end}", **exits, **more)  # type: ignore[arg-type]


def function(name: str, *actions: Action, returns: tuple[str, ...] = ()) -> ProjectFunction:
    names = [START, *(each.name for each in actions), END]
    logic = [step(start, end) for start, end in itertools.pairwise(names)]
    results = [FunctionReturns("boolean", f"act_{each}/default/0") for each in returns]
    return ProjectFunction(name, list(actions), logic, [], results, f"pfu_{name}")


def project(*functions: ProjectFunction) -> Project:
    """Return a project that fetches and presses in parallel, and uses the result. A refusal leads to the end."""
    link = ActionParameter("flag", "link", json.dumps("act_fetch it/default/0"))
    actions = [
        action("both", PARALLEL, branches=["act_fetch it", "act_press it"], error_output="problem"),
        action("fetch it", "pfu_fetch/call", "found"),
        action("press it", "pfu_push/call"),
        action("use", "obj_arm/use"),
        action("tell", "obj_arm/tell"),
    ]
    actions[3] = replace(actions[3], parameters=[link, ActionParameter("x", "double", "0.5")])
    text = ActionParameter("text", "link", json.dumps("act_both/error/2"))
    actions[4] = replace(actions[4], parameters=[text])
    condition = lambda value: ProjectLogicIf("act_fetch it/default/0", value)  # noqa: E731
    logic = [
        step(START, "both"),
        step("both", "use", condition=condition("true")),
        step("both", END, condition=condition("false")),
        step("both", "tell", ("refused",)),
        step("use", END),
        step("tell", END),
    ]
    return Project(
        "project",
        "scn_1",
        id="pro_1",
        action_points=[ActionPoint("ap", Position(), id="acp_1", actions=actions)],
        functions=list(functions) or [FETCH, PRESS],
        logic=logic,
    )


FETCH = function("fetch", action("look", "obj_arm/ask", "seen"), returns=("look",))
PRESS = function("push", action("down", "obj_press/do"))
LOOP = """
        try:
            found, _ = res.parallel(lambda: fetch(an="fetch it"), lambda: push(an="press it"), an="both")
        except Refused as error:
            problem = res.caught(error)
            arm.tell(problem.text, an="tell")
            continue

        if found == True:
            arm.use(found, 0.5, an="use")
"""


def test_parallel_work_round_trips_as_one_statement() -> None:
    source = from_logic(SCENE, project(), TYPES)
    assert LOOP in source, source
    assert from_script(source, SCENE, project(), TYPES) == project()
    compile(source, "script.py", "exec")


def test_the_results_of_a_branch_are_not_set_after_an_error() -> None:
    made = project()
    [point] = made.action_points
    link = ActionParameter("flag", "link", json.dumps("act_fetch it/default/0"))
    tell = replace(point.actions[4], type="obj_arm/use", parameters=[link, ActionParameter("x", "double", "1.0")])
    wrong = replace(made, action_points=[replace(point, actions=[*point.actions[:4], tell])])
    with pytest.raises(InvalidProject, match="'tell' uses a result of 'fetch it', which does not run before it"):
        from_logic(SCENE, wrong, TYPES)


def test_the_same_device_in_two_branches_is_refused_with_both_actions() -> None:
    inner = function("inner", action("turn", "obj_arm/do"))
    both_arms = function("push", action("down", "obj_press/do"), action("go in", "pfu_inner/call"))
    with pytest.raises(
        InvalidProject,
        match="'both': 'look' of the branch 'fetch it' and 'turn' of the branch 'press it' use the same device arm",
    ):
        from_logic(SCENE, project(FETCH, both_arms, inner), TYPES)


def test_parallel_work_inside_a_branch_is_refused() -> None:
    again = replace(
        PRESS,
        actions=[
            action("again", PARALLEL, branches=["act_one", "act_two"]),
            action("one", "pfu_one/call"),
            action("two", "pfu_two/call"),
        ],
        logic=[step(START, "again"), step("again", END)],
    )
    others = [function(name, action(f"do {name}", "obj_press/do")) for name in ("one", "two")]
    with pytest.raises(InvalidProject, match="'press it' contains other parallel work, 'again'"):
        from_logic(SCENE, project(FETCH, again, *others), TYPES)


@pytest.mark.parametrize(
    ("branches", "reason"),
    [
        (["act_fetch it"], "runs 2 to 4 different calls"),
        (["act_fetch it", "act_use"], "its branch act_use is not a call of a function"),
        (["act_fetch it", "act_gone"], "its branch act_gone is not a call of a function"),
    ],
)
def test_invalid_branches_are_refused(branches: list[str], reason: str) -> None:
    made = project()
    [point] = made.action_points
    wrong = replace(point, actions=[replace(point.actions[0], branches=branches), *point.actions[1:]])
    with pytest.raises(InvalidProject, match=reason):
        from_logic(SCENE, replace(made, action_points=[wrong]), TYPES)


def test_a_branch_has_no_connections() -> None:
    made = project()
    with pytest.raises(InvalidProject, match="'press it' is a branch of 'both', so no connection"):
        from_logic(SCENE, replace(made, logic=[*made.logic, step("tell", "press it")]), TYPES)


@pytest.mark.parametrize(
    ("statement", "reason"),
    [
        ('res.parallel(lambda: fetch(an="a"), an="both")', "runs 2 to 4 different calls"),
        ('res.parallel(lambda: fetch(an="a"), push, an="both")', "a branch is `lambda: function"),
        ('res.parallel(lambda: fetch(an="a"), lambda: arm.do(an="b"), an="both")', "a branch calls a function"),
        ('found = res.parallel(lambda: fetch(an="a"), lambda: push(an="b"), an="both")', "2 variables"),
        ('a, b, c = res.parallel(lambda: fetch(an="a"), lambda: push(an="b"), an="both")', "2 variables"),
        ('res.parallel(lambda: fetch(an="a"), lambda: push(an="b"))', "has no name"),
        ('res.parallel(lambda: fetch(an="a"), lambda: push(an="b"), an="both", wait=1)', "has no parameter wait"),
    ],
)
def test_the_refusal_of_another_form_names_its_line(statement: str, reason: str) -> None:
    source = from_logic(SCENE, project(), TYPES)
    start = source.index("        try:\n            found")
    end = source.index("\n\nif __name__")
    edited = source[:start] + f"        {statement}\n" + source[end:]
    with pytest.raises(NotUnderstood, match=reason) as caught:
        from_script(edited, SCENE, project(), TYPES)
    assert caught.value.line == edited[:start].count("\n") + 1
