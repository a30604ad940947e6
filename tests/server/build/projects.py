"""Random projects for the tests of Build, and an interpreter of their logic as reference for generated programs."""

import builtins
import collections
import contextlib
import copy
import itertools
import json
import random
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from operator import eq, ge, gt, le, lt, ne
from typing import Any

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.object_type import ActionMetadata, Again, ObjectAction, ObjectTypeMeta, ParameterMeta
from arcor2_hw.data.project import (
    CALL,
    END,
    START,
    Action,
    ActionParameter,
    ActionPoint,
    Flow,
    LogicComparison,
    LogicItem,
    LogicWhen,
    Match,
    Operator,
    Project,
    ProjectLogicIf,
    ProjectParameter,
    Retry,
    parse_link,
)
from arcor2_hw.data.robot import RobotMeta
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import ERROR_KINDS, Arcor2Error, InvalidProject, NotFound
from arcor2_hw.runtime.program import ActionError
from arcor2_server.build.frame import TypeFacts
from arcor2_server.build.script import from_logic
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.comparisons import (
    OPERATORS,
    RANGES,
    Comparison,
    Comparisons,
    Reference,
    cases_of,
    decoded,
    pair_problem,
)
from arcor2_server.documents.consistency import Inconsistent, check_consistent
from arcor2_server.documents.document import Document
from arcor2_server.documents.functions import NoFunction, make_function
from arcor2_server.documents.parallel_work import make_parallel
from arcor2_server.errors import RequestRefused

OBJECT = "obj_1"
PARAMETERS = [
    ProjectParameter("limit", "integer", "1", id="pco_n"),
    ProjectParameter("ratio", "double", "0.8", id="pco_x"),
    ProjectParameter("enabled", "boolean", "false", id="pco_b"),
    ProjectParameter("label", "string", '"middle"', id="pco_s"),
]
INVERSES = {
    Operator.LESS: Operator.GREATER_EQUAL,
    Operator.GREATER_EQUAL: Operator.LESS,
    Operator.GREATER: Operator.LESS_EQUAL,
    Operator.LESS_EQUAL: Operator.GREATER,
    Operator.EQUAL: Operator.DIFFERENT,
    Operator.DIFFERENT: Operator.EQUAL,
}
EdgeCondition = tuple[str, str, bool | int | str] | None
"""Condition of an edge: the tested action, the name of its output, the value."""
SORTS = ("low", "middle", "high")

DECLARED = {
    "do": ObjectAction("do"),
    "ask": ObjectAction("ask", returns=["boolean"]),
    "count": ObjectAction("count", returns=["integer"]),
    "sort": ObjectAction("sort", returns=["string_enum"]),
    "measure": ObjectAction("measure", returns=["double"], meta=ActionMetadata(again=Again.SAFE)),
    "read": ObjectAction("read", returns=["string"], meta=ActionMetadata(again=Again.SAFE)),
    "ask2": ObjectAction("ask2", returns=["boolean", "boolean"]),
    "tell": ObjectAction("tell", parameters=[ParameterMeta("text", "string")]),
    "use": ObjectAction("use", parameters=[ParameterMeta("flag", "boolean"), ParameterMeta("x", "double")]),
}
TYPES = {"Thing": TypeFacts("object_types.thing", "Thing", DECLARED)}
SCENE = Scene("scene", objects=[SceneObject("thing", "Thing", id=OBJECT)], id="scn_1")


@dataclass
class Draft:
    """A project under construction: actions by name with the names of their results, and the edges between them."""

    actions: dict[str, list[str]] = field(default_factory=dict)
    edges: list[tuple[str, str, EdgeCondition]] = field(default_factory=list)
    links: dict[str, tuple[str, int]] = field(default_factory=dict)
    methods: dict[str, str] = field(default_factory=dict)
    exits: list[tuple[str, str, list[str]]] = field(default_factory=list)
    errors: dict[str, str] = field(default_factory=dict)
    error_parts: dict[str, tuple[str, int]] = field(default_factory=dict)
    retries: dict[str, Retry] = field(default_factory=dict)
    variables: set[str] = field(default_factory=set)
    """The names of the project parameters that actions change."""
    reading: dict[str, str] = field(default_factory=dict)
    """The id of the project parameter that an action uses, by its name."""
    whens: dict[int, LogicWhen] = field(default_factory=dict)
    """Comparisons instead of the condition of an edge, by its number."""

    def action(self, name: str, *results: str) -> "Draft":
        self.actions[name] = list(results)
        return self

    def edge(self, start: str, end: str, condition: EdgeCondition = None) -> "Draft":
        self.edges.append((start, end, condition))
        return self

    def chain(self, *names: str) -> "Draft":
        for name in names:
            if name not in (START, END):
                self.actions.setdefault(name, [])
        for start, end in itertools.pairwise(names):
            self.edge(start, end)
        return self

    def branch(self, name: str, yes: str, no: str) -> "Draft":
        self.actions[name] = self.actions.get(name) or [f"r_{name}"]
        result = self.actions[name][0]
        return self.edge(name, yes, (name, result, True)).edge(name, no, (name, result, False))

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
        if name in self.reading:
            method = "use"
            constant = ActionParameter("flag", "project_parameter", json.dumps(self.reading[name]))
            parameters = [constant, ActionParameter("x", "double", "0.5")]
        if name in self.error_parts:
            source, part = self.error_parts[name]
            method, parameters = "tell", [ActionParameter("text", "link", json.dumps(f"id_{source}/error/{part}"))]
        flows = [Flow(outputs=results)]
        error, retry = self.errors.get(name, UNSET), self.retries.get(name, UNSET)
        return Action(name, f"{OBJECT}/{method}", f"id_{name}", parameters, flows, error, retry)

    def project(self) -> Project:
        logic = []
        for number, (start, end, condition) in enumerate(self.edges):
            when: Any = UNSET
            if condition is not None:
                asked, result, value = condition
                when = ProjectLogicIf(f"id_{asked}/default/{self.actions[asked].index(result)}", json.dumps(value))
            begin = START if start == START else f"id_{start}"
            end = END if end == END else f"id_{end}"
            if number in self.whens:
                logic.append(LogicItem(begin, end, id=f"lit_{number}", when=self.whens[number]))
            else:
                logic.append(LogicItem(begin, end, when, f"lit_{number}"))
        for number, (start, end, kinds) in enumerate(self.exits):
            target = END if end == END else f"id_{end}"
            logic.append(LogicItem(f"id_{start}", target, id=f"exit_{number}", error_kinds=kinds))
        point = ActionPoint("ap", Position(), id="acp_1", actions=[self._action(name) for name in self.actions])
        parameters = [
            replace(one, variable=True) if one.name in self.variables else one
            for one in PARAMETERS
            if self.whens or self.variables
        ]
        return Project("project", "scn_1", id="pro_1", action_points=[point], logic=logic, parameters=parameters)

    def script(self) -> str:
        return from_logic(SCENE, self.project(), TYPES)


class EnoughActions(Exception):
    """The run has covered the requested number of actions."""


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
    """Return the error of the n-th executed action, chosen by the values of an oracle."""
    rng = random.Random(f"{name} {number} {drawn}")
    kinds = sorted(kind for exit_ in exits.get(name, ()) for kind in exit_)
    if not kinds or rng.random() < 0.5:
        return None
    return ERROR_KINDS[rng.choice(kinds)](f"{name} failed")


Oracle = Callable[[str, int], tuple[bool, ...]]
"""Return the results of the n-th action that runs."""


def random_oracle(seed: int) -> Oracle:
    """Return an oracle whose results are random, and the same for the same seed."""

    def results(name: str, number: int) -> tuple[bool, ...]:
        rng = random.Random(f"{seed} {name} {number}")
        return rng.random() < 0.5, rng.random() < 0.5

    return results


def given(method: str, drawn: tuple[bool, ...]) -> tuple[Any, ...]:
    """Return the results of a method, chosen by the values of an oracle."""
    match method:
        case "count":
            return (sum(drawn),)
        case "sort" | "read":
            return (SORTS[sum(drawn)],)
        case "measure":
            return (sum(drawn) * 0.75,)
    return drawn[: len(DECLARED[method].returns)]


def _compared(what: str, results: dict[tuple[str, str], tuple[Any, ...]], variables: dict[str, Any]) -> Any:
    if "/" not in what:
        return variables[what]
    source, flow, output = parse_link(what)
    return results[source, flow][output]


def _met(one: LogicComparison, value: Any, *others: Any) -> bool:
    limit = others[0] if others else json.loads(one.value)
    if isinstance(one.upper, str):
        upper = json.loads(one.upper)
        above = limit <= value if one.operator[0] == "[" else limit < value
        return above and (value <= upper if one.operator[1] == "]" else value < upper)
    tests = {"==": eq, "!=": ne, "<": lt, "<=": le, ">": gt, ">=": ge}
    return bool(tests[one.operator](value, limit))


def walk(project: Project, oracle: Oracle, count: int) -> list[tuple[str, tuple[Any, ...]]]:
    """Interpret the logic item by item, and return the executed actions with their linked values."""
    actions = {action.id: action for point in project.action_points for action in point.actions}
    exits = exits_of(project)
    done: list[tuple[str, tuple[Any, ...]]] = []
    variables = {parameter.id: json.loads(parameter.value) for parameter in project.parameters}
    stored = {parameter.name: parameter.id for parameter in project.parameters if parameter.variable}
    while True:
        results: dict[tuple[str, str], tuple[Any, ...]] = {}
        at = next(item.end for item in project.logic if item.start == START)
        attempts = 0
        while at != END:
            if len(done) == count:
                return done
            action = actions[at]
            values = []
            for parameter in action.parameters:
                if parameter.type == "link":
                    source, flow, output = parse_link(json.loads(parameter.value))
                    values.append(results[source, flow][output])
                elif parameter.type == "project_parameter":
                    values.append(variables[json.loads(parameter.value)])
                else:
                    values.append(json.loads(parameter.value))
            drawn = oracle(action.name, len(done))
            error = failure(exits, action.name, len(done), drawn)
            done.append((action.name, tuple(values)))
            attempts += 1
            if error is not None and isinstance(action.retry, Retry) and attempts <= action.retry.count:
                continue
            attempts = 0
            if error is not None:
                results[at, "error"] = ("thing", error.code, str(error))
                at = next(i.end for i in project.logic if i.start == at and error.code in (i.error_kinds or ()))
                continue
            results[at, "default"] = given(action.parse_type()[1], drawn)
            for output, value in zip(action.outputs(), results[at, "default"], strict=False):
                if output in stored:
                    variables[stored[output]] = value
            edges = [item for item in project.logic if item.start == at and not item.error_kinds]
            # The step without a condition is taken if no condition holds, whatever its position.
            edges.sort(key=lambda edge: not edge.has_condition)
            while len(edges) > 1 and edges[-2].end == edges[-1].end:
                edges.pop(-2)
            for item in edges:
                if isinstance(item.condition, ProjectLogicIf) and item is not edges[-1]:
                    source, _, output = parse_link(item.condition.what)
                    if results[source, "default"][output] != json.loads(item.condition.value):
                        continue
                if isinstance(item.when, LogicWhen) and item is not edges[-1]:
                    comparisons = item.when.comparisons
                    met = [_met(o, *(_compared(w, results, variables) for w in o.compared())) for o in comparisons]
                    if not (all(met) if item.when.match == "all" else any(met)):
                        continue
                at = item.end
                break
            else:
                raise AssertionError(f"nothing follows {at}")


class _Retrying:
    def __init__(self, thing: "_Thing", count: int, pause: float = 0.0) -> None:
        self._thing, self._count = thing, count

    def __getattr__(self, method: str) -> Callable[..., Any]:
        def call(*arguments: Any, an: str) -> Any:
            for _ in range(self._count):
                with contextlib.suppress(Arcor2Error):
                    return getattr(self._thing, method)(*arguments, an=an)
            return getattr(self._thing, method)(*arguments, an=an)

        return call


class _Thing:
    def __init__(self, oracle: Oracle, count: int, exits: Exits) -> None:
        self.done: list[tuple[str, tuple[Any, ...]]] = []
        self._oracle, self._count, self._exits = oracle, count, exits

    def __getattr__(self, method: str) -> Callable[..., Any]:
        def call(*arguments: Any, an: str) -> Any:
            if len(self.done) == self._count:
                raise EnoughActions
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
        names["main"](
            types.SimpleNamespace(
                objects=collections.defaultdict(lambda: thing),
                caught=caught,
                retry=_Retrying,
                function=lambda body: body,
                parallel=lambda *calls, an: tuple(call() for call in calls),
            )
        )
    except EnoughActions:
        return thing.done
    raise AssertionError("a generated program must not end by itself")


def same_runs(draft: Draft, oracle: Oracle, count: int) -> None:
    """Assert that the generated program executes the same actions as the interpreted logic."""
    project = draft.project()
    source = from_logic(SCENE, project, TYPES)
    assert run(source, oracle, count, exits_of(project)) == walk(project, oracle, count), source


def random_draft(rng: random.Random, size: int, merging: float, end_rate: float, window: int) -> Draft:
    """Create a random graph without loops: each action leads to one, two or three others, mostly near ones."""
    draft = Draft()
    names = [f"a{n}" for n in range(size)]
    # For each action, the actions that always run before it: the program may use their results.
    always: dict[int, set[int]] = {0: {0}}
    results: dict[int, int] = {n: rng.choice((0, 1, 1, 1, 2)) for n in range(size)}
    for n in range(size):
        draft.action(names[n], *[f"r{k}_{n}" for k in range(results[n])])
    draft.edge(START, names[0])
    fresh = 1
    for n in range(size):
        if n not in always:
            continue

        def target(n: int = n) -> int:
            nonlocal fresh
            if rng.random() < end_rate or n == size - 1:
                return size
            known = [t for t in always if t > n]
            if known and rng.random() < merging:
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
            edge = None if condition is None else (names[condition[0]], f"r{condition[1]}_{condition[0]}", condition[2])
            draft.edge(names[n], names[end] if end < size else END, edge)
            if end < size:
                always[end] = (always[end] & always[n] if end in always else always[n]) | {end}
    for n in sorted(always):
        sources = [a for a in sorted(always[n]) if results[a] and a != n]
        if not results[n] and sources and rng.random() < 0.5:
            source = rng.choice(sources)
            draft.links[names[n]] = (names[source], rng.randrange(results[source]))
    return draft


def without_doubles(draft: Draft) -> Draft:
    """Merge all edges between the same two actions, because no editor creates several."""
    ends: dict[str, set[str]] = {}
    for start, end, _ in draft.edges:
        ends.setdefault(start, set()).add(end)
    edges: list[tuple[str, str, EdgeCondition]] = []
    for start, end, condition in draft.edges:
        if len(ends[start]) > 1:
            edges.append((start, end, condition))
        elif (start, end, None) not in edges:
            edges.append((start, end, None))
    draft.edges = edges
    return draft


def with_choices(draft: Draft, rng: random.Random) -> Draft:
    """Replace branches on booleans by branches on numbers and texts with an else, where possible."""
    linked = {source for source, _ in draft.links.values()}
    choices = {name for name, results in draft.actions.items() if len(results) == 1} - linked
    groups: dict[str, list[int]] = {}
    for number, (start, _, condition) in enumerate(draft.edges):
        if condition is not None:
            groups.setdefault(start, []).append(number)
    asked = {start: {draft.edges[n][2][0] for n in numbers} for start, numbers in groups.items()}  # type: ignore[index]
    while lost := {name for names in asked.values() if not names <= choices for name in names & choices}:
        choices -= lost
    values = {name: rng.choice((("count", 0, 1), ("count", 2, 1), ("sort", *SORTS[:2]))) for name in sorted(choices)}
    draft.methods |= {name: kind for name, (kind, *_) in values.items()}
    for numbers in groups.values():
        for number in numbers:
            start, end, condition = draft.edges[number]
            assert condition is not None
            if condition[0] in choices:
                value = values[condition[0]][1 + bool(condition[2])]
                draft.edges[number] = (start, end, None if number == numbers[-1] else (*condition[:2], value))
    if rng.random() < 0.5:
        # The position of the step without a condition among the others must not matter.
        draft.edges.sort(key=lambda edge: edge[2] is not None)
    return draft


LIMITS: dict[str, tuple[Any, ...]] = {
    "boolean": (True, False),
    "integer": (-1, 0, 1, 2, 3),
    "double": (-0.5, 0, 0.75, 0.8, 1.5, 2),
    "string": (*SORTS, "other"),
}
METHODS = {"count": "integer", "measure": "double", "read": "string", "ask": "boolean"}


def _comparison(rng: random.Random, what: str, kinds: dict[str, str]) -> LogicComparison:
    kind = kinds[what]
    limits = LIMITS[kind]
    operators = [one for one in Operator if one not in RANGES]
    pairs = [(o, other) for o in operators for other in kinds if other != what]
    pairs = [(o, other) for o, other in pairs if pair_problem(what, kind, o, other, kinds[other]) is None]
    if pairs and rng.random() < 0.25:
        operator, other = rng.choice(pairs)
        return LogicComparison(what, operator, other=other)
    if kind in ("integer", "double") and rng.random() < 0.3:
        lower, upper = sorted(rng.sample(limits, 2))
        closed = Operator.CLOSED if upper - lower <= 1 else rng.choice(list(RANGES))
        return LogicComparison(what, closed, json.dumps(lower), json.dumps(upper))
    operator = rng.choice([one for one in OPERATORS[kind] if one not in RANGES])
    return LogicComparison(what, operator, json.dumps(rng.choice(limits)))


def _numbered(one: LogicComparison, numbers: dict[str, Reference]) -> Comparison:
    what, *others = (numbers[each] for each in one.compared())
    return Comparison(what, one.operator, *decoded(one), *others)


def _proven(whens: list[LogicWhen], kinds: dict[str, str], *, otherwise: bool) -> bool:
    """Return whether Build accepts these conditions, tested in order."""
    numbers = {what: Reference(number, 0) for number, what in enumerate(kinds)}
    tests = [Comparisons(tuple(_numbered(one, numbers) for one in when.comparisons), when.match) for when in whens]
    if any(len(set(test.comparisons)) != len(test.comparisons) for test in tests):
        return False
    cases = cases_of(tests, {numbers[what]: kind for what, kind in kinds.items()})
    return cases.known and not cases.unused and (cases.gap is not None) == otherwise


def with_comparisons(draft: Draft, rng: random.Random) -> Draft:
    """Replace branches on booleans by branches on comparisons of several results and project parameters."""
    linked = {source for source, _ in draft.links.values()}
    draft.methods |= {
        name: rng.choice(list(METHODS))
        for name, results in draft.actions.items()
        if len(results) == 1 and name not in linked
    }
    groups: dict[str, list[int]] = {}
    for number, (start, _, condition) in enumerate(draft.edges):
        if condition is not None:
            groups.setdefault(start, []).append(number)
    for numbers in groups.values():
        kinds = {one.id: one.type for one in PARAMETERS}
        for number in numbers:
            asked, result, _ = draft.edges[number][2]  # type: ignore[misc]
            link = f"id_{asked}/default/{draft.actions[asked].index(result)}"
            kinds[link] = METHODS.get(draft.methods.get(asked, ""), "boolean")
        for attempt in range(12):
            otherwise = rng.random() < 0.6
            whens = [
                LogicWhen(
                    [_comparison(rng, what, kinds) for what in rng.choices(list(kinds), k=count)],
                    rng.choice(list(Match)) if count > 1 else Match.ALL,
                )
                for _ in numbers[otherwise:]
                for count in [rng.choice((1, 1, 2, 3))]
            ]
            if not otherwise and len(whens) == 2 and attempt > 3:
                [one, *_] = whens[0].comparisons
                if kinds[one.what] in ("integer", "string") and (opposite := INVERSES.get(one.operator)):
                    whens = [LogicWhen([one]), LogicWhen([replace(one, operator=opposite)])]
            if _proven(whens, kinds, otherwise=otherwise):
                break
        else:
            otherwise = True
            whens = [LogicWhen([LogicComparison("pco_n", Operator.EQUAL, str(n))]) for n, _ in enumerate(numbers[1:])]
        rng.shuffle(numbers)
        for number in numbers:
            draft.edges[number] = (*draft.edges[number][:2], None)
        for number, when in zip(sorted(numbers[: len(whens)]), whens, strict=True):
            draft.whens[number] = when
    return draft


def with_variables(draft: Draft, rng: random.Random) -> Draft:
    """Store otherwise unused results in variables, and use these as parameters."""
    used = {source for source, _ in draft.links.values()}
    used |= {condition[0] for _, _, condition in draft.edges if condition is not None}
    for when in draft.whens.values():
        compared = {what for one in when.comparisons for what in one.compared() if "/" in what}
        used |= {parse_link(what)[0].removeprefix("id_") for what in compared}
    kinds = {one.type: one for one in PARAMETERS}
    for name, results in draft.actions.items():
        if len(results) == 1 and name not in used and rng.random() < 0.6:
            method = draft.methods.setdefault(name, rng.choice(list(METHODS)))
            if method in METHODS:
                draft.actions[name] = [kinds[METHODS[method]].name]
                draft.variables.add(kinds[METHODS[method]].name)
        elif not results and name not in draft.links and rng.random() < 0.3:
            draft.reading[name] = "pco_b"
    if draft.reading:
        draft.variables.add("enabled")
    return draft


def with_retries(draft: Draft, rng: random.Random) -> Draft:
    """Retry some of the actions that are safe to repeat."""
    for name, method in draft.methods.items():
        if DECLARED[method].meta.again == Again.SAFE and rng.random() < 0.6:
            draft.retries[name] = Retry(rng.randint(1, 3), rng.choice((0.0, 0.5)))
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
                added.exit(name, handler, *chosen).edge(handler, end)
                if rng.random() < 0.7:
                    added.errors[name] = f"e_{name}"
                    added.error_parts[handler] = (name, rng.randrange(3))
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
    """The object types of the drafts, or others, as the consistency check needs them."""

    def __init__(self, facts: Mapping[str, TypeFacts] = TYPES) -> None:
        self._facts = facts

    def meta(self, name: str) -> ObjectTypeMeta:
        return ObjectTypeMeta(name)

    def action(self, type_name: str, name: str) -> ObjectAction:
        return self._facts[type_name].actions[name]

    def robot_meta(self, name: str) -> RobotMeta:
        raise NotFound(f"{name} is not a robot")


def with_functions(project: Project, rng: random.Random, count: int) -> Project:
    """Create functions from random consecutive actions of the program or of a function, if possible.

    The program then does the same, except for an error that no exit handles.
    """
    document = Document.of(SCENE, project)
    for number in range(count):
        scope = rng.choice(["", *(item.id for item in document.of_kind(Kind.FUNCTION))])
        items = document.owned(scope, Kind.LOGIC) if scope else document.program_logic()
        following: dict[str, list[str]] = {}
        for item in items:
            following.setdefault(item.value.start, []).append(item.value.end)
        places = [place for place in following if place != START]
        if not places:
            continue
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


def with_parallel_work(project: Project, rng: random.Random) -> tuple[Scene, Project]:
    """Run pairs of consecutive actions in parallel, each in a function with its own device.

    Return the project, and its scene with these devices.
    """
    document = Document.of(SCENE, project)
    devices: list[SceneObject] = []
    separate: set[str] = set()
    """The functions that run in parallel or contain parallel work, also through calls."""
    scopes = ["", *(item.id for item in document.of_kind(Kind.FUNCTION))]
    for number in range(24):
        scope = rng.choice(scopes)
        steps = [item.value for item in (document.owned(scope, Kind.LOGIC) if scope else document.program_logic())]
        steps = [one for one in steps if one.start != START and one.end != END]
        if scope in separate or not steps:
            continue
        step = rng.choice(steps)
        trial = Document.of(SCENE, document.project)
        calls = []
        try:
            for place, key in enumerate((step.start, step.end)):
                changes, _, call = make_function(trial, TypesOfTests(), f"b{number}{place}", [key])
                trial.apply(changes)
                calls.append(call)
            changes, _ = make_parallel(trial, f"both {number}", calls)
            check_consistent(trial, changes, TypesOfTests())
        except (RequestRefused, Inconsistent):
            continue
        trial.apply(changes)
        inside = [list(_inner(trial, trial.action(key).type.partition("/")[0])) for key in calls]
        if any(function in separate for functions in inside for function in functions):
            continue
        document = trial
        for place, functions in enumerate(inside):
            device = f"thing_{number}_{place}"
            devices.append(SceneObject(device, "Thing", id=device))
            for action in [item.value for one in functions for item in document.owned(one, Kind.ACTION)]:
                key, _, method = action.type.partition("/")
                if key == OBJECT:
                    moved = replace(action, type=f"{device}/{method}")
                    document.apply([document.update(Kind.ACTION, action.id, moved)])
            separate.update(functions)
        separate.update({scope} - {""})
    changed = document.project
    assert changed is not None
    return replace(SCENE, objects=[*SCENE.objects, *devices]), changed


def _inner(document: Document, function_id: str) -> Iterator[str]:
    """Return a function and the functions that it calls."""
    yield function_id
    for item in document.owned(function_id, Kind.ACTION):
        key, _, method = item.value.type.partition("/")
        if method == CALL:
            yield from _inner(document, key)
