"""Names, arguments and layout of scripts: collisions and refusals."""

import ast
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings, strategies as st

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.data.project import Action, ActionPoint, NamedOrientation, Project, ProjectParameter
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build import points, script
from arcor2_server.build.frame import TypeFacts
from arcor2_server.build.naming import Names, class_name, identifier
from arcor2_server.build.style import docstring
from tests.server.build import workplace


# ------------------------------------------------------------------------------------------------ action points
class _Resources:
    def position(self, key: str) -> Any:
        return Position(float(len(key)))

    def pose(self, key: str) -> Any:
        return key

    def joints(self, key: str) -> Any:
        return key


def read_points(project: Project) -> Any:
    """Run action_points.py and return its ActionPoints."""
    names: dict[str, Any] = {}
    exec(compile(points.source(project), "action_points.py", "exec"), names)
    return names["ActionPoints"](_Resources())


def test_points_with_similar_names_keep_their_poses() -> None:
    similar = ["ap1", "ap_1", "Ap1", "ap__1", "ap1_poses", "action_points", "pose", "resources"]
    project = Project(
        "p",
        "scn_1",
        action_points=[
            ActionPoint(
                name, Position(), id=f"acp_{n}", orientations=[NamedOrientation("o", Orientation(), f"ori_{n}")]
            )
            for n, name in enumerate(similar)
        ],
    )
    aps = read_points(project)
    assert [getattr(aps, name).poses.o for name in similar] == [f"ori_{n}" for n in range(len(similar))]
    assert len({type(getattr(aps, name)) for name in similar}) == len(similar)


anything = st.text(max_size=12) | st.sampled_from(
    ["__x", "__init__", "_res", "class", "match", "position", "poses", "é", ""]
)


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(anything, st.lists(anything, max_size=3)), max_size=6))
def test_points_with_any_name_are_accessible(drawn: list[tuple[str, list[str]]]) -> None:
    project = Project(
        "p",
        "scn_1",
        action_points=[
            ActionPoint(
                name,
                Position(),
                id=f"acp_{n}",
                orientations=[NamedOrientation(o, Orientation(), f"ori_{n}_{k}") for k, o in enumerate(orientations)],
            )
            for n, (name, orientations) in enumerate(drawn)
        ],
    )
    aps = read_points(project)
    names = points.names_of(project)
    assert len(names.poses) == sum(len(orientations) for _, orientations in drawn)
    for orientation_id, path in names.poses.items():
        assert eval("aps." + ".".join(path), {"aps": aps}) == orientation_id


# ------------------------------------------------------------------------------------------------ names
def test_colliding_names_are_made_unique() -> None:
    scene = Scene(
        "s",
        id="scn_1",
        objects=[
            SceneObject(name, "Thing", id=f"obj_{n}")
            for n, name in enumerate(["main", "aps", "print", "Thing", "lambda"])
        ],
    )
    ask = ObjectAction("ask", returns=["boolean"])
    actions = [
        workplace.action("first", "obj_0/ask", results=("aps",)),
        workplace.action("second", "obj_1/ask", results=("aps",)),
        workplace.action("third", "obj_2/ask", results=("limit",)),
    ]
    project = Project(
        "p",
        "scn_1",
        action_points=[ActionPoint("ap", Position(), actions=actions)],
        parameters=[ProjectParameter("limit", "integer", "1", id="pco_1")],
        logic=[
            workplace.step("START", "first"),
            workplace.step("first", "second"),
            workplace.step("second", "third"),
            workplace.step("third", "END"),
        ],
    )
    facts = {"Thing": TypeFacts("object_types.thing", "Thing", {"ask": ask})}
    source = script.from_logic(scene, project, facts)
    tree = ast.parse(source)
    main = next(node for node in tree.body if isinstance(node, ast.FunctionDef))
    stored = [n.id for n in ast.walk(main) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)]
    assert sorted(stored) == sorted(
        ["aps", "main_2", "aps_2", "print_2", "Thing", "lambda_", "limit", "aps_3", "aps_4", "limit_2"]
    )
    assert "from object_types.thing import Thing as ThingType" in source
    assert script.from_logic(scene, project, facts) == source


@given(st.lists(st.text(max_size=8), max_size=20))
def test_generated_names_are_unique_identifiers(texts: list[str]) -> None:
    names = Names(["taken"])
    claimed = [names.claim(text) for text in texts]
    assert len(set(claimed)) == len(claimed)
    assert all(name.isidentifier() and name != "taken" for name in claimed)
    assert all(class_name(text).isidentifier() for text in texts)


def test_names_become_valid_identifiers() -> None:
    assert [identifier(name) for name in ("ap1", "_x", "Größe", "1st", "a b", "if")] == [
        "ap1", "_x", "Gr__e", "_1st", "a_b", "if_",
    ]  # fmt: skip
    assert class_name("pick_up2") == "PickUp2"


# ------------------------------------------------------------------------------------------------ text
@given(st.text())
def test_docstrings_hold_any_text(text: str) -> None:
    [statement] = ast.parse(docstring(text)).body
    assert ast.get_docstring(ast.Module([statement], [])) is not None
    assert "\n" not in docstring(text)


strings = st.text() | st.sampled_from(["it's", 'say "hi"', "both ' and \"", "# no comment", "back\\slash", "\n", "\\'"])


@settings(max_examples=150, deadline=None)
@given(st.lists(strings, min_size=1, max_size=6))
def test_formatted_code_equals_its_syntax_tree(values: list[str]) -> None:
    declared = ObjectAction("say", parameters=[])
    actions, logic = [], []
    names = list(dict.fromkeys(values))
    for n, name in enumerate(names):
        actions.append(Action(name, "obj_1/say", f"act_{n}"))
        logic.append(workplace.step("START", "x"))
        start = "START" if n == 0 else f"act_{n - 1}"
        logic[-1] = msgspec.structs.replace(logic[-1], start=start, end=f"act_{n}")
    logic.append(msgspec.structs.replace(logic[-1], start=f"act_{len(names) - 1}", end="END"))
    scene = Scene("s", id="scn_1", objects=[SceneObject("thing", "Thing", id="obj_1")])
    project = Project("p", "scn_1", action_points=[ActionPoint("ap", Position(), actions=actions)], logic=logic)
    source = script.from_logic(scene, project, {"Thing": TypeFacts("object_types.thing", "Thing", {"say": declared})})
    calls = [
        keyword.value.value
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Call)
        for keyword in node.keywords
        if isinstance(keyword.value, ast.Constant)
    ]
    assert calls == names


def test_a_long_call_is_wrapped_at_arguments() -> None:
    project = workplace.project()
    text = "x" * 100
    project.action_points[0].actions[0] = workplace.action(
        "boards left?", "obj_flow/repeat", ("times", "project_parameter", '"pco_boards"'), results=("left",)
    )
    parameters = [ProjectParameter("boards", "integer", "2", id="pco_boards")]
    renamed = [
        msgspec.structs.replace(one, name=text) if one.name == "pick" else one
        for one in project.action_points[0].actions
    ]
    first = msgspec.structs.replace(project.action_points[0], actions=renamed)
    project = msgspec.structs.replace(project, parameters=parameters, action_points=[first, project.action_points[1]])
    source = script.from_logic(workplace.scene(), project, workplace.FACTS)
    assert (
        "        robot.pick(\n            aps.feeder.poses.default,\n            grip=Grip.FIRM,\n"
        f'            an="{text}",\n        )\n'
    ) in source


# ------------------------------------------------------------------------------------------------ refusals
def _with(name: str, *arguments: tuple[str, str, str], method: str = "", results: tuple[str, ...] = ()) -> Project:
    """Return the workplace's project with one action replaced."""
    project = workplace.project()
    found = []
    for point in project.action_points:
        actions = [
            workplace.action(name, method or one.type, *arguments, results=results) if one.name == name else one
            for one in point.actions
        ]
        found.append(msgspec.structs.replace(point, actions=actions))
    return msgspec.structs.replace(project, action_points=found)


@pytest.mark.parametrize(
    ("project", "text"),
    [
        (_with("pick"), "'pick': parameter pose is missing"),
        (_with("pick", ("pose", "pose", '"ori_none"')), "'pick': the project has no orientation ori_none"),
        (
            _with("pick", ("pose", "pose", '"ori_good"'), ("force", "double", "1.0")),
            "'pick': pick has no parameter force",
        ),
        (_with("pick", ("pose", "pose", '"ori_good"'), ("speed", "integer", "1")), "'pick': parameter speed must be"),
        (
            _with("pick", ("pose", "pose", '"ori_good"'), ("speed", "double", "1.5")),
            "'pick': parameter speed: 1.5 is not",
        ),
        (_with("pick", ("pose", "pose", '"ori_good"'), ("grip", "string_enum", '"x"')), "'pick': parameter grip"),
        (_with("pick", ("pose", "pose", "not json")), "'pick': parameter pose: the value is not JSON"),
        (_with("pick", ("pose", "pose", '"ori_good"'), results=("a",)), "'pick' names 1 results, but pick returns 0"),
        (_with("pick", method="obj_robot/fly"), "'pick': Robot arm has no action fly"),
        (_with("pick", method="nonsense"), "'pick'"),
        (_with("scan code", ("timeout", "link", '"act_boards_left?/default/0"'), results=("code",)), "needs double"),
        (
            _with("scan code", ("timeout", "link", '"act_known?/default/0"'), results=("code",)),
            "does not run before it on all paths",
        ),
        (_with("scan code", ("timeout", "link", '"act_none/default/0"'), results=("code",)), "no action act_none"),
        (_with("scan code", ("timeout", "link", '"x"'), results=("code",)), "'scan code'"),
        (_with("scan code", ("timeout", "project_parameter", '"pco_boards"'), results=("code",)), "boards is integer"),
        (
            _with("scan code", ("timeout", "project_parameter", '"pco_none"'), results=("code",)),
            "no parameter pco_none",
        ),
        (_with("known?", ("code", "link", '"act_scan_code/default/0"')), "'known?'"),
    ],
)
def test_the_refusal_of_an_invalid_action_names_it(project: Project, text: str) -> None:
    with pytest.raises(InvalidProject) as caught:
        script.from_logic(workplace.scene(), project, workplace.FACTS)
    assert text in str(caught.value)


def test_joints_of_another_robot_are_refused() -> None:
    project = workplace.project()
    scene = workplace.scene()
    other = SceneObject("other", "Arm", Pose(), id="obj_other")
    scene = msgspec.structs.replace(scene, objects=[*scene.objects, other])
    project.action_points[0].robot_joints[0].robot_id = "obj_other"
    with pytest.raises(InvalidProject, match=r"'above feeder'.*another robot"):
        script.from_logic(scene, project, workplace.FACTS)


def test_two_actions_with_the_same_name_are_refused() -> None:
    project = workplace.project()
    first, second = project.action_points
    actions = [msgspec.structs.replace(one, name="pick") for one in second.actions]
    project = msgspec.structs.replace(project, action_points=[first, msgspec.structs.replace(second, actions=actions)])
    with pytest.raises(InvalidProject, match="two actions have the name 'pick'"):
        script.from_logic(workplace.scene(), project, workplace.FACTS)


def test_a_disabled_action_is_refused_with_its_problem() -> None:
    broken = ObjectAction("drop", disabled=True, problem="no return annotation")
    facts = {
        **workplace.FACTS,
        "Arm": TypeFacts("object_types.arm", "Robot arm", {**workplace.FACTS["Arm"].actions, "drop": broken}),
    }
    with pytest.raises(InvalidProject, match=r"'throw away': drop of Robot arm cannot be used: no return annotation"):
        script.from_logic(workplace.scene(), workplace.project(), facts)


def test_a_condition_needs_a_named_boolean() -> None:
    project = _with(
        "known?", ("code", "link", '"act_scan_code/default/0"'), method="obj_reader/scan", results=("known",)
    )
    with pytest.raises(InvalidProject, match="known"):
        script.from_logic(workplace.scene(), project, workplace.FACTS)
    numbers = [
        msgspec.structs.replace(
            item,
            condition=msgspec.structs.replace(item.condition, value="1") if item.condition.value == "true" else UNSET,
        )
        if item.condition is not UNSET
        else item
        for item in workplace.project().logic
    ]
    project = msgspec.structs.replace(workplace.project(), logic=numbers)
    with pytest.raises(InvalidProject, match="boolean; a condition can compare it with true and false"):
        script.from_logic(workplace.scene(), project, workplace.FACTS)
