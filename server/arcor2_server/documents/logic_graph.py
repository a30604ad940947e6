"""The logic of a project as a graph: the successors of each action and their conditions."""

import itertools
import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple, TypeGuard

from arcor2_hw.data.base import Unset
from arcor2_hw.data.project import (
    CALL,
    END,
    MAX_BRANCHES,
    MIN_BRANCHES,
    START,
    Action,
    LogicItem,
    LogicWhen,
    Match,
    Operator,
    Project,
    ProjectFunction,
    ProjectLogicIf,
    parse_link,
)
from arcor2_hw.exceptions import ERROR_KINDS, Arcor2Error, InvalidData, InvalidProject
from arcor2_hw.messages import Message
from arcor2_server.documents.comparisons import Comparison, Comparisons, Reference, decoded, what_of

END_NODE: Final = -1
"""Number that represents END; actions have numbers from 0."""

BRANCHABLE: Final[dict[str, type]] = {"boolean": bool, "integer": int, "integer_enum": int, "string_enum": str}
"""The types of results that conditions can test, with the type of the compared value (docs/protocol.md)."""


class Condition(NamedTuple):
    """True if result number `output` of action number `action` equals `value`."""

    action: int
    output: int
    value: bool | int | str


Test = Condition | Comparisons
"""A condition of an edge."""


def as_comparisons(test: Test) -> Comparisons:
    """Return a condition as comparisons."""
    if isinstance(test, Comparisons):
        return test
    return Comparisons((Comparison(Reference(test.action, test.output), Operator.EQUAL, test.value),))


class Edge(NamedTuple):
    """A connection to action number `target` (or END_NODE). Without a condition it is the only or the default one."""

    target: int
    condition: Test | None


class ErrorExit(NamedTuple):
    """A connection to action number `target` (or END_NODE) for errors of some kinds."""

    target: int
    kinds: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Flow:
    """The reachable actions in topological order: every edge leads to a higher number, 0 is the first.

    `edges[n]` is one unconditional edge, or several that are tested in order. The last one applies if no other does.
    Whether edges with comparisons are complete is not checked, because this depends on the types of the values.
    `exits[n]` are the error exits in the order in which they apply. `parallel[n]` are the calls that action `n`
    runs concurrently. Edges lead from the action to its first call, from each call to the next one, and from the
    last call to the successor of the action, so their results are set where the action has succeeded.
    """

    actions: list[Action]
    edges: list[tuple[Edge, ...]]
    exits: list[tuple[ErrorExit, ...]]
    parallel: dict[int, tuple[int, ...]] = field(default_factory=dict)


def _node(reference: str, item: LogicItem, known: dict[str, int]) -> int:
    action_id, slash, kind = reference.partition("/")
    if slash and kind != "default":
        raise InvalidProject("logic item {id}: an action has no flow {type!r}", id=item.id, type=kind)
    try:
        return known[action_id]
    except KeyError:
        raise InvalidProject(
            "logic item {id} leads to or from an unknown action {action_id}", id=item.id, action_id=action_id
        ) from None


def _condition(condition: ProjectLogicIf, name: str, known: Mapping[str, int]) -> Condition:
    try:
        action_id, flow, output = parse_link(condition.what)
        value = json.loads(condition.value)
    except ValueError as error:
        raise InvalidProject("action {name!r}: a condition cannot be read: {reason}", name=name, reason=error) from None
    if action_id not in known or flow != "default":
        raise _missing(name, condition.what)
    if not isinstance(value, bool | int | str):
        raise InvalidProject(
            "action {name!r}: a condition compares with true, false, an integer or a text, not with {value}",
            name=name,
            value=condition.value,
        )
    return Condition(known[action_id], output, value)


def _missing(name: str, what: str) -> InvalidProject:
    return InvalidProject("action {name!r}: a condition refers to {what!r}, which does not exist", name=name, what=what)


def _comparisons(when: LogicWhen, name: str, known: Mapping[str, int], parameters: Collection[str]) -> Comparisons:
    found: list[Comparison] = []
    for one in when.comparisons:
        references: list[Reference] = []
        try:
            value, upper = decoded(one)
            places = [what_of(text) for text in one.compared()]
        except (ValueError, InvalidData) as error:
            raise InvalidProject(
                "action {name!r}: a condition cannot be read: {reason}", name=name, reason=error
            ) from None
        for text, place in zip(one.compared(), places, strict=True):
            if isinstance(place, str):
                references.append(Reference(END_NODE, 0, place))
                missing = place not in parameters
            else:
                references.append(Reference(known.get(place[0], END_NODE), place[1]))
                missing = place[0] not in known
            if missing:
                raise _missing(name, text)
        what, *others = references
        found.append(Comparison(what, one.operator, value, upper, *others))
    return Comparisons(tuple(found), when.match if len(found) > 1 else Match.ALL)


def test_of(item: LogicItem, name: str, known: Mapping[str, int], parameters: Collection[str]) -> Test | None:
    """Return the condition of a logic item of the action `name`, None if it has none.

    Args:
        item: the logic item.
        name: the name of the action, for errors.
        known: the numbers of actions by id.
        parameters: the ids of project parameters.

    Raises:
        InvalidProject: the condition is malformed or refers to something that does not exist.
    """
    if not isinstance(item.when, Unset) and item.when.comparisons:
        if not isinstance(item.condition, Unset):
            raise InvalidProject("action {name!r}: a connection has two conditions", name=name)
        return _comparisons(item.when, name, known, parameters)
    return None if isinstance(item.condition, Unset) else _condition(item.condition, name, known)


def _check_named(test: Test | None, source: Action, actions: Sequence[Action]) -> None:
    """Raise InvalidProject if a condition refers to a result without a name."""
    if test is None:
        return
    references = [] if isinstance(test, Condition) else [what for one in test.comparisons for what in one.compared()]
    places = [test] if isinstance(test, Condition) else [what for what in references if not what.parameter]
    for place in places:
        tested = actions[place.action]
        if place.output >= len(tested.outputs()):
            raise InvalidProject(
                "action {name!r}: a condition refers to a result that {tested_name!r} does not name",
                name=source.name,
                tested_name=tested.name,
            )


def _ordered(edges: list[Edge], source: Action, actions: Sequence[Action]) -> tuple[Edge, ...]:
    """Check that exactly one edge applies for any results, and sort the edges.

    Of two opposite conditions, true comes first. The edge without a condition comes last.
    """
    if not edges:
        raise InvalidProject("action {name!r}: no action follows it", name=source.name)
    unconditional = [edge for edge in edges if edge.condition is None]
    if unconditional and len(edges) == 1:
        return tuple(edges)
    conditional = [edge for edge in edges if edge.condition is not None]
    if len(unconditional) > 1 or (unconditional and any(is_boolean(edge.condition) for edge in conditional)):
        raise InvalidProject("action {name!r}: one of its connections has no condition", name=source.name)
    if any(isinstance(edge.condition, Comparisons) for edge in conditional):
        return (*conditional, *unconditional)
    tested: set[Condition] = set()
    covered = False
    for edge in conditional:
        assert isinstance(edge.condition, Condition)
        if covered or edge.condition in tested:
            raise never_taken(source, edge, actions)
        tested.add(edge.condition)
        covered = is_boolean(edge.condition) and edge.condition._replace(value=not edge.condition.value) in tested
    if not covered and not unconditional:
        [one, *more] = tested
        result = actions[one.action].outputs()[one.output]
        if more:
            when = Message.of("no condition holds")
        elif isinstance(one.value, bool):
            when = Message.of("{result} is {value}", result=result, value=_shown(not one.value))
        else:
            when = Message.of("{result} is not {value}", result=result, value=_shown(one.value))
        raise InvalidProject("action {name!r}: no action follows it when {when}", name=source.name, when=when)
    if len(conditional) == 2 and not unconditional:
        conditional.sort(key=lambda edge: is_boolean(edge.condition) and edge.condition.value is False)
    return (*conditional, *unconditional)


def never_taken(source: Action, edge: Edge, actions: Sequence[Action]) -> InvalidProject:
    """Return the error for an edge that is never followed."""
    where = Message.of("the end") if edge.target == END_NODE else repr(actions[edge.target].name)
    return InvalidProject("action {name!r}: the connection to {place} is never taken", name=source.name, place=where)


def error_kinds_problem(kinds: Sequence[str]) -> Message | None:
    """Return the problem of the kinds of an error exit, None if they are valid."""
    if unknown := [kind for kind in kinds if kind not in ERROR_KINDS]:
        known = ", ".join(ERROR_KINDS)
        return Message.of("{kind!r} is not a kind of error. Known kinds: {known}.", kind=unknown[0], known=known)
    if len(set(kinds)) != len(kinds):
        return Message.of("A kind of error is given twice.")
    if Arcor2Error.code in kinds and len(kinds) > 1:
        return Message.of("The kind {kind!r} contains all others: remove them.", kind=Arcor2Error.code)
    return None


def in_order_of_kinds(kinds: Iterable[str]) -> list[str]:
    """Return kinds of errors in the order in which error exits apply."""
    wanted = set(kinds)
    return [kind for kind in ERROR_KINDS if kind in wanted]


def _exits(failing: list[tuple[int, LogicItem]], source: Action) -> tuple[ErrorExit, ...]:
    """Check the error exits of an action, and sort them. The one for errors of any kind comes last."""
    found: list[ErrorExit] = []
    seen: set[str] = set()
    for target, item in failing:
        kinds = [] if isinstance(item.error_kinds, Unset) else item.error_kinds
        if (problem := error_kinds_problem(kinds)) is not None:
            raise InvalidProject("action {name!r}: {reason}", name=source.name, reason=problem)
        if item.has_condition:
            raise InvalidProject("action {name!r}: an error exit has a condition", name=source.name)
        if shared := seen.intersection(kinds):
            raise InvalidProject(
                "action {name!r}: two error exits have the kind {kind}", name=source.name, kind=min(shared)
            )
        seen.update(kinds)
        found.append(ErrorExit(target, tuple(in_order_of_kinds(kinds))))
    order = list(ERROR_KINDS)
    return tuple(sorted(found, key=lambda one: order.index(one.kinds[0])))


def is_boolean(condition: Test | None) -> TypeGuard[Condition]:
    """Return whether a condition tests a boolean by itself."""
    return isinstance(condition, Condition) and isinstance(condition.value, bool)


def _shown(value: bool | int | str) -> str:
    return json.dumps(value, ensure_ascii=False)


def _number(first: int, edges: list[list[int]], actions: Sequence[Action]) -> list[int]:
    """Return the actions reachable from `first` in topological order, branches in their order."""
    done: list[int] = []
    open_, closed = 1, 2
    state = [0] * len(edges)
    stack = [(first, iter(reversed(edges[first])))]
    state[first] = open_
    while stack:
        node, rest = stack[-1]
        for target in rest:
            if target == END_NODE or state[target] == closed:
                continue
            if state[target] == open_:
                raise InvalidProject("action {name!r}: the logic forms a loop through it", name=actions[target].name)
            state[target] = open_
            stack.append((target, iter(reversed(edges[target]))))
            break
        else:
            state[node] = closed
            done.append(node)
            stack.pop()
    done.reverse()
    return done


def _chains(actions: Sequence[Action], known: Mapping[str, int], logic: Iterable[LogicItem]) -> dict[int, list[int]]:
    """Return the calls that each parallel action runs concurrently. Raise InvalidProject if they are invalid."""
    found: dict[int, list[int]] = {}
    owners: dict[str, str] = {}
    for number, action in enumerate(actions):
        if not action.is_parallel:
            continue
        branches = action.branches or []
        if (problem := branches_problem(branches)) is not None:
            raise InvalidProject("action {name!r}: {reason}", name=action.name, reason=problem)
        for key in branches:
            call = actions[known[key]] if key in known else None
            if call is None or call.type.partition("/")[2] != CALL:
                raise InvalidProject(
                    "action {name!r}: its branch {id} is not a call of a function", name=action.name, id=key
                )
            if (other := owners.setdefault(key, action.name)) != action.name:
                raise InvalidProject(
                    "{call!r} is a branch of {name!r} and of {other!r}", call=call.name, name=other, other=action.name
                )
        found[number] = [known[key] for key in branches]
    for item in logic if owners else ():
        for key in (item.start.partition("/")[0], item.end.partition("/")[0]):
            if key in owners:
                raise InvalidProject(
                    "{call!r} is a branch of {name!r}, so no connection leads to or from it",
                    call=actions[known[key]].name,
                    name=owners[key],
                )
    return found


def branches_problem(branches: Sequence[str]) -> Message | None:
    """Return the problem of the number of branches of a parallel action, None if there is none."""
    if not MIN_BRANCHES <= len(branches) <= MAX_BRANCHES or len(set(branches)) != len(branches):
        return Message.of(
            "parallel work runs {least} to {most} different calls of functions", least=MIN_BRANCHES, most=MAX_BRANCHES
        )
    return None


def read(logic_of: Project | ProjectFunction, parameters: Collection[str] = ()) -> Flow:
    """Return the graph of the logic of a project or function.

    `parameters`: the ids of the project parameters, which conditions may compare.

    Raises:
        InvalidProject: the logic is invalid; the message names the action.
    """
    if isinstance(logic_of, Project):
        actions = [action for point in logic_of.action_points for action in point.actions]
    else:
        actions = logic_of.actions
    known = {action.id: number for number, action in enumerate(actions)}
    starts: list[int] = []
    items: list[list[tuple[int, LogicItem]]] = [[] for _ in actions]
    for item in logic_of.logic:
        target = END_NODE if item.end == END else _node(item.end, item, known)
        if item.start == START:
            if target == END_NODE:
                raise InvalidProject("the logic leads from START to END without an action")
            starts.append(target)
        else:
            items[_node(item.start, item, known)].append((target, item))
    if not starts:
        raise InvalidProject("the logic has no first action: no connection leaves START")
    if len(starts) > 1:
        names = ", ".join(repr(actions[start].name) for start in starts)
        raise InvalidProject("the logic has more than one first action: {names}", names=names)

    chains = _chains(actions, known, logic_of.logic)
    owners = {branches[-1]: number for number, branches in chains.items()}
    for number, branches in chains.items():
        items[branches[-1]] = [one for one in items[number] if not one[1].is_error_exit]
        items[number] = [one for one in items[number] if one[1].is_error_exit]
        for start, end in itertools.pairwise((number, *branches)):
            items[start].append((end, LogicItem(actions[start].id, actions[end].id)))
    order = _number(starts[0], [[target for target, _ in targets] for targets in items], actions)
    new_numbers = {old: number for number, old in enumerate(order)}
    reached = [actions[number] for number in order]
    reached_ids = {action.id: number for number, action in enumerate(reached)}
    new_numbers[END_NODE] = END_NODE
    edges: list[tuple[Edge, ...]] = []
    exits: list[tuple[ErrorExit, ...]] = []
    for old in order:
        source = actions[owners.get(old, old)]
        outgoing = [
            Edge(new_numbers[target], test_of(item, source.name, reached_ids, parameters))
            for target, item in items[old]
            if not item.is_error_exit
        ]
        for edge in outgoing:
            _check_named(edge.condition, source, reached)
        edges.append(_ordered(outgoing, source, reached))
        failing = [(new_numbers[target], item) for target, item in items[old] if item.is_error_exit]
        exits.append(_exits(failing, source) if failing else ())
    parallel = {
        new_numbers[number]: tuple(new_numbers[branch] for branch in branches)
        for number, branches in chains.items()
        if number in new_numbers
    }
    return Flow(reached, edges, exits, parallel)
