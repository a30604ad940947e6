"""The comments and the formatting of an edited script survive edits of the logic."""

import ast
import random
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, assume, example, given, settings, strategies as st
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.project import END, START, Action, Flow, LogicItem, Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build.merging.equivalence import action_name
from arcor2_server.build.merging.matching import walk
from arcor2_server.build.reading import from_script
from arcor2_server.build.script import from_logic, read_with_text
from tests.server.build import workplace
from tests.server.build.projects import (
    OBJECT,
    SCENE,
    TYPES,
    random_draft,
    with_choices,
    with_comparisons,
    with_exits,
    with_functions,
    with_parallel_work,
    with_retries,
    with_variables,
    without_doubles,
)


def reformatted(source: str, rng: random.Random) -> str:
    """Return a script as a person could have written it: with comments, different quotes, line breaks and names."""
    lines: list[str] = []
    inside = False
    number = 0
    for line in source.splitlines():
        inside = (inside or line.startswith("def main")) and not line.startswith("if __name__")
        text = line.lstrip()
        indent = line[: len(line) - len(text)]
        name = re.search(r'an="([^"]+)"\)$', text)
        if not text or (text.startswith("#") and rng.random() < 0.2):
            if rng.random() < 0.5:
                lines.append("")
            continue
        comments = rng.random() < 0.4 and not text.startswith("#")
        number += 1
        label = name[1] if name else f"line {number}"
        if comments:
            lines += [""] * rng.randrange(3) + [f"{indent}#   above {label}:"]
            lines += [f"{indent}#{quote}" for quote in rng.sample(["", ' "quoted', "  if x:"], rng.randrange(2))]
        if inside:
            text = re.sub(r"(if|elif) (\w+) == True:", r"\1 \2:", text) if rng.random() < 0.3 else text
            text = re.sub(r"(if|elif) (\w+) == False:", r"\1 not \2:", text) if rng.random() < 0.3 else text
            text = re.sub(r"(?<![\w.\"'])thing(?=[.:,])", "machine", text)
        if name and rng.random() < 0.3:
            text = text.replace(f'an="{name[1]}"', f"an='{name[1]}'")
        if name and rng.random() < 0.3:
            first, rest = text.split("(", 1)
            text = f"{first}(\n{indent}      {rest[:-1]}\n{indent})"
        if comments and rng.random() < 0.5 and not text.endswith('"'):
            text += f"  # behind {label}"
        lines += f"{indent}{text}".split("\n")
    return "\n".join([*lines, *([""] * rng.randrange(3))])


def logic_of(rng: random.Random, size: int, merging: float, end_rate: float, conditions: str) -> Project:
    draft = without_doubles(random_draft(rng, size, merging, end_rate, 3))
    if conditions:
        draft = with_choices(draft, rng) if conditions == "choices" else with_comparisons(draft, rng)
    return with_exits(with_retries(with_variables(draft, rng), rng), rng).project()


def program(
    seed: int, size: int, merging: float, end_rate: float, conditions: str, functions: int, parallel: bool
) -> tuple[Scene, Project]:
    rng = random.Random(seed)
    project = logic_of(rng, size, merging, end_rate, conditions)
    steps = [(item.start, item.end, item.is_error_exit) for item in project.logic]
    assume(len(steps) == len(set(steps)))  # no editor creates two steps between the same two actions
    if functions:
        project = with_functions(project, rng, functions)
    return with_parallel_work(project, rng) if parallel else (SCENE, project)


programs = st.builds(
    program,
    st.integers(0, 2**32),
    st.integers(1, 25),
    st.sampled_from([0.0, 0.2, 0.5]),
    st.sampled_from([0.0, 0.1]),
    st.sampled_from(["", "choices", "comparisons"]),
    st.sampled_from([0, 0, 2]),
    st.sampled_from([False, False, True]),
)


def test_comments_survive_an_edit_of_parallel_work() -> None:
    rng = random.Random(0)
    scene, project = with_parallel_work(without_doubles(random_draft(rng, 17, 0.0, 0.0, 3)).project(), rng)
    assert any(action.is_parallel for point in project.action_points for action in point.actions)
    source = from_logic(scene, project, TYPES).replace("    while True:", "    # forever\n    while True:")
    imported = read_with_text(source, scene, project, TYPES)
    assert replace(imported, script=UNSET) == project
    parallel = next(action for point in project.action_points for action in point.actions if action.is_parallel)
    actions = [
        replace(action, name="renamed") if action is parallel else action
        for action in imported.action_points[0].actions
    ]
    assert "    # forever\n    while True:" in from_logic(scene, with_actions(imported, actions), TYPES)


def with_actions(project: Project, actions: list[Action]) -> Project:
    return replace(project, action_points=[replace(project.action_points[0], actions=actions)])


def edited(project: Project, rng: random.Random) -> tuple[Project, set[str]]:
    """Return the project after one edit as a tablet makes it, and the names of the actions that it touched."""
    actions = list(project.action_points[0].actions)
    kind = rng.choice(["parameter", "rename", "add", "remove", "connect"])
    number = rng.randrange(len(actions))
    one = actions[number]
    if kind == "parameter":
        numbers = [place for place, each in enumerate(actions) if any(each.name == "x" for each in each.parameters)]
        assume(numbers)
        one = actions[number := rng.choice(numbers)]
        parameters = [replace(each, value="0.75") if each.name == "x" else each for each in one.parameters]
        actions[number] = replace(one, parameters=parameters)
        return with_actions(project, actions), {one.name}
    if kind == "rename":
        actions[number] = replace(one, name="renamed")
        return with_actions(project, actions), {one.name}
    if kind == "add":
        place = rng.randrange(len(project.logic))
        item = project.logic[place]
        actions.append(Action("added", f"{OBJECT}/do", "id_added", [], [Flow()]))
        logic = [*project.logic, LogicItem("id_added", item.end, id="lit_added")]
        logic[place] = replace(item, end="id_added")
        return replace(with_actions(project, actions), logic=logic), {"added"}
    if kind == "remove":
        after = [item for item in project.logic if item.start == one.id]
        assume(len(after) == 1 and len(actions) > 1)
        logic = [
            replace(item, end=after[0].end) if item.end == one.id else item
            for item in project.logic
            if item is not after[0]
        ]
        assume(LogicItem(START, END) not in [replace(item, id="") for item in logic])
        del actions[number]
        return replace(with_actions(project, actions), logic=logic), {one.name}
    place = rng.randrange(len(project.logic))
    logic = list(project.logic)
    logic[place] = replace(logic[place], end=rng.choice([END, one.id]))
    return replace(project, logic=logic), set()


def comments_of(source: str) -> dict[str, tuple[list[str], str]]:
    """Return the comments directly above each action, and the comment behind it."""
    lines = source.splitlines()
    found = {}
    [main] = [node for node in ast.parse(source).body if isinstance(node, ast.FunctionDef)]
    for node in walk(main.body):
        if name := action_name(node):
            assert node.end_lineno is not None
            above: list[str] = []
            for line in reversed(lines[: node.lineno - 1]):
                if not line.strip().startswith("#"):
                    break
                above.insert(0, line.strip())
            _, _, behind = lines[node.end_lineno - 1].partition("  # ")
            found[name] = above, behind
    return found


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
@given(programs, st.integers(0, 2**32))
def test_an_imported_script_is_generated_unchanged(made: tuple[Scene, Project], seed: int) -> None:
    scene, project = made
    source = reformatted(from_logic(scene, project, TYPES), random.Random(seed))
    imported = read_with_text(source, scene, project, TYPES)
    assert replace(imported, script=UNSET) == project, source
    assert from_logic(scene, imported, TYPES) == source
    # A script without edited text is not stored, and stored text does not change without an edit.
    assert read_with_text(source, scene, imported, TYPES) == imported
    plain = from_logic(scene, project, TYPES)
    assert read_with_text(plain, scene, imported, TYPES) == project


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
@given(programs, st.integers(0, 2**32))
@example((SCENE, logic_of(random.Random(13316), 21, 0.0, 0.1, "")), 225)  # exchanged branches would change the logic
def test_comments_survive_an_edit_of_the_logic(made: tuple[Scene, Project], seed: int) -> None:
    scene, project = made
    rng = random.Random(seed)
    source = reformatted(from_logic(scene, project, TYPES), rng)
    imported = read_with_text(source, scene, project, TYPES)
    changed, touched = edited(imported, rng)
    try:
        plain = from_logic(scene, replace(changed, script=UNSET), TYPES)
    except InvalidProject:
        assume(False)  # a program that cannot be built
    back = from_script(plain, scene, changed, TYPES)
    assume(back == changed)
    merged = from_logic(scene, changed, TYPES)
    assert from_script(merged, scene, changed, TYPES) == changed, merged
    before, after = comments_of(source), comments_of(merged)
    assert after.keys() == comments_of(plain).keys()
    for name in after.keys() - touched:
        if name in before:
            above, behind = before[name]
            assert after[name][0][-len(above) :] == above or not above, f"{name}\n{source}\n{merged}"
            assert after[name][1] == behind, f"{name}\n{source}\n{merged}"


# ------------------------------------------------------------------------------------------------ a workplace
PLAIN = Path(__file__).with_name("workplace_script.txt").read_text()
SCAN = '        code = reader.scan(2.5, Mode.TWICE, an="scan code")\n'
TWICE = "mode=M.TWICE, an='scan code')"
BACK = "        robot.move_joints(aps.feeder.joints.above, an="
PICK = '        robot.pick(aps.feeder.poses.default, grip=Grip.FIRM, an="pick")\n'
EDITS = [
    ('"""Main script of the project Sort boards."""', '"""Sorts boards.\n\nWritten by the night shift.\n"""'),
    ("    # Objects of the scene\n    robot: Arm", "    arm: Arm"),
    ("import AcmeReader, Mode", "import AcmeReader, Mode as M"),
    ("import table as tableType\n", "import table as Plate  # heavy\n"),
    ("table: tableType", "table: Plate"),
    ("    boards = 2\n", "    boards = 2  # per hour\n    # As printed on the label.\n"),
    ("        if left == False:\n", "        if not left:  # empty\n"),
    ("            flow.finish(", "            # café ☕\n            flow.finish("),
    (SCAN, f"        code = reader.scan(\n            2.5,  # slow labels\n            {TWICE}\n\n\n"),
    (PICK, PICK.replace("\n", "  # firmly\n")),
    ("        if known == True:\n", "        if known:\n"),
    ("        else:\n", "        # Not in the list.\n        else:  # bad\n"),
    ("\n" + BACK, "            # End of a bad board.\n\n" + BACK.replace("an=", "speed = 1, an=")),
    ("            main(res)\n", "            main(res)  # until it is stopped\n"),
]


def commented(*more: tuple[str, str]) -> str:
    source = PLAIN
    for old, new in [*EDITS, *more]:
        assert source.count(old) == 1, old
        source = source.replace(old, new)
    return re.sub(r"\brobot\.", "arm.", source)


def imported(source: str) -> Project:
    return read_with_text(source, workplace.scene(), workplace.project(), workplace.FACTS)


def generated(project: Project) -> str:
    return from_logic(workplace.scene(), project, workplace.FACTS)


def changed(project: Project, of: str, **fields: object) -> Project:
    """Return the project with changed fields of one action."""
    points = [
        replace(point, actions=[replace(one, **fields) if one.name == of else one for one in point.actions])
        for point in project.action_points
    ]
    return replace(project, action_points=points)


def test_an_edited_parameter_changes_one_statement() -> None:
    source = commented()
    project = imported(source)
    assert generated(project) == source
    scan = next(one for one in project.all_actions() if one.name == "scan code")
    parameters = [replace(one, value="3.0") if one.name == "timeout" else one for one in scan.parameters]
    found = generated(changed(project, "scan code", parameters=parameters))
    old = "        code = reader.scan(\n            2.5,  # slow labels\n            mode=M.TWICE, an='scan code')\n"
    new = '        # slow labels\n        code = reader.scan(3.0, M.TWICE, an="scan code")\n'
    assert found == source.replace(old, new)
    renamed = generated(replace(changed(project, "pick", name="take"), name="Other boards"))
    old, new = (f"{arguments})  # firmly" for arguments in ('grip=Grip.FIRM, an="pick"', '1.0, Grip.FIRM, an="take"'))
    assert renamed == source.replace(old, new)


def test_comments_move_with_actions_and_vanish_with_them() -> None:
    source = commented()
    project = imported(source)
    # Both kinds of boards go to the good box, so the condition and its `else` are removed.
    logic = [item for item in project.logic if item.start != "act_known?" and item.start != "act_throw_away"]
    logic.append(LogicItem("act_known?", "act_into_good_box", id="lit_new"))
    found = generated(replace(project, logic=logic))
    assert "throw away" not in found
    assert not any(text in found for text in ("# Not in the list.", "# bad", "# End of a bad board."))
    for kept in (
        "# café ☕",
        "# slow labels",
        "# firmly",
        "# per hour",
        "# empty",
        "# heavy",
        "Written by the night shift",
    ):
        assert kept in found, found
    # Undo restores them, because the stored text did not change.
    assert generated(project) == source


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('an="finish")\n            continue\n', 'an="finish"); continue  # the end\n'),
        ("        if not left:  # empty\n", "        if (\n            not left  # empty:\n        ):\n"),
        ("        if known:\n", "        if known is True: \\\n            pass\n        if known:\n"),
        ('if __name__ == "__main__":\n', 'if __name__ == "__main__":  # start\n'),
    ],
)
def test_unusual_text_is_kept(old: str, new: str) -> None:
    source = commented((old, new))
    project = imported(source)
    assert generated(project) == source
    renamed = generated(changed(project, "back", name="home"))
    assert 'an="home")' in renamed
    assert "# café ☕" in renamed


def test_a_script_that_cannot_be_merged_is_generated_plainly() -> None:
    project = workplace.project()
    for script in ("def main(:", "print()", PLAIN.replace("    while True:\n", "    while False:\n")):
        assert generated(replace(project, script=script)) == PLAIN
    # A script without its entry point would not run.
    without = PLAIN[: PLAIN.index("if __name__")]
    assert generated(imported(without)).rstrip() == PLAIN.rstrip()
    assert generated(imported(PLAIN.replace("\n", "\r\n"))) == PLAIN
