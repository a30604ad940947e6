"""The logic of a project as a graph: the successors of each action and their conditions."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeGuard

from arcor2_hw.data.base import Unset
from arcor2_hw.data.project import (
    END,
    START,
    Action,
    LogicItem,
    Project,
    ProjectFunction,
    ProjectLogicIf,
    parse_link,
)
from arcor2_hw.exceptions import ERROR_KINDS, Arcor2Error, InvalidProject
from arcor2_hw.messages import Message

END_NODE: Final = -1
"""The number of END, next to the numbers of actions."""

BRANCHABLE: Final[dict[str, type]] = {"boolean": bool, "integer": int, "integer_enum": int, "string_enum": str}
"""The types of results that conditions can test, with the type of the compared value (docs/protocol.md)."""


class Condition(NamedTuple):
    """True if result number `output` of action number `action` equals `value`."""

    action: int
    output: int
    value: bool | int | str


class Edge(NamedTuple):
    """A connection to action number `target` (or END_NODE). Without a condition it is the only or the default one."""

    target: int
    condition: Condition | None


class ErrorExit(NamedTuple):
    """A connection to action number `target` (or END_NODE) for errors of some kinds."""

    target: int
    kinds: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Flow:
    """The reachable actions in topological order: every edge leads to a higher number, 0 is the first.

    `edges[n]` is one unconditional edge, or several that are tested in order. The last one applies if no other does.
    `exits[n]` are the error exits in the order in which they apply.
    """

    actions: list[Action]
    edges: list[tuple[Edge, ...]]
    exits: list[tuple[ErrorExit, ...]]


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


def _condition(
    condition: ProjectLogicIf, source: Action, actions: Sequence[Action], known: dict[str, int]
) -> Condition:
    try:
        action_id, flow, output = parse_link(condition.what)
        value = json.loads(condition.value)
    except ValueError as error:
        raise InvalidProject(
            "action {name!r}: a condition cannot be read: {reason}", name=source.name, reason=error
        ) from None
    if action_id not in known or flow != "default":
        raise InvalidProject(
            "action {name!r}: a condition refers to {what!r}, which does not exist",
            name=source.name,
            what=condition.what,
        )
    if not isinstance(value, bool | int | str):
        raise InvalidProject(
            "action {name!r}: a condition compares with true, false, an integer or a text, not with {value}",
            name=source.name,
            value=condition.value,
        )
    tested = actions[known[action_id]]
    if output >= len(tested.outputs()):
        raise InvalidProject(
            "action {name!r}: a condition refers to a result that {tested_name!r} does not name",
            name=source.name,
            tested_name=tested.name,
        )
    return Condition(known[action_id], output, value)


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
    if len(unconditional) > 1 or (unconditional and any(_is_boolean(edge.condition) for edge in conditional)):
        raise InvalidProject("action {name!r}: one of its connections has no condition", name=source.name)
    tested: set[Condition] = set()
    covered = False
    for edge in conditional:
        assert edge.condition is not None
        if covered or edge.condition in tested:
            where = Message.of("the end") if edge.target == END_NODE else repr(actions[edge.target].name)
            raise InvalidProject(
                "action {name!r}: the connection to {place} is never taken", name=source.name, place=where
            )
        tested.add(edge.condition)
        covered = _is_boolean(edge.condition) and edge.condition._replace(value=not edge.condition.value) in tested
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
        conditional.sort(key=lambda edge: _is_boolean(edge.condition) and edge.condition.value is False)
    return (*conditional, *unconditional)


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
        if not isinstance(item.condition, Unset):
            raise InvalidProject("action {name!r}: an error exit has a condition", name=source.name)
        if shared := seen.intersection(kinds):
            raise InvalidProject(
                "action {name!r}: two error exits have the kind {kind}", name=source.name, kind=min(shared)
            )
        seen.update(kinds)
        found.append(ErrorExit(target, tuple(in_order_of_kinds(kinds))))
    order = list(ERROR_KINDS)
    return tuple(sorted(found, key=lambda one: order.index(one.kinds[0])))


def _is_boolean(condition: Condition | None) -> TypeGuard[Condition]:
    return condition is not None and isinstance(condition.value, bool)


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


def read(logic_of: Project | ProjectFunction) -> Flow:
    """Return the graph of the logic of a project or function.

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

    order = _number(starts[0], [[target for target, _ in targets] for targets in items], actions)
    new_numbers = {old: number for number, old in enumerate(order)}
    reached = [actions[number] for number in order]
    reached_ids = {action.id: number for number, action in enumerate(reached)}
    new_numbers[END_NODE] = END_NODE
    edges: list[tuple[Edge, ...]] = []
    exits: list[tuple[ErrorExit, ...]] = []
    for old, source in zip(order, reached, strict=True):
        outgoing = [
            Edge(
                new_numbers[target],
                None if isinstance(item.condition, Unset) else _condition(item.condition, source, reached, reached_ids),
            )
            for target, item in items[old]
            if not item.is_error_exit
        ]
        edges.append(_ordered(outgoing, source, reached))
        failing = [(new_numbers[target], item) for target, item in items[old] if item.is_error_exit]
        exits.append(_exits(failing, source) if failing else ())
    return Flow(reached, edges, exits)
