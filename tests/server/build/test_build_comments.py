"""The comments and the formatting of an edited script survive edits of the logic."""

import ast
import random
import re

from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.project import END, START, Action, Flow, LogicItem, Project
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build.merging.matching import walk
from arcor2_server.build.merging.meaning import action_name
from arcor2_server.build.reading import from_script
from arcor2_server.build.script import from_logic, read_with_text
from tests.server.build.projects import (
    OBJECT,
    SCENE,
    TYPES,
    random_draft,
    with_choices,
    with_comparisons,
    with_exits,
    with_functions,
    with_retries,
    with_variables,
    without_doubles,
)


def reformatted(source: str, rng: random.Random) -> str:
    """Return a script as a person could have written it: with comments, other quotes, line breaks and names."""
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
        what = name[1] if name else f"line {number}"
        if comments:
            lines += [""] * rng.randrange(3) + [f"{indent}#   above {what}:"]
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
            text += f"  # behind {what}"
        lines += f"{indent}{text}".split("\n")
    return "\n".join([*lines, *([""] * rng.randrange(3))])


def program(seed: int, size: int, joining: float, ending: float, conditions: str, functions: int) -> Project:
    rng = random.Random(seed)
    draft = without_doubles(random_draft(rng, size, joining, ending, 3))
    if conditions:
        draft = with_choices(draft, rng) if conditions == "choices" else with_comparisons(draft, rng)
    draft = with_exits(with_retries(with_variables(draft, rng), rng), rng)
    project = draft.project()
    steps = [(item.start, item.end, item.is_error_exit) for item in project.logic]
    assume(len(steps) == len(set(steps)))  # no editor makes two steps from one action to the same one
    return with_functions(project, rng, functions) if functions else project


programs = st.builds(
    program,
    st.integers(0, 2**32),
    st.integers(1, 25),
    st.sampled_from([0.0, 0.2, 0.5]),
    st.sampled_from([0.0, 0.1]),
    st.sampled_from(["", "choices", "comparisons"]),
    st.sampled_from([0, 0, 2]),
)


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
    """Return the comments directly above each action, and the one behind it."""
    lines = source.splitlines()
    found = {}
    [main] = [node for node in ast.parse(source).body if isinstance(node, ast.FunctionDef)]
    for node in walk(main.body):
        if name := action_name(node):
            assert node.end_lineno is not None
            above = []
            for line in reversed(lines[: node.lineno - 1]):
                if not line.strip().startswith("#"):
                    break
                above.insert(0, line.strip())
            _, _, behind = lines[node.end_lineno - 1].partition("  # ")
            found[name] = above, behind
    return found


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
@given(programs, st.integers(0, 2**32))
def test_an_imported_script_is_generated_unchanged(project: Project, seed: int) -> None:
    source = reformatted(from_logic(SCENE, project, TYPES), random.Random(seed))
    imported = read_with_text(source, SCENE, project, TYPES)
    assert replace(imported, script=UNSET) == project, source
    assert from_logic(SCENE, imported, TYPES) == source
    # A script without a person's text is not stored, and stored text does not change without an edit.
    assert read_with_text(source, SCENE, imported, TYPES) == imported
    plain = from_logic(SCENE, project, TYPES)
    assert read_with_text(plain, SCENE, imported, TYPES) == project


@settings(max_examples=70, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
@given(programs, st.integers(0, 2**32))
def test_comments_survive_an_edit_of_the_logic(project: Project, seed: int) -> None:
    rng = random.Random(seed)
    source = reformatted(from_logic(SCENE, project, TYPES), rng)
    imported = read_with_text(source, SCENE, project, TYPES)
    changed, touched = edited(imported, rng)
    try:
        plain = from_logic(SCENE, replace(changed, script=UNSET), TYPES)
    except InvalidProject:
        assume(False)  # a program that cannot be built
    back = from_script(plain, SCENE, changed, TYPES)
    assume(back == changed)
    merged = from_logic(SCENE, changed, TYPES)
    assert from_script(merged, SCENE, changed, TYPES) == changed, merged
    before, after = comments_of(source), comments_of(merged)
    assert after.keys() == comments_of(plain).keys()
    for name in after.keys() - touched:
        if name in before:
            above, behind = before[name]
            assert after[name][0][-len(above) :] == above or not above, f"{name}\n{source}\n{merged}"
            assert after[name][1] == behind, f"{name}\n{source}\n{merged}"
