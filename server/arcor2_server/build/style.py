"""Formats a syntax tree as readable source code with blank lines, comments, double quotes and short lines."""

import ast
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

LINE: Final = 110
_INDENT: Final = "    "
_STRING: Final = re.compile(r"""'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*\"""")
_BLOCKS: Final = (ast.If, ast.While, ast.With, ast.Try, ast.FunctionDef)


def quoted(value: str) -> str:
    """Return a string literal, in double quotes unless the string contains double quotes."""
    shown = repr(value)
    return f'"{shown[1:-1]}"' if shown[0] == "'" and '"' not in shown else shown


def _constant(node: ast.Constant) -> str:
    value = node.value
    # Python has no literal for infinity.
    return quoted(value) if type(value) is str else repr(value).replace("inf", "1e309")


def _call(node: ast.Call) -> str:
    arguments = [*map(_unparse, node.args), *map(_keyword, node.keywords)]
    return f"{_unparse(node.func)}({', '.join(arguments)})"


def _keyword(node: ast.keyword) -> str:
    return f"{node.arg}={_unparse(node.value)}"


def _lambda(node: ast.Lambda) -> str:
    """Return a function without parameters."""
    return f"lambda: {_unparse(node.body)}"


def _name(node: ast.Name) -> str:
    return node.id


def _attribute(node: ast.Attribute) -> str:
    return f"{_unparse(node.value)}.{node.attr}"


def _assign(node: ast.Assign) -> str:
    return f"{_target(node.targets[0])} = {_unparse(node.value)}"


def _target(node: ast.expr) -> str:
    return ", ".join(map(_unparse, node.elts)) if isinstance(node, ast.Tuple) else _unparse(node)


def _expression(node: ast.Expr) -> str:
    return _unparse(node.value)


_SYMBOLS: Final[dict[type[ast.cmpop], str]] = {
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
}


def _compare(node: ast.Compare) -> str:
    rest = zip(node.ops, node.comparators, strict=True)
    return " ".join([_unparse(node.left), *(f"{_SYMBOLS[type(op)]} {_unparse(right)}" for op, right in rest)])


def _combined(node: ast.BoolOp) -> str:
    """Return comparisons combined by `and` or `or`, which need no parentheses."""
    return (" and " if isinstance(node.op, ast.And) else " or ").join(map(_unparse, node.values))


def _unary(node: ast.UnaryOp) -> str:
    operand = _unparse(node.operand)
    if isinstance(node.op, ast.Not):
        return f"not ({operand})" if isinstance(node.operand, ast.BoolOp) else f"not {operand}"
    return f"-{operand}"


_FREQUENT: Final[dict[type[ast.AST], Callable[[Any], str]]] = {
    ast.Assign: _assign,
    ast.Attribute: _attribute,
    ast.BoolOp: _combined,
    ast.Call: _call,
    ast.Compare: _compare,
    ast.Constant: _constant,
    ast.Expr: _expression,
    ast.Lambda: _lambda,
    ast.Name: _name,
    ast.UnaryOp: _unary,
    ast.keyword: _keyword,
}
"""Writers of the nodes in a generated loop. `ast.unparse` supports all nodes, but is ten times slower."""


def _unparse(node: ast.AST) -> str:
    """Return the code of a one-line node of a generated tree, which never needs parentheses."""
    write = _FREQUENT.get(type(node))
    # The code has no comments, so that a quote always starts a string.
    return write(node) if write is not None else _STRING.sub(_in_quotes, ast.unparse(node))


def _in_quotes(match: re.Match[str]) -> str:
    found = match[0]
    return found if found[0] == '"' or '"' in found else f'"{found[1:-1]}"'


def docstring(text: str) -> str:
    """Return text as a one-line docstring."""
    plain = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return '"""' + plain.replace("\\", "\\\\").replace('"', '\\"') + '"""'


def _simple(node: ast.stmt, indent: str) -> list[str]:
    """Return the lines of a simple statement. A call that is too long has one argument per line."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
        return [indent + docstring(node.value.value)]
    text = indent + _unparse(node)
    call = node.value if isinstance(node, ast.Expr | ast.Assign) else None
    if len(text) <= LINE or not isinstance(call, ast.Call) or not (call.args or call.keywords):
        return [text]
    target = f"{_target(node.targets[0])} = " if isinstance(node, ast.Assign) else ""
    arguments = [*call.args, *call.keywords]
    return [
        f"{indent}{target}{_unparse(call.func)}(",
        *(f"{indent}{_INDENT}{_unparse(argument)}," for argument in arguments),
        f"{indent})",
    ]


def _condition(word: str, test: ast.expr, indent: str) -> list[str]:
    """Return the lines of `if` or `elif`. A condition that is too long has one comparison per line."""
    text = f"{indent}{word} {_unparse(test)}:"
    negated = isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not)
    combined = test.operand if isinstance(test, ast.UnaryOp) and negated else test
    if len(text) <= LINE or not isinstance(combined, ast.BoolOp):
        return [text]
    connective = "and " if isinstance(combined.op, ast.And) else "or "
    parts = [
        f"{indent}{_INDENT}{connective if number else ''}{_unparse(value)}"
        for number, value in enumerate(combined.values)
    ]
    return [f"{indent}{word}{' not' if negated else ''} (", *parts, f"{indent}):"]


def _signature(node: ast.FunctionDef, indent: str) -> list[str]:
    """Return the first lines of a function. A signature that is too long has one parameter per line."""
    returns = f" -> {_unparse(node.returns)}" if node.returns else ""
    text = f"{indent}def {node.name}({_unparse(node.args)}){returns}:"
    if len(text) <= LINE:
        return [text]
    keyword_only = [_unparse(one) for one in node.args.kwonlyargs]
    parameters = [*map(_unparse, node.args.args), *(["*"] if keyword_only else []), *keyword_only]
    lines = [f"{indent}{_INDENT}{parameter}," for parameter in parameters]
    return [f"{indent}def {node.name}(", *lines, f"{indent}){returns}:"]


def _reads(test: ast.expr, before: ast.stmt) -> bool:
    """Return whether a condition uses a variable that the previous statement assigns."""
    if not isinstance(before, ast.Assign):
        return False
    assigned = {name.id for target in before.targets for name in ast.walk(target) if isinstance(name, ast.Name)}
    return any(isinstance(name, ast.Name) and name.id in assigned for name in ast.walk(test))


class Writer:
    """Writes a module.

    Args:
        comments: the comment above a statement.
    """

    unit: str = _INDENT
    """The indentation of a block."""

    def __init__(self, comments: Mapping[ast.stmt, str]) -> None:
        self._comments = comments
        self._lines: list[str] = []

    def module(self, module: ast.Module) -> str:
        """Return the source code of the module."""
        self._block(module.body, "")
        return "\n".join(self._lines) + "\n"

    def statements(self, body: Sequence[ast.stmt], indent: str) -> list[str]:
        """Return the lines of statements."""
        self._lines = []
        self._block(body, indent)
        return self._lines

    def _block(self, body: Sequence[ast.stmt], indent: str) -> None:
        before: ast.stmt | None = None
        for node in body:
            self._above(before, node, indent)
            self._statement(node, indent)
            before = node

    def _above(self, before: ast.stmt | None, node: ast.stmt, indent: str) -> None:
        """Write the blank lines and the comment above a statement."""
        comment = self._comments.get(node)
        if before is not None:
            self._lines += [""] * self._distance(before, node, indent, commented=comment is not None)
        if comment is not None:
            self._lines.append(f"{indent}# {comment}")

    def _head(self, node: ast.stmt, lines: Sequence[str], indent: str) -> None:  # noqa: ARG002 - for derived classes
        """Write a simple statement, or the head of a compound one."""
        self._lines += lines

    def _part(self, node: ast.stmt, key: object, body: Sequence[ast.stmt], indent: str, head: str = "") -> None:  # noqa: ARG002
        """Write a block of a compound statement, and the line above it; `key` is "body", "else", or a number."""
        if head:
            self._lines.append(f"{indent}{head}")
        self._block(body, indent + self.unit)

    def _alternative(self, node: ast.If, branch: ast.If, indent: str) -> None:  # noqa: ARG002 - for derived classes
        """Write the head of `branch`, which is an `elif` of `node`."""
        self._head(branch, _condition("elif", branch.test, indent), indent)

    @staticmethod
    def _distance(before: ast.stmt, node: ast.stmt, indent: str, *, commented: bool) -> int:
        """Return the number of blank lines between two statements of a block."""
        if not indent:
            if isinstance(before, ast.FunctionDef) or isinstance(node, ast.FunctionDef):
                return 2
            return int(type(before) is not type(node))
        if isinstance(node, ast.If) and not isinstance(before, _BLOCKS):
            return int(commented or not _reads(node.test, before))
        return int(commented or isinstance(before, _BLOCKS) or isinstance(node, _BLOCKS))

    def _statement(self, node: ast.stmt, indent: str) -> None:
        match node:
            case ast.If():
                self._head(node, _condition("if", node.test, indent), indent)
                branch = node
                while True:
                    self._part(branch, "body", branch.body, indent)
                    match branch.orelse:
                        case [ast.If() as following]:
                            self._alternative(branch, following, indent)
                            branch = following
                        case []:
                            return
                        case rest:
                            self._part(branch, "else", rest, indent, "else:")
                            return
            case ast.While():
                self._head(node, [f"{indent}while {_unparse(node.test)}:"], indent)
                self._part(node, "body", node.body, indent)
            case ast.With():
                self._head(node, [f"{indent}with {', '.join(map(_unparse, node.items))}:"], indent)
                self._part(node, "body", node.body, indent)
            case ast.Try():
                self._head(node, [f"{indent}try:"], indent)
                self._part(node, "body", node.body, indent)
                for number, handler in enumerate(node.handlers):
                    kind = f" {_unparse(handler.type)}" if handler.type else ""
                    head = f"except{kind}{f' as {handler.name}' if handler.name else ''}:"
                    self._part(node, number, handler.body, indent, head)
                if node.orelse:
                    self._part(node, "else", node.orelse, indent, "else:")
            case ast.FunctionDef():
                decorators = [f"{indent}@{_unparse(decorator)}" for decorator in node.decorator_list]
                self._head(node, [*decorators, *_signature(node, indent)], indent)
                self._part(node, "body", node.body, indent)
            case _:
                self._head(node, _simple(node, indent), indent)
