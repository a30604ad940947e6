"""Scripts are read back into projects, unchanged or edited by hand."""

import dataclasses
import random
from pathlib import Path

import pytest
from hypothesis import HealthCheck, assume, given, settings, strategies as st
from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import ActionMetadata, Again, ObjectAction
from arcor2_hw.data.project import END, START, Action, ActionPoint, Flow, Project, Retry
from arcor2_hw.data.scene import SceneObject
from arcor2_server.build.frame import TypeFacts
from arcor2_server.build.reading import NotUnderstood, from_script
from arcor2_server.build.script import from_logic
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.consistency import check_consistent
from arcor2_server.documents.document import Document
from arcor2_server.documents.function_calls import dissolve_call
from arcor2_server.documents.parallel_work import dissolve_parallel
from arcor2_server.errors import RequestRefused
from tests.server.build import workplace
from tests.server.build.projects import (
    SCENE,
    TYPES,
    TypesOfTests,
    exits_of,
    random_draft,
    random_oracle,
    run,
    walk,
    with_choices,
    with_comparisons,
    with_exits,
    with_functions,
    with_parallel_work,
    with_retries,
    with_variables,
    without_doubles,
)


@settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.integers(0, 2**32),
    st.integers(1, 30),
    st.sampled_from([0.0, 0.2, 0.5, 0.9]),
    st.sampled_from([0.0, 0.1, 0.3]),
    st.sampled_from([1, 2, 3, 20]),
    st.sampled_from(["", "choices", "comparisons"]),
    st.booleans(),
    st.booleans(),
)
def test_a_script_round_trips_to_the_same_project(
    seed: int, size: int, merging: float, end_rate: float, window: int, conditions: str, variables: bool, exits: bool
) -> None:
    draft = random_draft(random.Random(seed), size, merging, end_rate, window)
    if conditions:
        change = with_choices if conditions == "choices" else with_comparisons
        draft = change(draft, random.Random(seed))
    if variables:
        draft = with_retries(with_variables(draft, random.Random(seed)), random.Random(seed))
    if exits:
        draft = with_exits(draft, random.Random(seed))
    project = draft.project()
    source = from_logic(SCENE, project, TYPES)
    back = from_script(source, SCENE, project, TYPES)
    steps = [(item.start, item.end, item.is_error_exit) for item in project.logic]
    if len(steps) == len(set(steps)):
        assert back == project, source
    # Two steps between the same two actions, which no editor creates, may be merged.
    assert back.action_points == project.action_points
    [point] = project.action_points
    fresh = from_script(source, SCENE, replace(project, action_points=[replace(point, actions=[])], logic=[]), TYPES)
    for draw in range(3):
        expected = walk(project, random_oracle(seed + draw), 3 * size)
        assert walk(back, random_oracle(seed + draw), 3 * size) == expected, source
        assert walk(fresh, random_oracle(seed + draw), 3 * size) == expected, source


@settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.integers(0, 2**32),
    st.integers(2, 30),
    st.sampled_from([0.0, 0.2, 0.5, 0.9]),
    st.sampled_from([0.0, 0.1]),
    st.integers(1, 6),
    st.sampled_from(["", "choices", "comparisons"]),
    st.booleans(),
)
def test_functions_round_trip_and_do_what_their_actions_did(
    seed: int, size: int, merging: float, end_rate: float, count: int, conditions: str, variables: bool
) -> None:
    rng = random.Random(seed)
    draft = without_doubles(random_draft(rng, size, merging, end_rate, 3))
    if conditions:
        draft = with_choices(draft, rng) if conditions == "choices" else with_comparisons(draft, rng)
    if variables:
        draft = with_retries(with_variables(draft, rng), rng)
    flat = with_exits(draft, rng).project()
    steps = [(item.start, item.end, item.is_error_exit) for item in flat.logic]
    assume(len(steps) == len(set(steps)))  # no editor creates two steps between the same two actions
    project = with_functions(flat, rng, count)
    source = from_logic(SCENE, project, TYPES)
    assert from_script(source, SCENE, project, TYPES) == project, source
    for draw in range(3):
        oracle = random_oracle(seed + draw)
        ran = run(source, oracle, 3 * size, exits_of(project))
        assert ran == walk(flat, oracle, 3 * size), source

    [point] = project.action_points
    bare = replace(project, action_points=[replace(point, actions=[])], logic=[], functions=[])
    fresh = from_script(source, SCENE, bare, TYPES)
    assert run(from_logic(SCENE, fresh, TYPES), oracle, 3 * size, exits_of(fresh)) == ran, source

    document = Document.of(SCENE, project)
    for function in document.of_kind(Kind.FUNCTION):
        [call] = document.calls_of(function.id)
        if any(item.is_error_exit for item in document.outgoing(call.id)):
            continue
        try:
            changes, _ = dissolve_call(document, call.id, remove_function=True)
        except RequestRefused:  # the function ends in a branch, and a branch follows the call
            continue
        check_consistent(document, changes, TypesOfTests())
        document.apply(changes)
    dissolved = document.project
    assert dissolved is not None
    assert run(from_logic(SCENE, dissolved, TYPES), oracle, 3 * size, exits_of(dissolved)) == ran, source


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
@given(
    st.integers(0, 2**32),
    st.integers(6, 30),
    st.sampled_from([0.0, 0.2, 0.5]),
    st.booleans(),
    st.booleans(),
    st.booleans(),
)
def test_parallel_work_round_trips_and_does_what_its_calls_did(
    seed: int, size: int, merging: float, comparisons: bool, variables: bool, exits: bool
) -> None:
    rng = random.Random(seed)
    draft = without_doubles(random_draft(rng, size, merging, 0.05, 3))
    if comparisons:
        draft = with_comparisons(draft, rng)
    if variables:
        draft = with_retries(with_variables(draft, rng), rng)
    flat = (with_exits(draft, rng) if exits else draft).project()
    steps = [(item.start, item.end, item.is_error_exit) for item in flat.logic]
    assume(len(steps) == len(set(steps)))
    scene, project = with_parallel_work(with_functions(flat, rng, 3), rng)
    parallel = [action.id for action in project.all_actions() if action.is_parallel]
    assume(parallel)
    source = from_logic(scene, project, TYPES)
    assert from_script(source, scene, project, TYPES) == project, source
    oracle = random_oracle(seed)
    ran = run(source, oracle, 3 * size, exits_of(project))
    assert ran == walk(flat, oracle, 3 * size), source

    [point] = project.action_points
    bare = replace(project, action_points=[replace(point, actions=[])], logic=[], functions=[])
    fresh = from_script(source, scene, bare, TYPES)
    assert run(from_logic(scene, fresh, TYPES), oracle, 3 * size, exits_of(fresh)) == ran, source

    document = Document.of(scene, project)
    for action_id in parallel:
        changes = dissolve_parallel(document, action_id)
        check_consistent(document, changes, TypesOfTests())
        document.apply(changes)
    dissolved = document.project
    assert dissolved is not None
    assert run(from_logic(scene, dissolved, TYPES), oracle, 3 * size, exits_of(dissolved)) == ran, source


# ------------------------------------------------------------------------------------------------ edits by hand
SCRIPT = Path(__file__).with_name("workplace_script.txt").read_text()
ABOVE = '        robot.move_joints(aps.feeder.joints.above, 0.5, an="above feeder")\n'
PICK = '        robot.pick(aps.feeder.poses.default, grip=Grip.FIRM, an="pick")\n'
IF_KNOWN = "        if known == True:\n"
GOOD = '            robot.place(aps.good.poses.default, an="into good box")\n'
AWAY = '            robot.drop(aps.good.position, -0.2, an="throw away")\n'
BACK = '        robot.move_joints(aps.feeder.joints.above, an="back")\n'


def edited(*changes: tuple[str, str]) -> str:
    source = SCRIPT
    for old, new in changes:
        assert source.count(old) == 1, old
        source = source.replace(old, new)
    return source


def read(*changes: tuple[str, str]) -> Project:
    return from_script(edited(*changes), workplace.scene(), workplace.project(), workplace.FACTS)


def actions_of(project: Project) -> dict[str, Action]:
    return {action.name: action for point in project.action_points for action in point.actions}


def point_of(project: Project, name: str) -> str:
    return next(point.id for point in project.action_points if name in {action.name for action in point.actions})


def values_of(project: Project, name: str) -> dict[str, tuple[str, str]]:
    return {one.name: (one.type, one.value) for one in actions_of(project)[name].parameters}


def facts_with_count() -> dict[str, TypeFacts]:
    """Return the types of the workplace with another action, which returns a number."""
    flow = workplace.FACTS["FlowActions"]
    actions = {**flow.actions, "count": ObjectAction("count", returns=["integer"])}
    return {**workplace.FACTS, "FlowActions": dataclasses.replace(flow, actions=actions)}


def steps_of(project: Project) -> list[tuple[str, str, str]]:
    """Return the logic by names, with the value of each condition."""
    names = {action.id: name for name, action in actions_of(project).items()} | {START: START, END: END}
    return sorted(
        (names[item.start], names[item.end], "" if isinstance(item.condition, Unset) else item.condition.value)
        for item in project.logic
    )


def test_an_untouched_script_changes_nothing() -> None:
    assert read() == workplace.project()
    # A project does not store layout, comments and quotation marks.
    spread = (PICK, "\n        # well\n        robot.pick(\n aps.feeder.poses.default,\n grip=Grip.FIRM, an='pick')\n")
    assert read(spread) == workplace.project()


def test_a_changed_literal_changes_nothing_else() -> None:
    project = read(("0.5, an=", "0.25, an="))
    assert values_of(project, "above feeder")["speed"] == ("double", "0.25")
    assert project.logic == workplace.project().logic
    before = actions_of(workplace.project())
    assert [name for name, action in actions_of(project).items() if action != before[name]] == ["above feeder"]
    assert values_of(read(("0.5, an=", "1, an=")), "above feeder")["speed"] == ("double", "1.0")


def test_edited_arguments_of_every_kind_are_read() -> None:
    changes = [
        ("poses.default, grip=Grip.FIRM", "poses.default, 0.75, Grip.SOFT"),
        ("reader.scan(2.5, Mode.TWICE", "reader.scan(pause, mode=Mode.ONCE"),
        ("    boards = 2\n", "    boards = 7\n    pause = 0.5\n"),
        ("robot.place(aps.good.poses.default", "robot.place(aps.feeder.poses.default"),
        ("robot.drop(aps.good.position, -0.2", "robot.drop(height=-0.125, position=aps.feeder.position"),
    ]
    project = read(*changes)
    assert values_of(project, "pick") == {
        "pose": ("pose", '"ori_feeder"'),
        "speed": ("double", "0.75"),
        "grip": ("string_enum", '"soft"'),
    }
    [boards, _, pause] = project.parameters
    assert (boards.id, boards.value, boards.type) == ("pco_boards", "7", "integer")
    assert (pause.name, pause.value, pause.type) == ("pause", "0.5", "double")
    assert values_of(project, "scan code") == {
        "timeout": ("project_parameter", f'"{pause.id}"'),
        "mode": ("integer_enum", "1"),
    }
    assert values_of(project, "into good box") == {"pose": ("pose", '"ori_feeder"')}
    assert values_of(project, "throw away") == {
        "position": ("position", '"acp_feeder"'),
        "height": ("double", "-0.125"),
    }
    # An action keeps its action point, even if its parameters refer to another one.
    assert point_of(project, "into good box") == "acp_good"


def test_reordered_calls_change_only_the_logic() -> None:
    project = read((ABOVE + PICK, PICK + ABOVE))
    before = workplace.project()
    assert project.action_points == before.action_points
    assert {("scan code", "pick", ""), ("pick", "above feeder", ""), ("above feeder", "known?", "")} <= set(
        steps_of(project)
    )
    assert len(steps_of(project)) == len(steps_of(before))
    assert len({item.id for item in project.logic}) == len(project.logic)
    kept = {item.id for item in before.logic} & {item.id for item in project.logic}
    assert len(kept) == len(before.logic) - 3


def test_a_new_action_is_placed_at_its_point() -> None:
    project = read(
        (GOOD, GOOD + '            robot.drop(aps.feeder.position, 0.3, an="let go")\n'),
        (BACK, BACK + '        again = reader.scan(1.0, an="once more")\n'),
    )
    assert point_of(project, "let go") == "acp_feeder"
    assert point_of(project, "once more") == point_of(
        project, "back"
    )  # the action names no point, so it gets the point of the previous action
    new = actions_of(project)["once more"]
    assert (new.type, new.outputs()) == ("obj_reader/scan", ["again"])
    assert new.id.startswith("act_")
    assert new.id not in {action.id for action in actions_of(workplace.project()).values()}
    assert {("into good box", "let go", ""), ("let go", "back", ""), ("once more", END, "")} <= set(steps_of(project))


def test_a_removed_action_connects_its_neighbours() -> None:
    project = read((ABOVE, ""))
    assert "above feeder" not in actions_of(project)
    assert ("scan code", "pick", "") in steps_of(project)
    assert len(actions_of(project)) == len(actions_of(workplace.project())) - 1


def test_a_new_name_creates_a_new_action() -> None:
    project = read(('an="pick"', 'an="grip"'))
    assert "pick" not in actions_of(project)
    assert actions_of(project)["grip"].id != "act_pick"
    assert point_of(project, "grip") == "acp_feeder"


def test_data_that_scripts_do_not_show_is_kept() -> None:
    before = workplace.project()
    idle = [workplace.action("idle", "obj_flow/finish"), workplace.action("idler", "obj_flow/finish")]
    first = replace(before.action_points[0], actions=[*before.action_points[0].actions, *idle])
    before = replace(
        before,
        action_points=[first, *before.action_points[1:]],
        logic=[*before.logic, workplace.step("idle", "idler"), workplace.step("idler", "pick")],
    )
    source = from_logic(workplace.scene(), before, workplace.FACTS)
    assert "idle" not in source
    assert from_script(source, workplace.scene(), before, workplace.FACTS) == before
    without = from_script(source.replace(PICK, ""), workplace.scene(), before, workplace.FACTS)
    assert {("idle", "idler", "")} <= set(steps_of(without))
    assert [start for start, end, _ in steps_of(without) if end == "pick"] == []


def test_added_and_removed_branches_are_read() -> None:
    pack = '            robot.place(aps.good.poses.default, an="pack")\n'
    project = read(
        (
            PICK,
            PICK
            + '        full = reader.known(code, an="full?")\n        if full:\n'
            + pack
            + "            continue\n\n",
        ),
        (IF_KNOWN, "        if not known:\n            pass\n        else:\n"),
        (GOOD + "        else:\n" + AWAY, GOOD),
    )
    assert {
        ("pick", "full?", ""),
        ("full?", "pack", "true"),
        ("full?", "known?", "false"),
        ("pack", END, ""),
        ("known?", "into good box", "true"),
        ("known?", "back", "false"),
    } <= set(steps_of(project))
    assert "throw away" not in actions_of(project)
    assert values_of(project, "full?") == {"code": ("link", '"act_scan_code/default/0"')}
    kept = {item.id: item for item in workplace.project().logic}
    assert kept["lit_known?_into good box"] in project.logic


def test_a_renamed_result_keeps_the_action_and_the_logic() -> None:
    project = read(
        ("known = reader.known(code, ", "fine = reader.known(label, "),
        ("code = reader.scan(", "label = reader.scan("),
        (IF_KNOWN, "        if fine == True:\n"),
    )
    assert actions_of(project)["known?"].outputs() == ["fine"]
    assert actions_of(project)["scan code"].outputs() == ["label"]
    assert actions_of(project)["known?"].id == "act_known?"
    assert project.logic == workplace.project().logic


def test_a_result_keeps_its_name_when_the_build_changed_it() -> None:
    before = workplace.project()
    points = [
        replace(
            point,
            actions=[
                replace(one, flows=[Flow(outputs=["robot"])]) if one.name == "known?" else one for one in point.actions
            ],
        )
        for point in before.action_points
    ]
    before = replace(before, action_points=points)
    source = from_logic(workplace.scene(), before, workplace.FACTS)
    assert "robot_2 = reader.known" in source
    assert from_script(source, workplace.scene(), before, workplace.FACTS) == before


def test_consecutive_conditions_become_one_branch() -> None:
    body = """\
        left = flow.repeat(boards, an="boards left?")
        if left == False:
            flow.finish(an="finish")
            continue

"""
    project = read(
        (
            body,
            body.replace(
                "            continue\n\n", "            continue\n        if left == True:\n            pass\n"
            ),
        )
    )
    assert steps_of(project) == steps_of(workplace.project())


def test_conditions_on_numbers_and_texts_with_else() -> None:
    pack = '            robot.place(aps.good.poses.default, an="pack")\n'
    counted = PICK + '        n = flow.count(an="count")\n'
    before = workplace.project()
    facts = facts_with_count()

    def steps(branches: str) -> list[tuple[str, str, str]]:
        source = edited((PICK, counted + branches))
        project = from_script(source, workplace.scene(), before, facts)
        # Build writes the same project again, however the script was written.
        again = from_script(from_logic(workplace.scene(), project, facts), workplace.scene(), project, facts)
        assert again == project
        return [step for step in steps_of(project) if step[0] == "count"]

    finish = '            flow.finish(an="enough")\n            continue\n'
    expected = [("count", "enough", ""), ("count", "known?", "-1"), ("count", "pack", "3")]
    assert steps("        if n == 3:\n" + pack + "        elif n != -1:\n" + finish) == expected
    assert (
        steps("        if n == 3:\n" + pack + "        elif n == -1:\n            pass\n        else:\n" + finish)
        == expected
    )
    assert steps("        if n != 3:\n            pass\n        else:\n" + pack) == [
        ("count", "known?", ""),
        ("count", "pack", "3"),
    ]
    with pytest.raises(NotUnderstood, match="n is integer and cannot be compared with True"):
        steps("        if n:\n" + pack)


def test_results_are_stored_in_variables() -> None:
    """A new name with a type hint is a variable, and so is a parameter to which a result is assigned."""
    project = read(
        ("    boards = 2\n", '    boards = 2\n    last: str = ""\n    seen = ""\n'),
        ("        code = reader.scan(2.5, Mode.TWICE, ", "        last = reader.scan(2.5, Mode.TWICE, "),
        ("reader.known(code, ", "reader.known(last, "),
        (BACK, BACK + '        seen = reader.scan(1.0, an="again")\n'),
        (IF_KNOWN, '        if known and last != "":\n'),
    )
    _, *_, last, seen = project.parameters
    assert [(one.name, one.type, one.value, one.variable) for one in (last, seen)] == [
        ("last", "string", '""', True),
        ("seen", "string", '""', True),
    ]
    assert actions_of(project)["scan code"].outputs() == ["last"]
    assert values_of(project, "known?") == {"code": ("project_parameter", f'"{last.id}"')}
    source = from_logic(workplace.scene(), project, workplace.FACTS)
    assert '    # Variables\n    last: str = ""\n    seen: str = ""\n' in source
    assert '        seen = reader.scan(1.0, an="again")\n' in source
    assert 'if known and last != "":' in source
    assert from_script(source, workplace.scene(), project, workplace.FACTS) == project
    with pytest.raises(NotUnderstood, match="the variable boards is integer, the result is string"):
        read((BACK, BACK + '        boards = reader.scan(1.0, an="again")\n'))


def test_retries_are_read() -> None:
    facts = {**workplace.FACTS}
    reader = facts["AcmeReader"]
    scan = replace(reader.actions["scan"], meta=ActionMetadata(again=Again.SAFE))
    facts["AcmeReader"] = dataclasses.replace(reader, actions={**reader.actions, "scan": scan})

    def scanned(call: str) -> Project:
        source = edited(("code = reader.scan(2.5", f"code = {call}.scan(2.5"))
        return from_script(source, workplace.scene(), workplace.project(), facts)

    project = scanned("res.retry(reader, 3, pause=0.5)")
    assert actions_of(project)["scan code"].retry == Retry(3, 0.5)
    source = from_logic(workplace.scene(), project, facts)
    assert "code = res.retry(reader, 3, pause=0.5).scan(2.5" in source
    assert from_script(source, workplace.scene(), project, facts) == project
    for call in ("res.retry(reader)", "res.retry(reader, 0)", "res.retry(reader, 2, 0.5)", "res.retry(reader, n)"):
        with pytest.raises(NotUnderstood, match="a retry has a count from 1 to 100"):
            scanned(call)
    with pytest.raises(NotUnderstood, match="pick cannot be retried"):
        read(("robot.pick(", "res.retry(robot, 3).pick("))


def test_a_script_with_the_older_module_names_is_read() -> None:
    source = edited(
        ("from arcor2_hw.runtime.exceptions import", "from arcor2_runtime.exceptions import"),
        ("from arcor2_hw.runtime.resources import", "from arcor2_runtime.resources import"),
        ("    boards = 2\n", "    boards: int = 2\n"),
        (
            "except Exception as error:\n        print_exception(error)",
            "except Exception as e:\n        print_exception(e)",
        ),
    )
    assert from_script(source, workplace.scene(), workplace.project(), workplace.FACTS) == workplace.project()


# ------------------------------------------------------------------------------------------------ not understood
@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (ABOVE, "        import os  #!\n", "import os"),
        (ABOVE, "        for n in range(3):  #!\n            pass\n", "for n in range(3)"),
        (ABOVE, "        print('x')  #!\n", "print is not an action"),
        (ABOVE, "        while True:  #!\n            pass\n", "while True"),
        (ABOVE, "        return  #!\n", "return"),
        (ABOVE, "        x = 1  #!\n", "x = 1"),
        (ABOVE, "        robot.pose.x()  #!\n", "robot.pose.x is not an action"),
        (ABOVE, "        robot.pick(  #!\n            aps.feeder.poses.default)\n", "has no name"),
        (ABOVE, "        robot.pick(aps.feeder.poses.default, an=name)  #!\n", "must be a string, not name"),
        (BACK, '        robot.pick(aps.feeder.poses.default, an="pick")  #!\n', "already has an action 'pick'"),
        (ABOVE, '        robot.fly(an="x")  #!\n', "Robot arm has no action fly"),
        (ABOVE, '        robot.pick(an="x")  #!\n', "parameter pose of pick is missing"),
        (ABOVE, '        robot.pick(aps.nowhere.poses.default, an="x")  #!\n', "the project has no aps.nowhere"),
        (
            ABOVE,
            '        robot.pick(aps.feeder.position, an="x")  #!\n',
            "pose is pose, but aps.feeder.position is position",
        ),
        (ABOVE, '        robot.pick(aps.feeder.poses.default, 2.0, an="x")  #!\n', "not within"),
        (ABOVE, '        robot.pick(aps.feeder.poses.default, "a", an="x")  #!\n', "speed"),
        (ABOVE, '        robot.pick(aps.feeder.poses.default, 0.1 + 0.2, an="x")  #!\n', "0.1 + 0.2 is no"),
        (ABOVE, '        robot.pick(aps.feeder.poses.default, grip="soft", an="x")  #!\n', "one of Grip"),
        (
            ABOVE,
            '        robot.pick(aps.feeder.poses.default, grip=Grip.HARD, an="x")  #!\n',
            "Grip has no member HARD",
        ),
        (ABOVE, '        robot.pick(aps.feeder.poses.default, grip=Mode.ONCE, an="x")  #!\n', "one of Grip"),
        (ABOVE, '        robot.pick(aps.feeder.poses.default, force=1.0, an="x")  #!\n', "no parameter force"),
        (ABOVE, '        robot.pick(*aps, an="x")  #!\n', "one by one"),
        (
            ABOVE,
            '        robot.pick(aps.feeder.poses.default, 0.5, Grip.SOFT, 1, an="x")  #!\n',
            "has 3 positional parameters",
        ),
        (ABOVE, '        robot.pick(here, an="x")  #!\n', "unknown name here"),
        (ABOVE, '        robot.pick(code, an="x")  #!\n', "pose is pose, but code is string"),
        (ABOVE, '        x = robot.pick(aps.feeder.poses.default, an="x")  #!\n', "returns 0 results, not 1"),
        (ABOVE, '        code = reader.scan(1.0, an="x")  #!\n', "code is already defined"),
        (ABOVE, '        robot = reader.scan(1.0, an="x")  #!\n', "robot is already defined"),
        (ABOVE, '        list = reader.scan(1.0, an="x")  #!\n', "list is not a valid name of a result"),
        (ABOVE, '        x[0] = reader.scan(1.0, an="x")  #!\n', "must be assigned to variables"),
        (ABOVE, '        reader.known(fresh, an="x")  #!\n', "unknown name fresh"),
        (IF_KNOWN, "        if known > 1:  #!\n", "known is boolean, which cannot be compared by >"),
        (IF_KNOWN, "        if known == 1:  #!\n", "known is boolean and cannot be compared with 1"),
        (IF_KNOWN, '        if code > "x":  #!\n', "code is string, which cannot be compared by >"),
        (IF_KNOWN, "        if 3 <= code < 7:  #!\n", "code is string, which cannot be compared by [)"),
        (IF_KNOWN, "        if 7 <= boards < 3:  #!\n", "the range of boards from 7 to 3 is empty"),
        (IF_KNOWN, "        if 3 <= boards > 7:  #!\n", "3 <= boards > 7"),
        (IF_KNOWN, "        if known and known:  #!\n", "known and known contains a comparison twice"),
        (IF_KNOWN, "        if fresh == True:  #!\n", "fresh is not a result"),
        (IF_KNOWN, "        if known and (left or boards > 1):  #!\n", "left or boards > 1"),
        (GOOD, "            if left == True:  #!\n    " + GOOD, "an action is required"),
        (BACK, '        next_action = "x"\n        if next_action == "y":  #!\n    ' + BACK, "is never true"),
        (BACK, '        if next_action == "y":  #!\n    ' + BACK, "not set on all paths"),
        (AWAY, AWAY + "            continue\n            pass  #!\n", "never reached"),
        (
            BACK,
            "        if known == True:\n    " + BACK + "        elif known == True:  #!\n            pass\n",
            "is never true here",
        ),
        (BACK, BACK + "    robot.drop(aps.good.position, 1.0)  #!\n", "must be the last statement"),
        ("    # Project parameters\n", '    robot.drop(aps.good.position, 1.0, an="x")  #!\n', "before the loop"),
        ("    boards = 2\n", "    boards = 2.5  #!\n", "boards is integer, not 2.5"),
        ("    boards = 2\n", "    boards = len('ab')  #!\n", "literal"),
        ("    boards = 2\n", "    boards = 2\n    robot = 3  #!\n", "robot is already defined"),
        ('res.objects["obj_robot"]', 'res.objects["obj_gone"]  #!', "the scene has no object obj_gone"),
        ("from action_points import ActionPoints\n", "import os  #!\n", "import os"),
        ("from action_points import ActionPoints\n", "from os import path  #!\n", "not from os"),
        ("def main(", "def other() -> None:  #!\n    pass\n\n\ndef main(", "def other"),
        ("            main(res)\n", "            main(res)\n            res.scene()  #!\n", "only calls main"),
        ("    while True:\n", "    while res:  #!\n", "while res"),
        ("    boards = 2\n", "    boards = (2  #!\n", "never closed"),
    ],
)
def test_the_refusal_of_unsupported_code_names_its_line(old: str, new: str, text: str) -> None:
    source = edited((old, new))
    line = next(number for number, content in enumerate(source.splitlines(), 1) if "#!" in content)
    with pytest.raises(NotUnderstood) as caught:
        from_script(source, workplace.scene(), workplace.project(), workplace.FACTS)
    assert caught.value.line == line, str(caught.value)
    assert str(caught.value).startswith(f"script.py, line {line}: ")
    assert text in str(caught.value)


def test_the_refusal_names_a_result_that_may_be_missing() -> None:
    source = edited(
        (GOOD, GOOD + '            label = reader.scan(1.0, an="label")\n'),
        (BACK, '        reader.known(label, an="late")\n'),
    )
    with pytest.raises(NotUnderstood, match="label is not always set: 'label' does not run on all paths") as caught:
        from_script(source, workplace.scene(), workplace.project(), workplace.FACTS)
    assert source.splitlines()[caught.value.line - 1].strip().startswith("reader.known(label")


@pytest.mark.parametrize("source", ["", "\0", "def main(res):\n    pass\n", "(" * 5000, "def main():\n    pass\n"])
def test_files_that_are_not_scripts_are_refused(source: str) -> None:
    with pytest.raises(NotUnderstood):
        from_script(source, workplace.scene(), workplace.project(), workplace.FACTS)


def test_joints_of_another_robot_are_refused() -> None:
    project = workplace.project()
    scene = workplace.scene()
    scene = replace(scene, objects=[*scene.objects, SceneObject("other", "Arm", Pose(), id="obj_other")])
    source = edited(
        ('    robot: Arm = res.objects["obj_robot"]\n', '    robot: Arm = res.objects["obj_other"]\n'),
    )
    with pytest.raises(NotUnderstood, match="belong to another robot"):
        from_script(source, scene, project, workplace.FACTS)


def test_a_project_without_action_points_has_no_place_for_actions() -> None:
    bare = replace(workplace.project(), action_points=[], logic=[])
    source = from_logic(
        workplace.scene(),
        replace(
            bare,
            action_points=[
                ActionPoint("p", Position(), id="acp_p", actions=[workplace.action("a", "obj_flow/finish")])
            ],
            logic=[workplace.step(START, "a"), workplace.step("a", END)],
        ),
        workplace.FACTS,
    )
    with pytest.raises(NotUnderstood, match="no action point for the action 'a'"):
        from_script(source, workplace.scene(), bare, workplace.FACTS)


def test_keyword_only_parameters_are_read() -> None:
    facts = {**workplace.FACTS, "Arm": replace_facts(frozenset({("pick", "speed"), ("pick", "grip")}))}
    source = edited((PICK, PICK.replace("grip=", "speed=0.5, grip=")))
    project = from_script(source, workplace.scene(), workplace.project(), facts)
    assert from_logic(workplace.scene(), project, facts) == source
    with pytest.raises(NotUnderstood, match="has 1 positional parameters"):
        from_script(source.replace("speed=0.5", "0.5"), workplace.scene(), workplace.project(), facts)


def test_former_names_are_read_as_current_names() -> None:
    pick = workplace.FACTS["Arm"].actions["pick"]
    parameters = [replace(each, former_names=[f"old_{each.name}"]) for each in pick.parameters]
    renamed = {"pick": replace(pick, former_names=["grab"], parameters=parameters)}
    arm = dataclasses.replace(workplace.FACTS["Arm"], actions={**workplace.FACTS["Arm"].actions, **renamed})
    older = PICK.replace(".pick(", ".grab(").replace("grip=", "old_grip=")
    facts = {**workplace.FACTS, "Arm": arm}
    project = from_script(edited((PICK, older)), workplace.scene(), workplace.project(), facts)
    assert project == from_script(edited(), workplace.scene(), workplace.project(), facts)


def replace_facts(keyword_only: frozenset[tuple[str, str]]) -> TypeFacts:
    return dataclasses.replace(workplace.FACTS["Arm"], keyword_only=keyword_only)


def test_unusual_scripts_are_read_or_refused() -> None:
    sums = "+".join(["1.0"] * 1500)
    for changes, line in (
        ((PICK, f'        robot.pick(aps.feeder.poses.default, {sums}, an="pick")\n'), "is not a bool"),
        ((PICK, f"        {sums}\n"), "the loop contains only calls"),
        ((IF_KNOWN, f"        if {sums} == 1:\n"), "a condition compares a result"),
    ):
        with pytest.raises(NotUnderstood, match=line):
            read(changes)
    deep = "".join(f"{'    ' * n}        if known == True:\n" for n in range(90)) + "    " * 90 + "        pass\n"
    assert read((BACK, deep + BACK))  # the same condition, nested 90 times
    branches = "".join(f"        elif n == {n}:\n            continue\n" for n in range(1, 400))
    source = edited(
        (BACK, f'        n = flow.count(an="count")\n        if n == 0:\n            pass\n{branches}' + BACK)
    )
    facts = facts_with_count()
    project = from_script(source, workplace.scene(), workplace.project(), facts)
    assert len([step for step in steps_of(project) if step[0] == "count"]) == 401
