"""The loop of a script as calls and the ways between them: what runs after what, under which condition.

The text is followed as it would be run, with all ways at once that lead to a line. A way begins behind a call and ends
at the next one, or at the end of the cycle; on it there may be one condition that holds, or several that do not, and
a note where it is going (see layout.py).
"""

import ast
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from arcor2_hw.data.object_type import ObjectAction, find_action
from arcor2_server.build.frame import NEXT_ACTION, Frame
from arcor2_server.build.reading.errors import NotUnderstood, shown
from arcor2_server.build.reading.module import Script
from arcor2_server.build.reading.values import Values
from arcor2_server.documents.logic_graph import BRANCHABLE, END_NODE, Condition

START_NODE: Final = -2


@dataclass(slots=True)
class Call:
    """One action as it is written. outputs: the variables that take its results."""

    line: int
    name: str
    object_id: str
    type_name: str
    declared: ObjectAction
    arguments: dict[str, ast.expr]
    outputs: list[str]
    results: dict[str, tuple[int, int]] = field(default_factory=dict)
    """What its arguments link to: number of the call and of its output, by variable."""


class Way(NamedTuple):
    """The end of a way: `taken` is the condition that holds on it; without one, none of `tried` does."""

    target: int
    tried: tuple[Condition, ...]
    taken: Condition | None


class _Going(NamedTuple):
    """A way on which the text is being followed."""

    source: int
    tried: tuple[Condition, ...] = ()
    taken: Condition | None = None
    note: str | None = None


class Use(NamedTuple):
    """A result of `source` that is used at or behind the call `node`."""

    node: int
    source: int
    line: int
    name: str


class Ways:
    """Reads a loop. `calls` in the order of the text, `ways` by the number of the call that they leave."""

    def __init__(self, frame: Frame, script: Script, values: Values) -> None:
        self.calls: list[Call] = []
        self.ways: dict[int, list[Way]] = {START_NODE: []}
        self.uses: list[Use] = []
        self._frame, self._script, self._values = frame, script, values
        self._results: dict[str, tuple[int, int]] = {}
        self._lines: dict[str, int] = {}
        going = self._block(script.loop, [_Going(START_NODE)])
        self._end(going, script.loop[-1].lineno)
        for ways in self.ways.values():
            ways.sort(key=lambda way: (len(way.tried), way.taken is None))

    # ------------------------------------------------------------------------------------------------ statements
    def _block(self, body: Sequence[ast.stmt], going: list[_Going]) -> list[_Going]:
        for node in body:
            if not going:
                raise NotUnderstood(node.lineno, "{node} is never reached", node=shown(node))
            match node:
                case ast.Assign([ast.Name(name)], ast.Constant(str(note))) if name == NEXT_ACTION:
                    going = [way._replace(note=note) for way in going]
                case ast.Expr(ast.Call() as call):
                    going = self._call(node, call, [], going)
                case ast.Assign([target], ast.Call() as call) | ast.AnnAssign(target, _, ast.Call() as call):
                    going = self._call(node, call, self._targets(target), going)
                case ast.If():
                    going = self._if(node, going)
                case ast.Continue():
                    self._end(going, node.lineno)
                    going = []
                case ast.Pass():
                    continue
                case _:
                    raise NotUnderstood(
                        node.lineno,
                        "the loop has calls of actions, conditions and `continue`, but here is {node}",
                        node=shown(node),
                    )
        return going

    def _end(self, going: list[_Going], line: int) -> None:
        for way in going:
            if way.source == START_NODE:
                raise NotUnderstood(line, "the loop does nothing before it ends")
            self._arrive(way, END_NODE)

    def _arrive(self, way: _Going, target: int) -> None:
        self.ways[way.source].append(Way(target, way.tried, way.taken))

    # ------------------------------------------------------------------------------------------------ calls
    def _targets(self, target: ast.expr) -> list[str]:
        match target:
            case ast.Name(name):
                return [name]
            case ast.Tuple(parts) if parts and all(isinstance(part, ast.Name) for part in parts):
                return [part.id for part in parts if isinstance(part, ast.Name)]
        raise NotUnderstood(target.lineno, "results go into variables, not into {target}", target=shown(target))

    def _call(self, node: ast.stmt, call: ast.Call, outputs: list[str], going: list[_Going]) -> list[_Going]:
        match call.func:
            case ast.Attribute(ast.Name(variable), method) if variable in self._script.objects:
                object_id = self._script.objects[variable]
            case _:
                raise NotUnderstood(call.lineno, "{func} is no action of an object of the scene", func=shown(call.func))
        obj = self._frame.index.scene_object(object_id)
        declared = find_action(self._frame.types[obj.type].actions.values(), method)
        if declared is None:
            raise NotUnderstood(call.lineno, "{type} has no action {method}", type=obj.type, method=method)
        if declared.disabled:
            raise NotUnderstood(
                call.lineno,
                "{type}.{method} cannot be used: {problem}",
                type=obj.type,
                method=method,
                problem=declared.problem,
            )
        name = self._name(call)
        if outputs and len(outputs) != len(declared.returns):
            raise NotUnderstood(
                node.lineno,
                "{method} gives {count} results, not {other_count}",
                method=method,
                count=len(declared.returns),
                other_count=len(outputs),
            )
        arguments = self._values.arguments(call, declared, obj.type)
        number = len(self.calls)
        links = self._links(number, arguments, declared)
        self.calls.append(Call(call.lineno, name, object_id, obj.type, declared, arguments, outputs, links))
        for place, output in enumerate(outputs):
            self._script.claim(output, node.lineno)
            self._results[output] = (number, place)
        self.ways[number] = []
        for way in going:
            self._arrive(way, number)
        return [_Going(number)]

    def _name(self, call: ast.Call) -> str:
        for keyword in call.keywords:
            if keyword.arg == "an":
                match keyword.value:
                    case ast.Constant(str(name)) if name:
                        break
                raise NotUnderstood(
                    call.lineno, "the name of an action is a text, not {value}", value=shown(keyword.value)
                )
        else:
            raise NotUnderstood(call.lineno, '{call} has no name: add an="..."', call=shown(call))
        if name in self._lines:
            raise NotUnderstood(
                call.lineno, "the action {name!r} is there already, in line {row}", name=name, row=self._lines[name]
            )
        self._lines[name] = call.lineno
        return name

    def _links(self, number: int, arguments: dict[str, ast.expr], declared: ObjectAction) -> dict[str, tuple[int, int]]:
        links: dict[str, tuple[int, int]] = {}
        for meta in declared.parameters:
            node = arguments.get(meta.name)
            if not isinstance(node, ast.Name) or node.id not in self._results:
                continue
            source, output = links[meta.name] = self._results[node.id]
            kind = self.calls[source].declared.returns[output]
            if kind != meta.type:
                raise NotUnderstood(
                    node.lineno,
                    "{name} is {type}, but {id} is {other_type}",
                    name=meta.name,
                    type=meta.type,
                    id=node.id,
                    other_type=kind,
                )
            self.uses.append(Use(number, source, node.lineno, node.id))
        return links

    # ------------------------------------------------------------------------------------------------ conditions
    def _if(self, node: ast.If, going: list[_Going]) -> list[_Going]:
        behind: list[_Going] = []
        while True:
            holds, going = self._split(node.test, going)
            if not holds:
                raise NotUnderstood(node.lineno, "{test} never holds here", test=shown(node.test))
            behind += self._block(node.body, holds)
            if not node.orelse:
                return behind + going
            if not going:
                raise NotUnderstood(node.orelse[0].lineno, "{orelse} is never reached", orelse=shown(node.orelse[0]))
            if len(node.orelse) > 1 or not isinstance(node.orelse[0], ast.If):
                return behind + self._block(node.orelse, going)
            node = node.orelse[0]

    def _split(self, test: ast.expr, going: list[_Going]) -> tuple[list[_Going], list[_Going]]:
        """Return the paths on which a condition holds, and those on which it does not."""
        match test:
            case ast.Compare(ast.Name(name), [ast.Eq()], [ast.Constant(str(note))]) if name == NEXT_ACTION:
                if any(way.note is None for way in going):
                    raise NotUnderstood(
                        test.lineno, "{next_action} is not set on every way that leads here", next_action=NEXT_ACTION
                    )
                return [way for way in going if way.note == note], [way for way in going if way.note != note]
        condition, variable, negated = self._condition(test)
        opposite = condition._replace(value=not condition.value) if isinstance(condition.value, bool) else None
        holds: list[_Going] = []
        others: list[_Going] = []
        for way in going:
            if way.source == START_NODE:
                raise NotUnderstood(test.lineno, "there is no result yet to be asked for")
            self.uses.append(Use(way.source, condition.action, test.lineno, variable))
            if way.taken is not None:
                if way.taken[:2] != condition[:2]:
                    raise NotUnderstood(test.lineno, "between one condition and the next there has to be an action")
                # The same result is asked again: what it is here is known.
                (holds if way.taken == condition else others).append(way)
                continue
            if opposite in way.tried:
                holds.append(way)
            elif condition in way.tried:
                others.append(way)
            else:
                holds.append(way._replace(taken=condition))
                others.append(way._replace(tried=(*way.tried, condition)))
        return (others, holds) if negated else (holds, others)

    def _condition(self, test: ast.expr) -> tuple[Condition, str, bool]:
        """Return the value and the variable of a condition, and whether it is negated (`!=`)."""
        negated = False
        match test:
            case ast.Name(variable):
                value: bool | int | str = True
            case ast.UnaryOp(ast.Not(), ast.Name(variable)):
                value = False
            case ast.Compare(ast.Name(variable), [ast.Eq() | ast.Is()], [right]):
                value = self._values.compared(right)
            case ast.Compare(ast.Name(variable), [ast.NotEq() | ast.IsNot()], [right]):
                value, negated = self._values.compared(right), True
            case _:
                raise NotUnderstood(
                    test.lineno, "a condition is written `result == value`, not {test}", test=shown(test)
                )
        if variable not in self._results:
            raise NotUnderstood(test.lineno, "{variable} is no result of an action above", variable=variable)
        source, output = self._results[variable]
        kind = self.calls[source].declared.returns[output]
        if kind not in BRANCHABLE:
            raise NotUnderstood(
                test.lineno,
                "{variable} is {type}, which cannot be asked for in a condition",
                variable=variable,
                type=kind,
            )
        if type(value) is not BRANCHABLE[kind]:
            raise NotUnderstood(
                test.lineno, "{variable} is {type} and cannot be {value!r}", variable=variable, type=kind, value=value
            )
        return Condition(source, output, value), variable, negated
