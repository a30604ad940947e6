"""Checks and geometry as pure functions: loops in the logic, problems, parents of action points."""

import contextlib
import math
import sys
import time
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import example, given, settings, strategies as st
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import (
    Action,
    ActionParameter,
    ActionPoint,
    Flow,
    LogicComparison,
    LogicItem,
    LogicWhen,
    NamedOrientation,
    Operator,
    Project,
    ProjectLogicIf,
    ProjectParameter,
)
from arcor2_hw.data.project_index import global_pose
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks.project import project_problems
from arcor2_server.documents.checks.scene import scene_problems
from arcor2_server.documents.dependents import project_after
from arcor2_server.documents.document import Document
from arcor2_server.documents.logic import check_logic_item
from arcor2_server.documents.reparenting import changes_for_parent
from tests.server.session.session_server import RecordedTypes

RANDOM = SceneObject("rnd", "RandomActions", UNSET, [], "obj_r")
TIME = SceneObject("time", "TimeActions", UNSET, [], "obj_t")
URL = Parameter("url", "string", '"http://127.0.0.1:5018"')
ROBOT = SceneObject("robot", "DobotMagician", Pose(), [URL], "obj_d")
FLOW = [Flow()]


@pytest.fixture(scope="module")
def types() -> RecordedTypes:
    return RecordedTypes()


# ------------------------------------------------------------------------------------------------ logic
def meta_of(action: Action) -> ObjectAction:
    return ObjectAction("random", returns=["boolean", "double", "integer", "string_enum"])


def branching(*names: str) -> Document:
    flows = [[Flow(outputs=[f"{name}_{kind}" for kind in "bdis"])] for name in names]
    actions = [Action(name, "obj_r/random", name, [], flow) for name, flow in zip(names, flows, strict=True)]
    point = ActionPoint("p", Position(), id="acp", actions=actions)
    return Document.of(Scene("s", id="scn", objects=[RANDOM]), Project("p", "scn", id="pro", action_points=[point]))


def step(start: str, end: str, condition: str = "", value: str = "true", key: str = "") -> LogicItem:
    return LogicItem(start, end, ProjectLogicIf(condition, value) if condition else UNSET, key or f"{start}>{end}")


def add(document: Document, item: LogicItem) -> None:
    check_logic_item(document, meta_of, item)
    document.apply([document.add(Kind.LOGIC, item.id, item)])


@pytest.mark.parametrize(
    ("item", "reason"),
    [
        (step("START", "END"), "straight"),
        (step("a", "a"), "itself"),
        (step("a", "nobody"), "nobody"),
        (step("END", "a"), "start at END"),
        (step("a", "START"), "end at START"),
        (step("a/other", "c"), "names no action"),
        (step("START", "c"), "START leads to"),
        (step("a", "b", "a/default/0", "false", "again"), "already"),
        (step("a", "c"), "needs a condition"),
        (step("a", "c", "a/default/0", " true"), "same condition"),
        (step("a", "c", "a/default/1"), "test booleans"),
        (step("a", "c", "a/default/2"), "an integer, not with true"),
        (step("a", "c", "a/default/2", "1.0"), "an integer, not with 1.0"),
        (step("a", "c", "a/default/3", "3"), "a text in quotes, not with 3"),
        (step("a", "c", "a/default/3", "soft"), "a text in quotes, not with soft"),
        (step("a", "c", "a/default/4"), "result number 4"),
        (step("a", "c", "a/other/0"), "result number"),
        (step("a", "c", "a"), "malformed"),
        (step("a", "c", "a/default/0", '"yes"'), "true or false"),
        (step("c", "a"), "loop"),
        (step("c", "b"), "loop"),
    ],
)
def test_invalid_connections_are_refused(item: LogicItem, reason: str) -> None:
    document = branching("a", "b", "c", "d")
    add(document, step("START", "a"))
    add(document, step("a", "b", "a/default/0"))
    add(document, step("b", "c"))
    with pytest.raises(Arcor2Error, match=reason):
        check_logic_item(document, meta_of, item)


def test_valid_connections_are_accepted() -> None:
    document = branching("a", "b", "c")
    add(document, step("START", "a"))
    add(document, step("a", "b", "a/default/0", "true"))
    add(document, step("a/default", "c", "a/default/0", "false"))
    add(document, step("b", "c"))
    # Reversing a connection is not a loop by itself: the replaced connection does not count.
    check_logic_item(document, meta_of, step("c", "b", key="b>c"))
    with pytest.raises(InvalidData, match="loop"):
        check_logic_item(document, meta_of, step("c", "b", key="new"))
    add(document, step("c", "END"))


def test_numbers_and_texts_may_have_a_default_branch() -> None:
    document = branching("a", "b", "c", "d", "e")
    add(document, step("START", "a"))
    add(document, step("a", "b", "a/default/2", "3"))
    add(document, step("a", "c"))  # the default branch
    add(document, step("a", "d", "a/default/2", "-4"))
    for item, reason in (
        (step("a", "e"), "but one needs a condition"),
        (step("a", "e", "a/default/2", "3"), "same condition"),
        (step("a", "e", "a/default/0", "true"), "Each of several steps from a needs a condition"),
    ):
        with pytest.raises(InvalidData, match=reason):
            check_logic_item(document, meta_of, item)
    add(document, step("a", "e", "a/default/3", '"soft"'))
    # The default branch may get a condition, and another connection become the default.
    check_logic_item(document, meta_of, step("a", "c", "a/default/2", "7", key="a>c"))
    with pytest.raises(InvalidData, match="but one"):
        check_logic_item(document, meta_of, step("a", "d", key="a>d"))


def when(
    start: str, end: str, *comparisons: tuple[str, str, str] | tuple[str, str, str, str], key: str = ""
) -> LogicItem:
    tests = [LogicComparison(one[0], Operator(one[1]), *one[2:]) for one in comparisons]
    return LogicItem(start, end, id=key or f"{start}>{end}", when=LogicWhen(tests))


def paired(what: str, operator: str, other: str) -> LogicItem:
    return LogicItem("a", "d", id="a>d", when=LogicWhen([LogicComparison(what, Operator(operator), other=other)]))


def test_comparisons_are_checked_by_the_types_of_their_values() -> None:
    document = branching("a", "b", "c", "d", "e")
    for name, key in (("limit", "pco"), ("other", "pco2")):
        document.apply([document.add(Kind.PARAMETER, key, ProjectParameter(name, "string", '"x"', id=key))])
    add(document, step("START", "a"))
    add(document, when("a", "b", ("a/default/2", "[)", "3", "7"), ("pco", "==", '"x"'), ("a/default/1", "<", "5")))
    add(document, step("a", "c"))
    number = "a/default/2"
    for item, reason in (
        (when("a", "d", ("a/default/1", "==", "5")), "use a range"),
        (when("a", "d", (number, "<", '"x"')), "integer and cannot be compared with 'x'"),
        (when("a", "d", ("a/default/3", "<", '"x"')), "string_enum, which cannot be compared by <"),
        (when("a", "d", (number, "[]", "3")), "two limits"),
        (when("a", "d", (number, "<", "3", "4")), "two limits"),
        (when("a", "d", (number, "[]", "4", "3")), "range of a_i from 4 to 3 is empty"),
        (when("a", "d", (number, "<", "3"), (number, "<", "3")), "given twice"),
        (when("a", "d", (number, "<", "null")), "invalid value: null"),
        (paired(number, "<", "pco"), "integer and cannot be compared with limit, which is string"),
        (paired(number, "<", number), "compares a value with itself"),
        (paired(number, "<", "gone"), "gone"),
        (paired("pco", "<", "pco2"), "limit is string, which cannot be compared by <"),
        (when("a", "d", ("gone", "<", "3")), "gone"),
        (when("a", "d", ("a/default/4", "<", "3")), "result number 4"),
        (when("START", "a", (number, "<", "3"), key="START>a"), "START cannot have a condition"),
        (when("a", "c", (number, "<", "3"), key="a>b"), "a leads to c already"),
        (replace(when("a", "d", (number, "<", "3")), error_kinds=["error"]), "error exit of a cannot have"),
        (replace(when("a", "d", (number, "<", "3")), condition=ProjectLogicIf(number, "3")), "not both"),
        (step("a", "d"), "but one needs a condition"),
        (
            when("a", "d", ("a/default/2", "[)", "3", "7.0"), ("pco", "==", '"x"')),
            "cannot be compared with 7.0",
        ),
    ):
        with pytest.raises(Arcor2Error, match=reason):
            check_logic_item(document, meta_of, item)
    add(document, step("a", "d", number, "9"))
    for item in (step("a", "e", number, "9"), when("a", "e", (number, "==", "9"))):
        with pytest.raises(InvalidData, match="same condition"):
            check_logic_item(document, meta_of, item)
    assert [user.id for user in document.users_of("pco")] == ["a>b"]
    assert {user.id for user in document.users_of("a")} == {"a>b", "a>d"}


def error_exit(start: str, end: str, *kinds: str, condition: str = "") -> LogicItem:
    return replace(step(start, end, condition, key=f"{start}!{end}"), error_kinds=list(kinds))


def test_error_exits_are_next_to_ordinary_steps() -> None:
    document = branching("a", "b", "c", "d")
    add(document, step("START", "a"))
    add(document, step("a", "b"))
    add(document, error_exit("a", "b", "device_timeout"))  # continue as after a success
    add(document, error_exit("a", "c", "refused", "kinematics"))
    add(document, error_exit("a", "END", "error"))
    for item, reason in (
        (replace(error_exit("START", "c", "refused"), id="START>a"), "START is not an action"),
        (error_exit("a", "d", "stale", condition="a/default/0"), "cannot have a condition"),
        (error_exit("a", "d", "connection_lost"), "connection_lost.*is not a kind"),
        (error_exit("a", "d", "stale", "stale"), "given twice"),
        (error_exit("a", "d", "stale", "error"), "contains all others"),
        (error_exit("a", "d", "kinematics"), "another error exit for kinematics"),
        (replace(error_exit("a", "c", "stale"), id="new"), "a leads to c already"),
        (error_exit("b", "a", "stale"), "loop"),
        (step("a", "d"), "needs a condition"),
    ):
        with pytest.raises(InvalidData, match=reason):
            check_logic_item(document, meta_of, item)
    # A branch needs conditions only on the ordinary steps.
    document.apply([document.update(Kind.LOGIC, "a>b", step("a", "b", "a/default/0"))])
    check_logic_item(document, meta_of, step("a", "d", "a/default/0", "false"))


def test_booleans_have_no_default_branch() -> None:
    document = branching("a", "b", "c")
    add(document, step("a", "b"))
    with pytest.raises(InvalidData, match="needs a condition"):
        check_logic_item(document, meta_of, step("a", "c", "a/default/0", "true"))


@contextlib.contextmanager
def counted_calls() -> Iterator[list[int]]:
    """Count the calls of functions in this context."""
    calls = [0]

    def count(_frame: object, event: str, _argument: object) -> None:
        calls[0] += event in ("call", "c_call")

    former = sys.getprofile()
    sys.setprofile(count)
    try:
        yield calls
    finally:
        sys.setprofile(former)


def test_the_check_of_complex_logic_does_not_follow_every_path() -> None:
    document = branching("s", *(f"{side}{n}" for n in range(18) for side in "lrj"))
    at = "s"
    for n in range(18):
        add(document, step(at, f"l{n}", f"{at}/default/0", "true"))
        add(document, step(at, f"r{n}", f"{at}/default/0", "false"))
        add(document, step(f"l{n}", f"j{n}"))
        add(document, step(f"r{n}", f"j{n}"))
        at = f"j{n}"
    with counted_calls() as calls, pytest.raises(InvalidData, match="loop"):
        add(document, step(at, "s"))
    assert calls[0] < 2**16, "it follows each of 2**18 paths"

    names = [f"c{n}" for n in range(1000)]
    chain = branching(*names)
    with counted_calls() as calls:
        for one, other in zip(names[-2::-1], names[:0:-1], strict=True):  # each check follows all the rest
            add(chain, step(one, other))
    assert calls[0] < 10 * len(names) ** 2
    with pytest.raises(InvalidData, match="loop"):
        add(chain, step("c999", "c0"))


# ------------------------------------------------------------------------------------------------ problems
def pick(name: str, **changes: Any) -> Action:
    action = Action(name, "obj_t/sleep", f"act_{name}", [ActionParameter("seconds", "double", "0.5")], FLOW)
    return replace(action, **changes)


def project(*points: ActionPoint, **fields: Any) -> Project:
    return Project("p", "scn", id="pro", action_points=list(points), **fields)


SCENE = Scene("s", id="scn", objects=[TIME, RANDOM, ROBOT])


@pytest.mark.parametrize(
    ("obj", "problem"),
    [
        (SceneObject("x", "Nothing", UNSET, [], "o"), "does not exist"),
        (SceneObject("x y", "TimeActions", UNSET, [], "o"), "valid name"),
        (SceneObject("x", "Robot", Pose(), [], "o"), "abstract"),
        (SceneObject("x", "TimeActions", Pose(), [], "o"), "no pose"),
        (SceneObject("x", "WeighingMachine", UNSET, [], "o"), "needs a pose"),
        (replace(ROBOT, parameters=[Parameter("url", "integer", "1")]), "type string"),
        (replace(ROBOT, parameters=[URL, Parameter("bogus", "string", '""')]), "no setting bogus"),
        (replace(ROBOT, parameters=[URL, URL]), "twice"),
    ],
)
def test_invalid_scenes_have_problems(types: RecordedTypes, obj: SceneObject, problem: str) -> None:
    assert any(problem in p.text for p in scene_problems(Scene("s", objects=[obj]), types))
    assert scene_problems(SCENE, types) == []


def test_problems_contain_the_display_name_of_the_type(types: RecordedTypes, monkeypatch: pytest.MonkeyPatch) -> None:
    named = replace(types.meta("TimeActions"), display_name="Wall clock")
    monkeypatch.setattr(types, "meta", lambda _: named)
    scene = Scene("s", objects=[SceneObject("x", "TimeActions", Pose(), [], "o")])
    assert [problem.text for problem in scene_problems(scene, types)] == ["x: Wall clock has no pose."]


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        (project(replace(ActionPoint("p", Position(), "nowhere", id="a"))), "neither"),
        (project(ActionPoint("p", Position(), "obj_t", id="a")), "has no pose"),
        (project(ActionPoint("p", Position(), "b", id="a"), ActionPoint("q", Position(), "a", id="b")), "ancestor"),
        (project(parameters=[ProjectParameter("n", "double", "[1]", id="x")]), "truth value"),
        (project(ActionPoint("p", Position(), id="a", actions=[pick("x", type="gone/sleep")])), "gone"),
        (project(ActionPoint("p", Position(), id="a", actions=[pick("x", type="obj_t/run")])), "run"),
        (project(ActionPoint("p", Position(), id="a", actions=[pick("x", type="sleep")])), "not <object id>"),
        (project(ActionPoint("p", Position(), id="a", actions=[pick("x", flows=[])])), "one flow"),
        (project(ActionPoint("p", Position(), id="a", actions=[pick("x", flows=[Flow(outputs=["r"])])])), "returns 0"),
        (project(ActionPoint("p", Position(), id="a", actions=[pick("x", parameters=[])])), "seconds is missing"),
        (project(ActionPoint("p", Position(), id="a", actions=[pick("x"), pick("x", id="y")])), "More than one"),
        (replace(project(), scene_id="other"), "another scene"),
    ],
)
def test_invalid_projects_have_problems(types: RecordedTypes, wrong: Project, problem: str) -> None:
    found = project_problems(SCENE, wrong, types)
    assert len(found) >= 1
    assert any(problem in p.text for p in found), found
    assert all(p.values for p in found), "the name of the item is in the key, not in the values"


@pytest.mark.parametrize(
    ("parameter", "reason"),
    [
        (("double", "1"), "fraction"),
        (("integer", "1"), "type double"),
        (("project_parameter", '"pco_text"'), "is string"),
        (("project_parameter", '"pco_none"'), "pco_none"),
        (("project_parameter", "5"), "JSON string"),
        (("link", '"act_x/default/0"'), "same action"),
        (("link", '"act_bool/default/0"'), "is boolean"),
        (("link", '"act_silent/default/0"'), "Name its results"),
        (("link", '"act_double/default/1"'), "number 1"),
        (("link", '"act_double"'), "not <action id>"),
        (("project_parameter", '"pco_ok"'), ""),
        (("link", '"act_double/default/0"'), ""),
        (("double", "0.25"), ""),
    ],
)
def test_invalid_action_parameters_are_problems(types: RecordedTypes, parameter: tuple[str, str], reason: str) -> None:
    def random(name: str, method: str, *outputs: str) -> Action:
        given = [ActionParameter("probability", "double", "0.5")] if method == "random_bool" else []
        return Action(name, f"obj_r/{method}", f"act_{name}", given, [Flow(outputs=list(outputs))])

    point = ActionPoint(
        "p",
        Position(),
        id="a",
        actions=[
            random("bool", "random_bool", "b"),
            random("silent", "random_double"),
            random("double", "random_double", "d"),
            pick("x", parameters=[ActionParameter("seconds", *parameter)]),
        ],
    )
    texts = [ProjectParameter("t", "string", '"x"', id="pco_text"), ProjectParameter("k", "double", "1.0", id="pco_ok")]
    found = project_problems(SCENE, project(point, parameters=texts), types)
    assert found == [] if not reason else (len(found) == 1 and reason in found[0].text), found


def test_checking_time_grows_linearly(types: RecordedTypes) -> None:
    """Parents in one chain and results linked from action to action: the worst case for checks that search."""

    def chain(size: int) -> Project:
        points = []
        for n in range(size):
            orientation = NamedOrientation("o", Orientation(), f"ori_{n}")
            value = f'"act_{n - 1}/default/0"' if n else "0.5"
            parameter = ActionParameter("probability", "link" if n else "double", value)
            returned = [Flow(outputs=[f"r{n}"])]
            remaining = [
                Action(f"d{n}", "obj_r/random_double", f"act_{n}", [], returned),
                Action(f"b{n}", "obj_r/random_bool", f"bct_{n}", [parameter], FLOW),
                Action(f"m{n}", "obj_d/move", f"mct_{n}", [ActionParameter("pose", "pose", f'"ori_{n}"')], FLOW),
            ]
            parent = f"acp_{n - 1}" if n else UNSET
            points.append(
                ActionPoint(f"p{n}", Position(), parent, id=f"acp_{n}", orientations=[orientation], actions=remaining)
            )
        return project(*points)

    def cost(size: int) -> float:
        subject = chain(size)
        best = math.inf
        for _ in range(3):
            began = time.thread_time()
            assert project_problems(SCENE, subject, types) == []
            best = min(best, time.thread_time() - began)
        return best

    assert cost(1000) < 25 * cost(100)  # ten times the size; quadratic time would be a factor of a hundred


# ------------------------------------------------------------------------------------------------ parents
angles = st.floats(-math.pi, math.pi)
lengths = st.floats(-2, 2)
orientations = st.builds(Orientation.from_rotation_vector, angles, angles, angles)
poses = st.builds(Pose, st.builds(Position, lengths, lengths, lengths), orientations)


def same(one: Pose, other: Pose) -> bool:
    return one.position.distance_to(other.position) < 1e-9 and one.orientation.angle_to(other.orientation) < 1e-7


@settings(max_examples=60, deadline=None)
@given(first=poses, second=poses, local=poses, below=poses, order=st.permutations(["obj_a", "obj_b", "", "acp_w"]))
@example(
    first=Pose(Position(), Orientation.from_rotation_vector(9e-10, 0, 0)),
    second=Pose(),
    local=Pose(Position(2, 2, 2)),
    below=Pose(Position(2, 2, 2)),
    order=["obj_b"],
)
def test_poses_in_the_world_are_kept_when_the_parent_changes(
    first: Pose, second: Pose, local: Pose, below: Pose, order: list[str]
) -> None:
    scene = Scene(
        "s",
        id="scn",
        objects=[SceneObject("a", "T", first, [], "obj_a"), SceneObject("b", "T", second, [], "obj_b")],
    )

    def point(key: str, pose: Pose, parent: str) -> ActionPoint:
        return ActionPoint(
            key,
            pose.position,
            parent or UNSET,
            id=key,
            orientations=[NamedOrientation("o", pose.orientation, f"o{key}")],
        )

    document = Document.of(
        scene,
        project(
            point("acp_w", second, "obj_b"),
            point("acp", local, "obj_a"),
            point("acp_1", below, "acp"),
            point("acp_2", below, "acp_1"),
        ),
    )
    names = ("acp", "acp_1", "acp_2")

    def places() -> list[Pose]:
        pairs = [document.orientation(f"o{name}") for name in names]
        return [global_pose(document, holder, named.orientation) for holder, named in pairs]

    before, origin = places(), encode(document)
    done = []
    for parent in order:
        if parent == (document.action_point("acp").parent or ""):
            continue
        changes, changed = changes_for_parent(document, "acp", parent)
        assert changed[0] == "acp"
        assert set(changed) <= set(names)
        document.apply(changes)
        done.append(changes)
        assert all(map(same, places(), before))
        assert (document.action_point("acp").parent or "") == parent
    for changes in reversed(done):
        document.apply([change.inverse() for change in reversed(changes)])
    assert encode(document) == origin


def encode(document: Document) -> list[Any]:
    return document.items()


def test_rotating_a_parent_rotates_its_children() -> None:
    turned = Pose(Position(1, 0, 0), Orientation.from_rotation_vector(0, 0, math.pi / 2))
    scene = Scene("s", id="scn", objects=[SceneObject("a", "T", turned, [], "obj_a")])
    points = [
        ActionPoint("p", Position(1, 1, 0), id="acp"),
        ActionPoint("c", Position(1, 0, 0), "acp", id="c", orientations=[NamedOrientation("o", Orientation(), "ori")]),
    ]
    document = Document.of(scene, project(*points))
    changes, changed = changes_for_parent(document, "acp", "obj_a")
    document.apply(changes)
    assert changed == ["acp", "c"]
    # Computed by hand in the frame of the object, whose x axis points along the world's y axis.
    assert document.action_point("acp").position.distance_to(Position(1, 0, 0)) < 1e-12
    assert document.action_point("c").position.distance_to(Position(0, -1, 0)) < 1e-12
    assert document.orientation("ori")[1].orientation.angle_to(turned.orientation.inverted()) < 1e-12


def test_a_descendant_as_parent_is_refused() -> None:
    points = [ActionPoint("p", Position(), id="a"), ActionPoint("q", Position(), "a", id="b")]
    document = Document.of(Scene("s", id="scn"), project(*points))
    for parent in ("a", "b"):
        with pytest.raises(InvalidData, match="ancestor"):
            changes_for_parent(document, "a", parent)


def test_removing_an_object_adapts_its_projects() -> None:
    """Points keep their poses in the world; the object's actions are removed, with their connections and overrides."""
    turned = Pose(Position(1, 2, 3), Orientation.from_rotation_vector(0, 0, 1))
    scale = SceneObject("scale", "WeighingMachine", turned, [], "obj_s")
    scene = Scene("s", id="scn", objects=[scale, TIME])
    weigh = Action("w", "obj_s/weigh", "act_w", [], FLOW)
    before = project(
        ActionPoint("p", Position(1, 0, 0), "obj_s", id="acp", actions=[weigh, pick("x")]),
        logic=[step("START", "act_w"), step("act_w", "act_x"), step("act_x", "END")],
    )
    after = project_after(scene, before, removed=["obj_s"], moved=[])
    world_pose = global_pose(Document.of(scene, before), before.action_points[0])
    assert after.action_points[0].parent is UNSET
    assert after.action_points[0].position.distance_to(world_pose.position) < 1e-9
    assert [action.name for action in after.action_points[0].actions] == ["x"]
    assert [item.id for item in after.logic] == ["act_x>END"]
    assert project_after(scene, before, removed=["other"], moved=[]) is before
