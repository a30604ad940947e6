"""Projects made for the tests of Build, and a direct walk through a project's logic to compare programs with."""

import builtins
import copy
import itertools
import json
import random
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.object_type import ObjectAction, ObjectTypeMeta, ParameterMeta
from arcor2_hw.data.project import (
    END,
    START,
    Action,
    ActionParameter,
    ActionPoint,
    Flow,
    LogicItem,
    Project,
    ProjectLogicIf,
    parse_link,
)
from arcor2_hw.data.robot import RobotMeta
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import ERROR_KINDS, Arcor2Error, InvalidProject, NotFound
from arcor2_hw.runtime.program import ActionError
from arcor2_server.build.frame import TypeFacts
from arcor2_server.build.script import from_logic
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.consistency import check_consistent
from arcor2_server.documents.document import Document
from arcor2_server.documents.functions import NoFunction, make_function

OBJECT = "obj_1"
Way = tuple[str, str, bool | int | str] | None
"""Condition: the action asked, its output's name, the value."""
SORTS = ("low", "middle", "high")

DECLARED = {
    "do": ObjectAction("do"),
    "ask": ObjectAction("ask", returns=["boolean"]),
    "count": ObjectAction("count", returns=["integer"]),
    "sort": ObjectAction("sort", returns=["string_enum"]),
    "ask2": ObjectAction("ask2", returns=["boolean", "boolean"]),
    "tell": ObjectAction("tell", parameters=[ParameterMeta("text", "string")]),
    "use": ObjectAction("use", parameters=[ParameterMeta("flag", "boolean"), ParameterMeta("x", "double")]),
}
TYPES = {"Thing": TypeFacts("object_types.thing", "Thing", DECLARED)}
SCENE = Scene("scene", objects=[SceneObject("thing", "Thing", id=OBJECT)], id="scn_1")


@dataclass
class Draft:
    """A project in the making: actions by name with the names of their results, and ways between them."""

    actions: dict[str, list[str]] = field(default_factory=dict)
    ways: list[tuple[str, str, Way]] = field(default_factory=list)
    links: dict[str, tuple[str, int]] = field(default_factory=dict)
    methods: dict[str, str] = field(default_factory=dict)
    exits: list[tuple[str, str, list[str]]] = field(default_factory=list)
    errors: dict[str, str] = field(default_factory=dict)
    told: dict[str, tuple[str, int]] = field(default_factory=dict)

    def action(self, name: str, *results: str) -> "Draft":
        self.actions[name] = list(results)
        return self

    def way(self, start: str, end: str, condition: Way = None) -> "Draft":
        self.ways.append((start, end, condition))
        return self

    def chain(self, *names: str) -> "Draft":
        for name in names:
            if name not in (START, END):
                self.actions.setdefault(name, [])
        for start, end in itertools.pairwise(names):
            self.way(start, end)
        return self

    def branch(self, name: str, yes: str, no: str) -> "Draft":
        self.actions[name] = self.actions.get(name) or [f"r_{name}"]
        result = self.actions[name][0]
        return self.way(name, yes, (name, result, True)).way(name, no, (name, result, False))

    def exit(self, start: str, end: str, *kinds: str) -> "Draft":
        self.exits.append((start, end, list(kinds)))
        return self

    def _action(self, name: str) -> Action:
        results = self.actions[name]
        method = self.methods.get(name) or ("do", "ask", "ask2")[len(results)]
        parameters = []
        if name in self.links:
            source, output = self.links[name]
            method = "use"
            link = ActionParameter("flag", "link", json.dumps(f"id_{source}/default/{output}"))
            parameters = [link, ActionParameter("x", "double", "0.5")]
        if name in self.told:
            source, part = self.told[name]
            method, parameters = "tell", [ActionParameter("text", "link", json.dumps(f"id_{source}/error/{part}"))]
        flows = [Flow(outputs=results)]
        return Action(name, f"{OBJECT}/{method}", f"id_{name}", parameters, flows, self.errors.get(name, UNSET))

    def project(self) -> Project:
        logic = []
        for number, (start, end, condition) in enumerate(self.ways):
            when: Any = UNSET
            if condition is not None:
                asked, result, value = condition
                when = ProjectLogicIf(f"id_{asked}/default/{self.actions[asked].index(result)}", json.dumps(value))
            begin = START if start == START else f"id_{start}"
            logic.append(LogicItem(begin, END if end == END else f"id_{end}", when, f"lit_{number}"))
        for number, (start, end, kinds) in enumerate(self.exits):
            target = END if end == END else f"id_{end}"
            logic.append(LogicItem(f"id_{start}", target, id=f"exit_{number}", error_kinds=kinds))
        point = ActionPoint("ap", Position(), id="acp_1", actions=[self._action(name) for name in self.actions])
        return Project("project", "scn_1", id="pro_1", action_points=[point], logic=logic)

    def script(self) -> str:
        return from_logic(SCENE, self.project(), TYPES)


class Enough(Exception):
    """The run has shown what it was to show."""


Exits = dict[str, list[list[str]]]
"""The kinds of the error exits of actions, by name."""


def exits_of(project: Project) -> Exits:
    names = {action.id: action.name for action in project.all_actions()}
    found: Exits = {}
    for item in (*project.logic, *(item for function in project.functions for item in function.logic)):
        if item.error_kinds:
            found.setdefault(names[item.start], []).append(item.error_kinds)
    return found


def failure(exits: Exits, name: str, number: int, drawn: tuple[bool, ...]) -> Arcor2Error | None:
    """Give the error of the n-th action that runs, for what an oracle draws."""
    rng = random.Random(f"{name} {number} {drawn}")
    kinds = sorted(kind for exit_ in exits.get(name, ()) for kind in exit_)
    if not kinds or rng.random() < 0.5:
        return None
    return ERROR_KINDS[rng.choice(kinds)](f"{name} failed")


Oracle = Callable[[str, int], tuple[bool, ...]]
"""Gives the results of the n-th action that runs."""


def given(method: str, drawn: tuple[bool, ...]) -> tuple[Any, ...]:
    """Give the results of a method for what an oracle draws."""
    match method:
        case "count":
            return (sum(drawn),)
        case "sort":
            return (SORTS[sum(drawn)],)
    return drawn[: len(DECLARED[method].returns)]


def walk(project: Project, oracle: Oracle, count: int) -> list[tuple[str, tuple[Any, ...]]]:
    """Follow the logic item by item, without any notion of blocks; gives what runs with which linked values."""
    actions = {action.id: action for point in project.action_points for action in point.actions}
    exits = exits_of(project)
    done: list[tuple[str, tuple[Any, ...]]] = []
    while True:
        results: dict[tuple[str, str], tuple[Any, ...]] = {}
        at = next(item.end for item in project.logic if item.start == START)
        while at != END:
            if len(done) == count:
                return done
            action = actions[at]
            values = []
            for parameter in action.parameters:
                if parameter.type == "link":
                    source, flow, output = parse_link(json.loads(parameter.value))
                    values.append(results[source, flow][output])
                else:
                    values.append(json.loads(parameter.value))
            drawn = oracle(action.name, len(done))
            error = failure(exits, action.name, len(done), drawn)
            done.append((action.name, tuple(values)))
            if error is not None:
                results[at, "error"] = ("thing", error.code, str(error))
                at = next(i.end for i in project.logic if i.start == at and error.code in (i.error_kinds or ()))
                continue
            results[at, "default"] = given(action.parse_type()[1], drawn)
            ways = [item for item in project.logic if item.start == at and not item.error_kinds]
            # The one without a condition is for when none holds, wherever it stands.
            ways.sort(key=lambda way: not isinstance(way.condition, ProjectLogicIf))
            while len(ways) > 1 and ways[-2].end == ways[-1].end:
                ways.pop(-2)
            for item in ways:
                if isinstance(item.condition, ProjectLogicIf) and item is not ways[-1]:
                    source, _, output = parse_link(item.condition.what)
                    if results[source, "default"][output] != json.loads(item.condition.value):
                        continue
                at = item.end
                break
            else:
                raise AssertionError(f"nothing follows {at}")


class _Thing:
    def __init__(self, oracle: Oracle, count: int, exits: Exits) -> None:
        self.done: list[tuple[str, tuple[Any, ...]]] = []
        self._oracle, self._count, self._exits = oracle, count, exits

    def __getattr__(self, method: str) -> Callable[..., Any]:
        def call(*arguments: Any, an: str) -> Any:
            if len(self.done) == self._count:
                raise Enough
            drawn = self._oracle(an, len(self.done))
            error = failure(self._exits, an, len(self.done), drawn)
            self.done.append((an, arguments))
            if error is not None:
                raise error
            results = given(method, drawn)
            return None if not results else results[0] if len(results) == 1 else results

        return call


def run(source: str, oracle: Oracle, count: int, exits: Exits | None = None) -> list[tuple[str, tuple[Any, ...]]]:
    """Run a generated script with a recording object in place of the device, for `count` actions."""
    thing = _Thing(oracle, count, exits or {})
    stub = types.SimpleNamespace(
        ActionPoints=lambda res: None, Resources=None, print_exception=None, Thing=_Thing, thing=None
    )
    vars(stub).update({kind.__name__: kind for kind in ERROR_KINDS.values()})
    names: dict[str, Any] = {
        "__builtins__": {**vars(builtins), "__import__": lambda *_, **__: stub},
        "__name__": "script",
    }
    exec(compile(source, "script.py", "exec"), names)
    try:
        caught = lambda error: ActionError("thing", error.code, str(error))  # noqa: E731
        names["main"](types.SimpleNamespace(objects={OBJECT: thing}, caught=caught, function=lambda body: body))
    except Enough:
        return thing.done
    raise AssertionError("a generated program must not end by itself")


def same_runs(draft: Draft, oracle: Oracle, count: int) -> None:
    """Compare the program with the logic."""
    project = draft.project()
    source = from_logic(SCENE, project, TYPES)
    assert run(source, oracle, count, exits_of(project)) == walk(project, oracle, count), source


def random_draft(rng: random.Random, size: int, joining: float, ending: float, window: int) -> Draft:
    """Draw a graph without loops: each action goes on to one, two or three others, near ones rather than far ones."""
    draft = Draft()
    names = [f"a{n}" for n in range(size)]
    # Which actions always run before another one: the sets are what the program may rely on.
    always: dict[int, set[int]] = {0: {0}}
    results: dict[int, int] = {n: rng.choice((0, 1, 1, 1, 2)) for n in range(size)}
    for n in range(size):
        draft.action(names[n], *[f"r{k}_{n}" for k in range(results[n])])
    draft.way(START, names[0])
    fresh = 1
    for n in range(size):
        if n not in always:
            continue

        def target(n: int = n) -> int:
            nonlocal fresh
            if rng.random() < ending or n == size - 1:
                return size
            known = [t for t in always if t > n]
            if known and rng.random() < joining:
                return rng.choice(sorted(known)[:window])
            fresh = max(fresh, n + 1)
            if fresh >= size:
                return size
            fresh += 1
            return fresh - 1

        sources = sorted(a for a in always[n] if results[a])
        if sources and rng.random() < 0.6:
            asked = n if results[n] and rng.random() < 0.7 else rng.choice(sources)
            output = rng.randrange(results[asked])
            conditions: list[tuple[int, int, bool] | None] = [(asked, output, True), (asked, output, False)]
            rng.shuffle(conditions)
            others = [(s, k) for s in sources for k in range(results[s]) if (s, k) != (asked, output)]
            if others and rng.random() < 0.3:
                conditions.insert(rng.randrange(2), (*rng.choice(others), rng.random() < 0.5))
        else:
            conditions = []
        for condition in conditions or [None]:
            end = target()
            way = None if condition is None else (names[condition[0]], f"r{condition[1]}_{condition[0]}", condition[2])
            draft.way(names[n], names[end] if end < size else END, way)
            if end < size:
                always[end] = (always[end] & always[n] if end in always else always[n]) | {end}
    for n in sorted(always):
        sources = [a for a in sorted(always[n]) if results[a] and a != n]
        if not results[n] and sources and rng.random() < 0.5:
            source = rng.choice(sources)
            draft.links[names[n]] = (names[source], rng.randrange(results[source]))
    return draft


def without_doubles(draft: Draft) -> Draft:
    """Make one way of all the ways from one action to the same one, which no editor makes."""
    ends: dict[str, set[str]] = {}
    for start, end, _ in draft.ways:
        ends.setdefault(start, set()).add(end)
    ways: list[tuple[str, str, Way]] = []
    for start, end, condition in draft.ways:
        if len(ends[start]) > 1:
            ways.append((start, end, condition))
        elif (start, end, None) not in ways:
            ways.append((start, end, None))
    draft.ways = ways
    return draft


def with_choices(draft: Draft, rng: random.Random) -> Draft:
    """Turn branchings on truth values into branchings on numbers and texts with an else, wherever that can be."""
    linked = {source for source, _ in draft.links.values()}
    choices = {name for name, results in draft.actions.items() if len(results) == 1} - linked
    groups: dict[str, list[int]] = {}
    for number, (start, _, condition) in enumerate(draft.ways):
        if condition is not None:
            groups.setdefault(start, []).append(number)
    asked = {start: {draft.ways[n][2][0] for n in numbers} for start, numbers in groups.items()}  # type: ignore[index]
    while lost := {name for names in asked.values() if not names <= choices for name in names & choices}:
        choices -= lost
    values = {name: rng.choice((("count", 0, 1), ("count", 2, 1), ("sort", *SORTS[:2]))) for name in sorted(choices)}
    draft.methods |= {name: kind for name, (kind, *_) in values.items()}
    for numbers in groups.values():
        for number in numbers:
            start, end, condition = draft.ways[number]
            assert condition is not None
            if condition[0] in choices:
                value = values[condition[0]][1 + bool(condition[2])]
                draft.ways[number] = (start, end, None if number == numbers[-1] else (*condition[:2], value))
    if rng.random() < 0.5:
        # Where the way without a condition stands among the others makes no difference.
        draft.ways.sort(key=lambda way: way[2] is not None)
    return draft


def with_exits(draft: Draft, rng: random.Random) -> Draft:
    """Add error exits, and actions that use the error, where the results that actions use stay set on all paths."""
    names = [name for name in draft.actions if name != START]
    order = {name: number for number, name in enumerate(names)}
    kinds = list(ERROR_KINDS)
    for name in names:
        free = rng.sample(kinds[:-1], 3) + kinds[-1:]
        for number in range(rng.choice((0, 0, 1, 1, 2))):
            added = copy.deepcopy(draft)
            chosen = [free.pop()] if rng.random() < 0.3 else [free.pop(0)]
            if chosen[0] != "error" and len(free) > 1 and rng.random() < 0.4:
                chosen.append(free.pop(0))
            chosen.sort(key=kinds.index)
            later = [one for one in names if order[one] > order[name]]
            end = rng.choice([END, *later[:3]])
            if rng.random() < 0.6:
                handler = f"h{number}_{name}"
                added.action(handler)
                added.exit(name, handler, *chosen).way(handler, end)
                if rng.random() < 0.7:
                    added.errors[name] = f"e_{name}"
                    added.told[handler] = (name, rng.randrange(3))
            else:
                added.exit(name, end, *chosen)
            exits = [(start, target) for start, target, _ in added.exits]
            try:
                if len(exits) == len(set(exits)):
                    added.script()
                    draft = added
            except InvalidProject:
                pass
    return draft


# ------------------------------------------------------------------------------------------------ functions
class TypesOfTests:
    """The object types of the drafts, or others, as the checks of documents see them."""

    def __init__(self, facts: Mapping[str, TypeFacts] = TYPES) -> None:
        self._facts = facts

    def meta(self, name: str) -> ObjectTypeMeta:
        return ObjectTypeMeta(name)

    def action(self, type_name: str, name: str) -> ObjectAction:
        return self._facts[type_name].actions[name]

    def robot_meta(self, name: str) -> RobotMeta:
        raise NotFound(f"{name} is no robot")


def with_functions(project: Project, rng: random.Random, count: int) -> Project:
    """Make functions of random actions that follow each other, of the program or of a function, where that is possible.

    The program does the same afterwards, but for an error that no exit handles.
    """
    document = Document.of(SCENE, project)
    for number in range(count):
        scope = rng.choice(["", *(item.id for item in document.of_kind(Kind.FUNCTION))])
        items = document.owned(scope, Kind.LOGIC) if scope else document.program_logic()
        following: dict[str, list[str]] = {}
        for item in items:
            following.setdefault(item.value.start, []).append(item.value.end)
        places = [place for place in following if place != START]
        selected = [rng.choice(places)]
        for _ in range(rng.randrange(8)):
            near = [end for place in selected for end in following.get(place, ()) if end not in (END, *selected)]
            if not near:
                break
            selected.append(rng.choice(near))
        try:
            changes, _, _ = make_function(document, TypesOfTests(), f"f{number}", selected)
        except NoFunction:
            continue
        check_consistent(document, changes, TypesOfTests())
        document.apply(changes)
    changed = document.project
    assert changed is not None
    return changed
