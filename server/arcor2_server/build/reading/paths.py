"""Reads the loop of a script as calls and the paths between them, with their conditions.

The reader follows the code in the order of execution, on all paths to a line at the same time. A path starts after a
call and ends at the next call or at the end of the cycle. It has at most one condition that is true, or several that
are false, and may set the variable `next_action` (see layout.py).
"""

import ast
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from arcor2_hw.data.object_type import ObjectAction, find_action
from arcor2_server.build.frame import NEXT_ACTION, Frame
from arcor2_server.build.reading.errors import NotUnderstood, excerpt
from arcor2_server.build.reading.module import Script
from arcor2_server.build.reading.values import Values
from arcor2_server.documents.logic_graph import BRANCHABLE, END_NODE, Condition

START_NODE: Final = -2


@dataclass(slots=True)
class Call:
    """The call of an action in the script.

    Args:
        line: its line, from 1.
        name: name of the action (`an`).
        object_id: id of the scene object.
        type_name: its object type.
        declared: the called method.
        arguments: the arguments by parameter.
        outputs: the variables for its results.
    """

    line: int
    name: str
    object_id: str
    type_name: str
    declared: ObjectAction
    arguments: dict[str, ast.expr]
    outputs: list[str]
    results: dict[str, tuple[int, int]] = field(default_factory=dict)
    """The results that its arguments use, by parameter: number of the call and of its result."""


class LogicPath(NamedTuple):
    """A path to `target`. Its condition is `taken`; without it, all conditions in `tried` are false."""

    target: int
    tried: tuple[Condition, ...]
    taken: Condition | None


class _OpenPath(NamedTuple):
    """A path from call `source` whose end is not reached yet."""

    source: int
    tried: tuple[Condition, ...] = ()
    taken: Condition | None = None
    next_action: str | None = None


class Use(NamedTuple):
    """A use of a result of call `source`, at or after call `node`."""

    node: int
    source: int
    line: int
    name: str


class LoopReader:
    """The calls of a loop in the order of the code, and the paths by the number of the call where they start."""

    def __init__(self, frame: Frame, script: Script, values: Values) -> None:
        self.calls: list[Call] = []
        self.paths: dict[int, list[LogicPath]] = {START_NODE: []}
        self.uses: list[Use] = []
        self._frame, self._script, self._values = frame, script, values
        self._results: dict[str, tuple[int, int]] = {}
        self._lines: dict[str, int] = {}
        open_paths = self._block(script.loop, [_OpenPath(START_NODE)])
        self._end(open_paths, script.loop[-1].lineno)
        for paths in self.paths.values():
            paths.sort(key=lambda path: (len(path.tried), path.taken is None))

    # ------------------------------------------------------------------------------------------------ statements
    def _block(self, body: Sequence[ast.stmt], open_paths: list[_OpenPath]) -> list[_OpenPath]:
        for node in body:
            if not open_paths:
                raise NotUnderstood(node.lineno, "{node} is never reached", node=excerpt(node))
            match node:
                case ast.Assign([ast.Name(name)], ast.Constant(str(next_action))) if name == NEXT_ACTION:
                    open_paths = [path._replace(next_action=next_action) for path in open_paths]
                case ast.Expr(ast.Call() as call):
                    open_paths = self._call(node, call, [], open_paths)
                case ast.Assign([target], ast.Call() as call) | ast.AnnAssign(target, _, ast.Call() as call):
                    open_paths = self._call(node, call, self._targets(target), open_paths)
                case ast.If():
                    open_paths = self._if(node, open_paths)
                case ast.Continue():
                    self._end(open_paths, node.lineno)
                    open_paths = []
                case ast.Pass():
                    continue
                case _:
                    raise NotUnderstood(
                        node.lineno,
                        "the loop contains only calls of actions, conditions and `continue`, but this is {node}",
                        node=excerpt(node),
                    )
        return open_paths

    def _end(self, open_paths: list[_OpenPath], line: int) -> None:
        for path in open_paths:
            if path.source == START_NODE:
                raise NotUnderstood(line, "the loop has no action before its end")
            self._arrive(path, END_NODE)

    def _arrive(self, path: _OpenPath, target: int) -> None:
        self.paths[path.source].append(LogicPath(target, path.tried, path.taken))

    # ------------------------------------------------------------------------------------------------ calls
    @staticmethod
    def _targets(target: ast.expr) -> list[str]:
        match target:
            case ast.Name(name):
                return [name]
            case ast.Tuple(parts) if parts and all(isinstance(part, ast.Name) for part in parts):
                return [part.id for part in parts if isinstance(part, ast.Name)]
        raise NotUnderstood(
            target.lineno, "results must be assigned to variables, not to {target}", target=excerpt(target)
        )

    def _call(self, node: ast.stmt, call: ast.Call, outputs: list[str], open_paths: list[_OpenPath]) -> list[_OpenPath]:
        match call.func:
            case ast.Attribute(ast.Name(variable), method) if variable in self._script.objects:
                object_id = self._script.objects[variable]
            case _:
                raise NotUnderstood(
                    call.lineno, "{func} is not an action of an object in the scene", func=excerpt(call.func)
                )
        obj = self._frame.index.scene_object(object_id)
        facts = self._frame.types[obj.type]
        declared = find_action(facts.actions.values(), method)
        if declared is None:
            raise NotUnderstood(call.lineno, "{type} has no action {method}", type=facts.shown_name, method=method)
        if declared.disabled:
            raise NotUnderstood(
                call.lineno,
                "{method} of {type} cannot be used: {problem}",
                method=method,
                type=facts.shown_name,
                problem=declared.why_disabled,
            )
        name = self._name(call)
        if outputs and len(outputs) != len(declared.returns):
            raise NotUnderstood(
                node.lineno,
                "{method} returns {count} results, not {other_count}",
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
        self.paths[number] = []
        for path in open_paths:
            self._arrive(path, number)
        return [_OpenPath(number)]

    def _name(self, call: ast.Call) -> str:
        for keyword in call.keywords:
            if keyword.arg == "an":
                match keyword.value:
                    case ast.Constant(str(name)) if name:
                        break
                raise NotUnderstood(
                    call.lineno, "the name of an action must be a string, not {value}", value=excerpt(keyword.value)
                )
        else:
            raise NotUnderstood(call.lineno, '{call} has no name: add an="..."', call=excerpt(call))
        if name in self._lines:
            raise NotUnderstood(
                call.lineno, "line {row} already has an action {name!r}", name=name, row=self._lines[name]
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
    def _if(self, node: ast.If, open_paths: list[_OpenPath]) -> list[_OpenPath]:
        after: list[_OpenPath] = []
        while True:
            holds, open_paths = self._split(node.test, open_paths)
            if not holds:
                raise NotUnderstood(node.lineno, "{test} is never true here", test=excerpt(node.test))
            after += self._block(node.body, holds)
            if not node.orelse:
                return after + open_paths
            if not open_paths:
                raise NotUnderstood(node.orelse[0].lineno, "{orelse} is never reached", orelse=excerpt(node.orelse[0]))
            if len(node.orelse) > 1 or not isinstance(node.orelse[0], ast.If):
                return after + self._block(node.orelse, open_paths)
            node = node.orelse[0]

    def _split(self, test: ast.expr, open_paths: list[_OpenPath]) -> tuple[list[_OpenPath], list[_OpenPath]]:
        """Return the paths on which a condition is true, and those on which it is false."""
        match test:
            case ast.Compare(ast.Name(name), [ast.Eq()], [ast.Constant(str(next_action))]) if name == NEXT_ACTION:
                if any(path.next_action is None for path in open_paths):
                    raise NotUnderstood(
                        test.lineno, "{next_action} is not set on all paths to this line", next_action=NEXT_ACTION
                    )
                matching = [path for path in open_paths if path.next_action == next_action]
                return matching, [path for path in open_paths if path.next_action != next_action]
        condition, variable, negated = self._condition(test)
        opposite = condition._replace(value=not condition.value) if isinstance(condition.value, bool) else None
        holds: list[_OpenPath] = []
        others: list[_OpenPath] = []
        for path in open_paths:
            if path.source == START_NODE:
                raise NotUnderstood(test.lineno, "a condition needs the result of an action before it")
            self.uses.append(Use(path.source, condition.action, test.lineno, variable))
            if path.taken is not None:
                if path.taken[:2] != condition[:2]:
                    raise NotUnderstood(test.lineno, "an action is required between two conditions")
                # The same result is compared again; its value on this path is known.
                (holds if path.taken == condition else others).append(path)
                continue
            if opposite in path.tried:
                holds.append(path)
            elif condition in path.tried:
                others.append(path)
            else:
                holds.append(path._replace(taken=condition))
                others.append(path._replace(tried=(*path.tried, condition)))
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
                    test.lineno, "a condition must be `result == value`, not {test}", test=excerpt(test)
                )
        if variable not in self._results:
            raise NotUnderstood(test.lineno, "{variable} is not a result of an action above", variable=variable)
        source, output = self._results[variable]
        kind = self.calls[source].declared.returns[output]
        if kind not in BRANCHABLE:
            raise NotUnderstood(
                test.lineno,
                "{variable} is {type}, which a condition cannot use",
                variable=variable,
                type=kind,
            )
        if type(value) is not BRANCHABLE[kind]:
            raise NotUnderstood(
                test.lineno, "{variable} is {type} and cannot be {value!r}", variable=variable, type=kind, value=value
            )
        return Condition(source, output, value), variable, negated
