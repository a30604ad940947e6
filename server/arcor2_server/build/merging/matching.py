"""Finds for each generated statement the statement of a script that it replaces."""

import ast
from collections import defaultdict
from collections.abc import Hashable, Iterator, Sequence

from arcor2_server.build.frame import NEXT_ACTION
from arcor2_server.build.merging.equivalence import action_name, condition, negated
from arcor2_server.build.merging.text import Block, Statement

Parts = list[tuple[object, list[ast.stmt]]]


def parts_of(node: ast.stmt) -> Parts:
    """Return the blocks of a compound statement with the keys of `Block`; none for a simple statement."""
    match node:
        case ast.If():
            return [("body", node.body), ("else", node.orelse)]
        case ast.While() | ast.With() | ast.FunctionDef():
            return [("body", node.body)]
        case ast.Try():
            handlers: Parts = [(number, handler.body) for number, handler in enumerate(node.handlers)]
            return [("body", node.body), *handlers, ("else", node.orelse)]
    return []


def walk(body: Sequence[ast.stmt]) -> Iterator[ast.stmt]:
    """Return the statements of blocks in their order."""
    stack = [iter(body)]
    while stack:
        for node in stack[-1]:
            yield node
            parts = parts_of(node)
            if parts:
                stack.append(iter([each for _, nodes in parts for each in nodes]))
                break
        else:
            stack.pop()


def names_in(node: ast.stmt) -> list[str]:
    """Return the names of the actions in a statement."""
    return [name for each in walk([node]) if (name := action_name(each))]


def _key(node: ast.stmt) -> Hashable | None:
    """Return the key that identifies a statement in a script; None if only its position identifies it."""
    if name := action_name(node):
        return "call", name
    match node:
        case ast.Try(body=[call, *_]):
            return "try", action_name(call)
        case ast.FunctionDef(name=name):
            return "function", name
        case ast.If(test=test):
            return "if", condition(test)
        case ast.While():
            return ("while",)
        case ast.Assign([ast.Name(name)], _) | ast.AnnAssign(ast.Name(name)) if name != NEXT_ACTION:
            match node.value:
                case ast.Subscript(_, ast.Constant(str(object_id))):
                    return "object", object_id
                case ast.Call(ast.Attribute(_, "caught")):
                    return None
            return "name", name
    return None


class Matching:
    """Pairs of generated and written statements of the function `main`.

    Actions, functions, objects and variables are found by their name, conditions by what they compare. Other
    statements, and renamed actions, are found by their neighbours.

    Args:
        generated: the generated function.
        written: the function in the script.
        exchange: whether to exchange the branches of a generated condition if the script states the opposite one.
    """

    def __init__(self, generated: ast.FunctionDef, written: Statement, *, exchange: bool = True) -> None:
        self.written: dict[ast.stmt, Statement] = {generated: written}
        """The written statement of each generated one."""
        self.generated: dict[Statement, ast.stmt] = {written: generated}
        self._exchange = exchange
        self._by_key: dict[Hashable, list[Statement]] = defaultdict(list)
        for statement in written.inside():
            if (key := _key(statement.node)) is not None:
                self._by_key[key].append(statement)
        for found in self._by_key.values():
            found.reverse()
        self._by_keys(generated.body)
        self._by_actions(generated.body)
        self._by_neighbours(generated)

    def _pair(self, node: ast.stmt, statement: Statement) -> None:
        self.written[node] = statement
        self.generated[statement] = node

    def _by_keys(self, body: Sequence[ast.stmt]) -> None:
        for node in walk(body):
            key = _key(node)
            if key is None:
                continue
            if found := self._by_key.get(key):
                self._pair(node, found.pop())
            elif self._exchange and isinstance(node, ast.If) and node.body and len(node.orelse) > 0:
                self._exchanged(node)

    def _by_actions(self, body: Sequence[ast.stmt]) -> None:
        """Pair renamed functions, which contain actions of functions whose names are missing."""
        missing = {
            action_name(inner.node): statement
            for statements in self._by_key.values()
            for statement in statements
            if isinstance(statement.node, ast.FunctionDef)
            for inner in statement.inside()
        }
        for node in body:
            if isinstance(node, ast.FunctionDef) and node not in self.written:
                found = next((missing[name] for name in names_in(node) if name in missing), None)
                if found is not None and found not in self.generated:
                    self._pair(node, found)

    def _exchanged(self, node: ast.If) -> None:
        """Exchange the branches of a generated condition if the script states the opposite one."""
        opposite = negated(condition(node.test))
        found = self._by_key.get(("if", opposite))
        if not found or (len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If)):
            return
        other = found[-1].node
        if isinstance(other, ast.If) and other.orelse and not isinstance(other.orelse[0], ast.If):
            self._pair(node, found.pop())
            node.test, node.body, node.orelse = other.test, node.orelse, node.body

    def _by_neighbours(self, owner: ast.stmt) -> None:
        statement = self.written.get(owner)
        for key, body in parts_of(owner):
            block = None if statement is None else statement.part(key)
            for number, node in enumerate(body):
                if node not in self.written:
                    following = body[number + 1 :]
                    self._by_place(node, body[number - 1] if number else None, following[:1], block)
                self._by_neighbours(node)

    def _by_place(
        self, node: ast.stmt, before: ast.stmt | None, following: Sequence[ast.stmt], block: Block | None
    ) -> None:
        candidates: list[Statement | None] = []
        if before is not None:
            if (previous := self.written.get(before)) is not None:
                candidates.append(previous.next)
        elif block is not None and block.statements:
            candidates.append(block.statements[0])
        candidates += [self.written[one].previous for one in following if one in self.written]
        for candidate in candidates:
            if candidate is not None and candidate not in self.generated and _may_replace(node, candidate.node):
                self._pair(node, candidate)
                return


def _may_replace(node: ast.stmt, written: ast.stmt) -> bool:
    """Return whether a generated statement may be a changed form of a written one."""
    match node, written:
        case (ast.If(), ast.If()) | (ast.Continue(), ast.Continue()) | (ast.Return(), ast.Return()):
            return True
        case (ast.Pass(), ast.Pass()) | (ast.Try(), ast.Try()):
            return True
    if bool(action_name(node)) != bool(action_name(written)):
        return False
    if action_name(node):
        return _function(node) == _function(written)
    return isinstance(node, ast.Assign | ast.AnnAssign | ast.Expr) and isinstance(
        written, ast.Assign | ast.AnnAssign | ast.Expr
    )


def _function(node: ast.stmt) -> str:
    call = getattr(node, "value", None)
    return ast.dump(call.func) if isinstance(call, ast.Call) else ""
