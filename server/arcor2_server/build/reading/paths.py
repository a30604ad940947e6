"""Reads the loop of a script as calls and the paths between them, with their conditions.

The reader follows the code in the order of execution, on all paths to a line at the same time. A path starts after a
call and ends at the next call or at the end of the cycle. It has at most one condition that is true, or several that
are false, and may set the variable `next_action` (see layout.py). A path through an `except` block starts at the error
exit of the call in the `try` block.
"""

import ast
from collections.abc import Sequence
from typing import Final, NamedTuple

from arcor2_server.build.frame import NEXT_ACTION, Frame
from arcor2_server.build.reading.calls import CallReader, ScriptCalls
from arcor2_server.build.reading.conditions import ConditionReader
from arcor2_server.build.reading.errors import NotUnderstood, excerpt
from arcor2_server.build.reading.parallel import parallel_call, read_parallel
from arcor2_server.build.reading.scope import Scope, Use
from arcor2_server.documents.logic_graph import (
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


class LoopReader:
    """The calls of a loop in the order of the code, and the paths by the number of the call where they start."""

    def __init__(self, frame: Frame, scope: Scope, shared: ScriptCalls, body: Sequence[ast.stmt]) -> None:
        self.scope = scope
        self.paths: dict[int, list[LogicPath]] = {START_NODE: []}
        self.exits: dict[int, list[ErrorExit]] = {}
        """The error exits by the number of the call."""
        self.parallel: dict[int, list[int]] = {}
        """The branches of each call of parallel work. They are a chain of paths after it."""
        self._calls = CallReader(frame, scope, shared)
        self._conditions = ConditionReader(scope)
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

    def _step(self, node: ast.stmt, open_paths: list[_OpenPath]) -> list[_OpenPath]:
        """Read a statement that calls one action, or several concurrently."""
        if (call := parallel_call(node, self.scope.script.resources)) is None:
            return self._reach(self._calls.read(node), open_paths)
        number, *branches = read_parallel(self._calls, self.scope, node, call)
        self.parallel[number] = branches
        for each in (number, *branches):
            open_paths = self._reach(each, open_paths)
        return open_paths

    def _reach(self, number: int, open_paths: list[_OpenPath]) -> list[_OpenPath]:
        """End all open paths at a call, and start one there."""
        self.paths[number] = []
        for path in open_paths:
            self._arrive(path, number)
        return [_OpenPath(number)]

    # ------------------------------------------------------------------------------------------------ error exits
    def _try(self, node: ast.Try, open_paths: list[_OpenPath]) -> list[_OpenPath]:
        number = len(self.scope.calls)
        match node.body:
            case [ast.Expr() | ast.Assign() | ast.AnnAssign() as step] if not node.finalbody and node.handlers:
                after = self._step(step, open_paths)
            case _:
                raise NotUnderstood(node.lineno, "a `try` block contains one call of an action, and has no `finally`")
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
            if variable and variable != self.scope.calls[number].error:
                if self.scope.calls[number].error:
                    raise NotUnderstood(
                        handler.lineno, "the error of an action has one name, not also {name}", name=variable
                    )
                self.scope.claim(variable, handler.lineno)
                self.scope.errors[variable] = number
                self.scope.calls[number].error = variable
            after = after + self._block(handler.body[1:], [_OpenPath(number, kinds=tuple(in_order_of_kinds(kinds)))])
        return after

    def _kinds(self, handler: ast.ExceptHandler) -> list[str]:
        classes = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
        found = [self.scope.script.errors.get(one.id) if isinstance(one, ast.Name) else None for one in classes]
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
                resources == self.scope.script.resources and error == handler.name
            ):
                return variable
        raise NotUnderstood(
            handler.lineno,
            "an `except` block starts with `[name =] {resources}.caught({error})`",
            resources=self.scope.script.resources,
            error=handler.name or "error",
        )

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
        condition, negated = self._conditions.read(test, more=more)
        opposite = condition._replace(value=not condition.value) if is_boolean(condition) else None
        holds: list[_OpenPath] = []
        others: list[_OpenPath] = []
        for path in open_paths:
            if path.source == START_NODE:
                raise NotUnderstood(test.lineno, "a condition needs the result of an action before it")
            if path.kinds:
                raise NotUnderstood(test.lineno, "an action is required between an error and a condition")
            for what in (what for one in as_comparisons(condition).comparisons for what in one.compared()):
                if not what.parameter:
                    output = self.scope.calls[what.action].outputs[what.output]
                    self.scope.uses.append(Use(path.source, what.action, test.lineno, output, in_condition=True))
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


def _same_result(test: Test, other: Test) -> bool:
    return isinstance(test, Condition) and isinstance(other, Condition) and test[:2] == other[:2]
