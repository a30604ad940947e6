"""Reads the loop of a script as calls and the paths between them, with their conditions.

The reader follows the code in the order of execution, on all paths to a line at the same time. A path starts after a
call and ends at the next call or at the end of the cycle. It has at most one condition that is true, or several that
are false, and may set the variable `next_action` (see layout.py). A path through an `except` block starts at the error
exit of the call in the `try` block.
"""

import ast
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Final, NamedTuple

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.object_type import Again, ObjectAction, ParameterMeta, find_action
from arcor2_hw.data.project import (
    CALL,
    ERROR_FLOW,
    ERROR_PARTS,
    MAX_RETRIES,
    MAX_RETRY_PAUSE,
    FlowTypes,
    Match,
    Operator,
    Retry,
)
from arcor2_server.build.frame import NEXT_ACTION, Frame
from arcor2_server.build.reading.errors import NotUnderstood, excerpt
from arcor2_server.build.reading.module import Script
from arcor2_server.build.reading.values import Values
from arcor2_server.documents.comparisons import (
    RANGES,
    Comparison,
    Comparisons,
    Reference,
    Value,
    comparison_problem,
)
from arcor2_server.documents.logic_graph import (
    BRANCHABLE,
    END_NODE,
    Condition,
    ErrorExit,
    Test,
    as_comparisons,
    error_kinds_problem,
    in_order_of_kinds,
    is_boolean,
)

START_NODE: Final = -2
_OPERATORS: Final[Mapping[type[ast.cmpop] | None, Operator]] = {
    ast.Eq: Operator.EQUAL,
    ast.Is: Operator.EQUAL,
    ast.NotEq: Operator.DIFFERENT,
    ast.IsNot: Operator.DIFFERENT,
    ast.Lt: Operator.LESS,
    ast.LtE: Operator.LESS_EQUAL,
    ast.Gt: Operator.GREATER,
    ast.GtE: Operator.GREATER_EQUAL,
}
_MIRRORED: Final[Mapping[Operator, Operator]] = {
    Operator.EQUAL: Operator.EQUAL,
    Operator.DIFFERENT: Operator.DIFFERENT,
    Operator.LESS: Operator.GREATER,
    Operator.LESS_EQUAL: Operator.GREATER_EQUAL,
    Operator.GREATER: Operator.LESS,
    Operator.GREATER_EQUAL: Operator.LESS_EQUAL,
}
"""The operators of comparisons with the constant on the left."""
_RANGES: Final[Mapping[tuple[Operator | None, Operator | None], Operator]] = {
    symbols: kind
    for kind, (above, below) in RANGES.items()
    for symbols in ((above, below), (_MIRRORED[below], _MIRRORED[above]))
}
"""The kinds of ranges by their operators, ascending as in `3 <= n < 7`, or descending as in `7 > n >= 3`."""


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
    results: dict[str, tuple[int, str, int]] = field(default_factory=dict)
    """What its arguments use of other calls, by parameter: number of the call, flow and number of the result."""
    passed: dict[str, str] = field(default_factory=dict)
    """The parameters of the function around the call that its arguments pass on, by parameter."""
    error: str = ""
    """The variable for its error; empty if it is not stored."""
    retry: Retry | Unset = UNSET


class LogicPath(NamedTuple):
    """A path to `target`. Its condition is `taken`; without it, all conditions in `tried` are false."""

    target: int
    tried: tuple[Test, ...]
    taken: Test | None


class _OpenPath(NamedTuple):
    """A path from call `source` whose end is not reached yet."""

    source: int
    tried: tuple[Test, ...] = ()
    taken: Test | None = None
    next_action: str | None = None
    kinds: tuple[str, ...] = ()
    """The kinds of errors, if the path starts at an error exit of the call."""


class Use(NamedTuple):
    """A use of a result or the error of call `source`: by call `user`, or by a condition after it."""

    user: int
    source: int
    line: int
    name: str
    in_condition: bool = False
    of_error: bool = False


@dataclass(frozen=True, slots=True)
class ScriptCalls:
    """What the loop and the functions of a script share.

    Args:
        functions: ids of the functions that are already read, by name.
        lines: lines of the calls, by name of the action.
    """

    functions: dict[str, str] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)


class LoopReader:
    """The calls of a loop in the order of the code, and the paths by the number of the call where they start."""

    stores: ClassVar = True
    """Whether calls may store results in variables of the project. Those of functions may not."""

    def __init__(
        self, frame: Frame, script: Script, values: Values, shared: ScriptCalls, body: Sequence[ast.stmt]
    ) -> None:
        self.calls: list[Call] = []
        self.paths: dict[int, list[LogicPath]] = {START_NODE: []}
        self.exits: dict[int, list[ErrorExit]] = {}
        """The error exits by the number of the call."""
        self.uses: list[Use] = []
        self.stored: set[str] = set()
        """The project parameters in which results are stored."""
        self._frame, self._script, self._values = frame, script, values
        self._results: dict[str, tuple[int, int]] = {}
        self._errors: dict[str, int] = {}
        self._shared = shared
        self._own_lines: dict[str, int] = {}
        """The lines that define variables of the loop."""
        open_paths = self._block(body, [_OpenPath(START_NODE)])
        self._end(open_paths, body[-1].lineno)
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
                case ast.Expr(ast.Call()) | ast.Assign([_], ast.Call()) | ast.AnnAssign(_, _, ast.Call()):
                    open_paths = self._step(node, open_paths)
                case ast.If():
                    open_paths = self._if(node, open_paths)
                case ast.Try():
                    open_paths = self._try(node, open_paths)
                case ast.Continue() | ast.Return():
                    self._leave(node, open_paths)
                    open_paths = []
                case ast.Pass():
                    continue
                case _:
                    raise self._refusal(node)
        return open_paths

    def _refusal(self, node: ast.stmt) -> NotUnderstood:
        """Return the error for a statement that cannot be converted."""
        return NotUnderstood(
            node.lineno,
            "the loop contains only calls of actions, conditions, `try` and `continue`, but this is {node}",
            node=excerpt(node),
        )

    def _leave(self, node: ast.Continue | ast.Return, open_paths: list[_OpenPath]) -> None:
        """Read a statement that ends the cycle."""
        if isinstance(node, ast.Return):
            raise self._refusal(node)
        self._end(open_paths, node.lineno)

    def _claim(self, name: str, line: int) -> None:
        """Store the line that defines a variable. Raise NotUnderstood if its name is already defined."""
        for lines in (self._script.lines, self._own_lines):
            if name in lines:
                raise NotUnderstood(line, "{name} is already defined in line {row}", name=name, row=lines[name])
        self._own_lines[name] = line

    def _end(self, open_paths: list[_OpenPath], line: int) -> None:
        for path in open_paths:
            if path.source == START_NODE:
                raise NotUnderstood(line, "the loop has no action before its end")
            self._arrive(path, END_NODE)

    def _arrive(self, path: _OpenPath, target: int) -> None:
        if not path.kinds:
            self.paths[path.source].append(LogicPath(target, path.tried, path.taken))
            return
        exits = self.exits.setdefault(path.source, [])
        for place, one in enumerate(exits):
            if one.target == target:
                exits[place] = one._replace(kinds=tuple(in_order_of_kinds((*one.kinds, *path.kinds))))
                return
        exits.append(ErrorExit(target, path.kinds))

    # ------------------------------------------------------------------------------------------------ error exits
    def _try(self, node: ast.Try, open_paths: list[_OpenPath]) -> list[_OpenPath]:
        match node.body:
            case [ast.Expr() | ast.Assign() | ast.AnnAssign() as step] if not node.finalbody and node.handlers:
                after = self._step(step, open_paths)
            case _:
                raise NotUnderstood(node.lineno, "a `try` block contains one call of an action, and has no `finally`")
        number = len(self.calls) - 1
        if node.orelse:
            after = self._block(node.orelse, after)
        seen: set[str] = set()
        for handler in node.handlers:
            kinds = self._kinds(handler)
            if (problem := error_kinds_problem(kinds)) is not None:
                raise NotUnderstood(handler.lineno, "{problem}", problem=problem)
            if shared := seen.intersection(kinds):
                raise NotUnderstood(handler.lineno, "{kind} is handled twice", kind=min(shared))
            seen.update(kinds)
            variable = self._caught(handler)
            if variable and variable != self.calls[number].error:
                if self.calls[number].error:
                    raise NotUnderstood(
                        handler.lineno, "the error of an action has one name, not also {name}", name=variable
                    )
                self._claim(variable, handler.lineno)
                self._errors[variable] = number
                self.calls[number].error = variable
            after = after + self._block(handler.body[1:], [_OpenPath(number, kinds=tuple(in_order_of_kinds(kinds)))])
        return after

    def _kinds(self, handler: ast.ExceptHandler) -> list[str]:
        classes = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
        found = [self._script.errors.get(one.id) if isinstance(one, ast.Name) else None for one in classes]
        if not found or None in found:
            raise NotUnderstood(
                handler.lineno, "`except` needs kinds of errors that are imported from arcor2_hw.exceptions"
            )
        return [kind for kind in found if kind is not None]

    def _caught(self, handler: ast.ExceptHandler) -> str:
        """Return the variable for the error of an `except` block, empty if it is not stored."""
        call: ast.expr | None = None
        variable = ""
        match handler.body[0]:
            case ast.Expr(call):
                pass
            case ast.Assign([ast.Name(variable)], call) | ast.AnnAssign(ast.Name(variable), _, ast.expr() as call):
                pass
        match call:
            case ast.Call(ast.Attribute(ast.Name(resources), "caught"), [ast.Name(error)], []) if (
                resources == self._script.resources and error == handler.name
            ):
                return variable
        raise NotUnderstood(
            handler.lineno,
            "an `except` block starts with `[name =] {resources}.caught({error})`",
            resources=self._script.resources,
            error=handler.name or "error",
        )

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

    def _step(self, node: ast.stmt, open_paths: list[_OpenPath]) -> list[_OpenPath]:
        """Read a statement that calls an action."""
        match node:
            case ast.Expr(ast.Call() as call):
                return self._call(node, call, [], open_paths)
            case ast.Assign([target], ast.Call() as call) | ast.AnnAssign(target, _, ast.Call() as call):
                return self._call(node, call, self._targets(target), open_paths)
        raise NotUnderstood(node.lineno, "{node} is not a call of an action", node=excerpt(node))

    def _call(self, node: ast.stmt, call: ast.Call, outputs: list[str], open_paths: list[_OpenPath]) -> list[_OpenPath]:
        retry: Retry | Unset = UNSET
        match call.func:
            case ast.Attribute(ast.Name(variable), method) if variable in self._script.objects:
                object_id = self._script.objects[variable]
                type_name = self._frame.index.scene_object(object_id).type
            case ast.Attribute(
                ast.Call(ast.Attribute(ast.Name(resources), "retry"), [ast.Name(variable), *_]) as repeated, method
            ) if resources == self._script.resources and variable in self._script.objects:
                object_id = self._script.objects[variable]
                type_name = self._frame.index.scene_object(object_id).type
                retry = self._retry(repeated)
            case ast.Name(variable) if variable in self._shared.functions:
                object_id = type_name = self._shared.functions[variable]
                method = CALL
            case ast.Name(variable) if any(variable == function.name for function in self._script.functions):
                raise NotUnderstood(call.lineno, "the function {name} must be defined above its calls", name=variable)
            case _:
                raise NotUnderstood(
                    call.lineno, "{func} is not an action of an object in the scene", func=excerpt(call.func)
                )
        facts = self._values.types_of(type_name)
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
        arguments = self._values.arguments(call, declared, type_name)
        number = len(self.calls)
        links = self._links(number, arguments, declared)
        passed = self._passed(arguments, declared)
        self.calls.append(
            Call(call.lineno, name, object_id, type_name, declared, arguments, outputs, links, passed, retry=retry)
        )
        if retry and declared.meta.again != Again.SAFE:
            raise NotUnderstood(
                call.lineno, "{method} cannot be retried, because repeating it may do harm", method=method
            )
        for place, output in enumerate(outputs):
            if output in self._values.parameters and self.stores:
                self._store(node, output, declared.returns[place])
                continue
            self._claim(output, node.lineno)
            self._results[output] = (number, place)
        self.paths[number] = []
        for path in open_paths:
            self._arrive(path, number)
        return [_OpenPath(number)]

    @staticmethod
    def _retry(call: ast.Call) -> Retry:
        """Read `res.retry(device, count, pause=seconds)`."""
        pause: object = 0.0
        match call.keywords:
            case []:
                pass
            case [ast.keyword("pause", ast.Constant(int() | float() as pause))] if not isinstance(pause, bool):
                pass
            case _:
                pause = None
        match call.args:
            case [_, ast.Constant(int() as count)] if isinstance(pause, int | float) and not isinstance(count, bool):
                if 1 <= count <= MAX_RETRIES and 0.0 <= pause <= MAX_RETRY_PAUSE:
                    return Retry(count, float(pause))
        raise NotUnderstood(
            call.lineno,
            "a retry has a count from 1 to {count} and a pause of 0 to {pause} s, but this is {call}",
            count=MAX_RETRIES,
            pause=f"{MAX_RETRY_PAUSE:g}",
            call=excerpt(call),
        )

    def _store(self, node: ast.stmt, variable: str, returned: str) -> None:
        """Store that an action changes a variable."""
        _, kind = self._values.parameters[variable]
        if kind != returned:
            raise NotUnderstood(
                node.lineno,
                "the variable {name} is {type}, the result is {return_value}",
                name=variable,
                type=kind,
                return_value=returned,
            )
        self.stored.add(variable)

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
        lines = self._shared.lines
        if name in lines:
            raise NotUnderstood(call.lineno, "line {row} already has an action {name!r}", name=name, row=lines[name])
        lines[name] = call.lineno
        return name

    def _passed(self, arguments: dict[str, ast.expr], declared: ObjectAction) -> dict[str, str]:  # noqa: ARG002
        """Return the parameters of the function that the arguments of a call pass on, by parameter."""
        return {}

    def _links(
        self, number: int, arguments: dict[str, ast.expr], declared: ObjectAction
    ) -> dict[str, tuple[int, str, int]]:
        links: dict[str, tuple[int, str, int]] = {}
        for meta in declared.parameters:
            node = arguments.get(meta.name)
            match node:
                case ast.Attribute(ast.Name(variable), part) if variable in self._errors:
                    links[meta.name] = self._part_of_error(number, node, variable, part, meta)
                    continue
            if not isinstance(node, ast.Name) or node.id not in self._results:
                continue
            source, output = self._results[node.id]
            links[meta.name] = source, FlowTypes.DEFAULT, output
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

    def _part_of_error(
        self, number: int, node: ast.Attribute, variable: str, part: str, meta: ParameterMeta
    ) -> tuple[int, str, int]:
        if part not in ERROR_PARTS:
            known = ", ".join(ERROR_PARTS)
            raise NotUnderstood(
                node.lineno, "{name} has no {part}; it has {known}", name=variable, part=part, known=known
            )
        if meta.type != "string":
            raise NotUnderstood(
                node.lineno, "{name} is {type}, but {part} is string", name=meta.name, type=meta.type, part=part
            )
        source = self._errors[variable]
        self.uses.append(Use(number, source, node.lineno, variable, of_error=True))
        return source, ERROR_FLOW, ERROR_PARTS.index(part)

    # ------------------------------------------------------------------------------------------------ conditions
    def _if(self, node: ast.If, open_paths: list[_OpenPath]) -> list[_OpenPath]:
        after: list[_OpenPath] = []
        while True:
            more = len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If)
            holds, open_paths = self._split(node.test, open_paths, more=more)
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

    def _split(
        self, test: ast.expr, open_paths: list[_OpenPath], *, more: bool
    ) -> tuple[list[_OpenPath], list[_OpenPath]]:
        """Return the paths on which a condition is true, and those on which it is false; `more` if `elif` follows."""
        match test:
            case ast.Compare(ast.Name(name), [ast.Eq()], [ast.Constant(str(next_action))]) if name == NEXT_ACTION:
                if any(path.next_action is None for path in open_paths):
                    raise NotUnderstood(
                        test.lineno, "{next_action} is not set on all paths to this line", next_action=NEXT_ACTION
                    )
                matching = [path for path in open_paths if path.next_action == next_action]
                return matching, [path for path in open_paths if path.next_action != next_action]
        condition, negated = self._condition(test, more=more)
        opposite = condition._replace(value=not condition.value) if is_boolean(condition) else None
        holds: list[_OpenPath] = []
        others: list[_OpenPath] = []
        for path in open_paths:
            if path.source == START_NODE:
                raise NotUnderstood(test.lineno, "a condition needs the result of an action before it")
            if path.kinds:
                raise NotUnderstood(test.lineno, "an action is required between an error and a condition")
            for one in as_comparisons(condition).comparisons:
                if not one.what.parameter:
                    output = self.calls[one.what.action].outputs[one.what.output]
                    self.uses.append(Use(path.source, one.what.action, test.lineno, output, in_condition=True))
            if path.taken is not None:
                if path.taken != condition and not _same_result(path.taken, condition):
                    raise NotUnderstood(test.lineno, "an action is required between two conditions")
                # The same result is compared again; its value on this path is known.
                (holds if path.taken == condition else others).append(path)
                continue
            if opposite is not None and opposite in path.tried:
                holds.append(path)
            elif condition in path.tried:
                others.append(path)
            else:
                holds.append(path._replace(taken=condition))
                others.append(path._replace(tried=(*path.tried, condition)))
        return (others, holds) if negated else (holds, others)

    def _condition(self, test: ast.expr, *, more: bool) -> tuple[Test, bool]:
        """Return a condition and whether it is negated: by `not`, or a single `!=` without another branch after it."""
        match test:
            case ast.UnaryOp(ast.Not(), operand) if not isinstance(operand, ast.Name):
                condition, negated = self._condition(operand, more=False)
                return condition, not negated
            case ast.BoolOp(connective, values):
                found = tuple(self._comparison(value) for value in values)
                if len(set(found)) != len(found):
                    raise NotUnderstood(test.lineno, "{test} contains a comparison twice", test=excerpt(test))
                return Comparisons(found, Match.ALL if isinstance(connective, ast.And) else Match.ANY), False
        one = self._comparison(test)
        kind = self._kind(one.what)
        if one.what.parameter or one.operator not in (Operator.EQUAL, Operator.DIFFERENT) or kind not in BRANCHABLE:
            return Comparisons((one,)), False
        if one.operator is Operator.DIFFERENT and more:
            return Comparisons((one,)), False
        assert not isinstance(one.value, float), "a double is not compared by =="
        return Condition(one.what.action, one.what.output, one.value), one.operator is Operator.DIFFERENT

    def _comparison(self, test: ast.expr) -> Comparison:
        """Read one comparison, such as `passed`, `not passed`, `n > 3` or `3 <= n < 7`."""
        value: Value
        upper: Value | None = None
        match test:
            case ast.Name(variable):
                operator, value = Operator.EQUAL, True
            case ast.UnaryOp(ast.Not(), ast.Name(variable)):
                operator, value = Operator.EQUAL, False
            case ast.Compare(ast.Name(variable), [symbol], [right]) if type(symbol) in _OPERATORS:
                operator, value = _OPERATORS[type(symbol)], self._values.compared(right)
            case ast.Compare(left, [symbol], [ast.Name(variable)]) if type(symbol) in _OPERATORS:
                operator, value = _MIRRORED[_OPERATORS[type(symbol)]], self._values.compared(left)
            case ast.Compare(lower, [first, second], [ast.Name(variable), right]) if (
                symbols := (_OPERATORS.get(type(first)), _OPERATORS.get(type(second)))
            ) in _RANGES:
                operator = _RANGES[symbols]
                value, upper = self._values.compared(lower), self._values.compared(right)
                if symbols[0] in (Operator.GREATER, Operator.GREATER_EQUAL):
                    value, upper = upper, value
            case _:
                raise NotUnderstood(
                    test.lineno,
                    "a condition compares a result or a variable with values, and combines comparisons by `and` or by"
                    " `or`, but this is {test}",
                    test=excerpt(test),
                )
        if variable in self._results:
            what = Reference(*self._results[variable])
        elif variable in self._values.parameters and not self._is_hidden(variable):
            what = Reference(END_NODE, 0, self._values.parameters[variable][0])
        else:
            raise NotUnderstood(test.lineno, "{variable} is not a result of an action above", variable=variable)
        if isinstance(value, bool) and operator is Operator.DIFFERENT:
            operator, value = Operator.EQUAL, not value
        if isinstance(upper, bool | str):
            raise NotUnderstood(test.lineno, "{test} is not a range of numbers", test=excerpt(test))
        if (problem := comparison_problem(variable, self._kind(what), operator, value, upper)) is not None:
            raise NotUnderstood(test.lineno, "{problem}", problem=problem)
        return Comparison(what, operator, value, upper)

    def _is_hidden(self, name: str) -> bool:  # noqa: ARG002 - for functions
        """Return whether a parameter of the function has the name of a project parameter."""
        return False

    def _kind(self, what: Reference) -> str:
        """Return the type of a compared value."""
        if what.parameter:
            return next(kind for key, kind in self._values.parameters.values() if key == what.parameter)
        return self.calls[what.action].declared.returns[what.output]

    def kinds(self, conditions: Iterable[Comparisons]) -> dict[Reference, str]:
        """Return the types of the values that conditions compare."""
        return {one.what: self._kind(one.what) for condition in conditions for one in condition.comparisons}


def _same_result(one: Test, other: Test) -> bool:
    return isinstance(one, Condition) and isinstance(other, Condition) and one[:2] == other[:2]
