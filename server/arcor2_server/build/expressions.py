"""Syntax tree nodes of generated scripts. Nodes are cached and shared: never modify them."""

import ast
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

from arcor2_hw.data.project import Match, Operator
from arcor2_server.documents.comparisons import RANGES, Comparison, Comparisons, Value, inverse

_LOAD: Final = ast.Load()
_STORE: Final = ast.Store()


@lru_cache(maxsize=1024)
def name(name: str) -> ast.Name:
    """Return a variable that is read."""
    return ast.Name(name, _LOAD)


def target(name: str) -> ast.Name:
    """Return a variable that is assigned."""
    return ast.Name(name, _STORE)


def assign(name: str, value: ast.expr) -> ast.Assign:
    """Return `name = value`."""
    return ast.Assign([target(name)], value, lineno=0)


def annotated(name: str, kind: str, value: ast.expr) -> ast.AnnAssign:
    """Return `name: kind = value`."""
    return ast.AnnAssign(target(name), ast.Name(kind, _LOAD), value, 1)


@lru_cache(maxsize=4096)
def dotted(first: str, parts: tuple[str, ...]) -> ast.expr:
    """Return `first.part.part`."""
    if not parts:
        return name(first)
    return ast.Attribute(dotted(first, parts[:-1]), parts[-1], _LOAD)


def equals(variable: str, value: bool | int | str) -> ast.expr:
    """Return `variable == value`."""
    return ast.Compare(name(variable), [ast.Eq()], [ast.Constant(value)])


_AST: Final[dict[Operator, type[ast.cmpop]]] = {
    Operator.EQUAL: ast.Eq,
    Operator.DIFFERENT: ast.NotEq,
    Operator.LESS: ast.Lt,
    Operator.LESS_EQUAL: ast.LtE,
    Operator.GREATER: ast.Gt,
    Operator.GREATER_EQUAL: ast.GtE,
}


def _comparison(variables: Sequence[str], comparison: Comparison) -> ast.expr:
    variable, *others = variables
    if others:
        return ast.Compare(name(variable), [_AST[comparison.operator]()], [name(others[0])])
    if isinstance(comparison.value, bool):
        return name(variable) if comparison.value else ast.UnaryOp(ast.Not(), name(variable))
    if comparison.operator in RANGES:
        above, below = (_AST[operator]() for operator in RANGES[comparison.operator])
        return ast.Compare(_number(comparison.value), [above, below], [name(variable), _number(comparison.upper)])
    return ast.Compare(name(variable), [_AST[comparison.operator]()], [_number(comparison.value)])


def _number(value: Value | None) -> ast.expr:
    """Return a literal. A negative number is a unary minus, as in Python's syntax tree."""
    if isinstance(value, int | float) and value < 0:
        return ast.UnaryOp(ast.USub(), ast.Constant(-value))
    return ast.Constant(value)


def compares(variables: Sequence[Sequence[str]], condition: Comparisons, *, negated: bool = False) -> ast.expr:
    """Return a condition such as `3 <= n < 7 and passed`; `variables` are those of each comparison."""
    if negated and (other := inverse(condition)) is not None:
        return compares(variables, other)
    tests = [_comparison(*pair) for pair in zip(variables, condition.comparisons, strict=True)]
    connective = ast.And() if condition.match is Match.ALL else ast.Or()
    test = tests[0] if len(tests) == 1 else ast.BoolOp(connective, tests)
    return ast.UnaryOp(ast.Not(), test) if negated else test


def differs(variable: str, value: bool | int | str) -> ast.expr:
    """Return `variable != value`."""
    return ast.Compare(name(variable), [ast.NotEq()], [ast.Constant(value)])
