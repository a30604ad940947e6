"""Reads the conditions in a script."""

import ast
from collections.abc import Mapping
from typing import Final

from arcor2_hw.data.project import Match, Operator
from arcor2_server.build.reading.errors import NotUnderstood, excerpt
from arcor2_server.build.reading.scope import Scope
from arcor2_server.documents.comparisons import (
    RANGES,
    Comparison,
    Comparisons,
    Reference,
    Value,
    comparison_problem,
    pair_problem,
)
from arcor2_server.documents.logic_graph import BRANCHABLE, END_NODE, Condition, Test

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


class ConditionReader:
    """Reads the conditions of a loop or function."""

    def __init__(self, scope: Scope) -> None:
        self._scope = scope

    def read(self, test: ast.expr, *, more: bool) -> tuple[Test, bool]:
        """Return a condition, and whether it is negated: by `not`, or by a single `!=` that no other branch follows."""
        match test:
            case ast.UnaryOp(ast.Not(), operand) if not isinstance(operand, ast.Name):
                condition, negated = self.read(operand, more=False)
                return condition, not negated
            case ast.BoolOp(connective, values):
                found = tuple(self._comparison(value) for value in values)
                if len(set(found)) != len(found):
                    raise NotUnderstood(test.lineno, "{test} contains a comparison twice", test=excerpt(test))
                return Comparisons(found, Match.ALL if isinstance(connective, ast.And) else Match.ANY), False
        one = self._comparison(test)
        kind = self._scope.kind(one.what)
        if (
            one.other is not None
            or one.what.parameter
            or one.operator not in (Operator.EQUAL, Operator.DIFFERENT)
            or kind not in BRANCHABLE
        ):
            return Comparisons((one,)), False
        if one.operator is Operator.DIFFERENT and more:
            return Comparisons((one,)), False
        assert not isinstance(one.value, float), "a double is not compared by =="
        return Condition(one.what.action, one.what.output, one.value), one.operator is Operator.DIFFERENT

    def _comparison(self, test: ast.expr) -> Comparison:
        """Read one comparison, such as `passed`, `not passed`, `n > 3` or `3 <= n < 7`."""
        value: Value
        upper: Value | None = None
        if (pair := self._pair(test)) is not None:
            return pair
        match test:
            case ast.Name(variable):
                operator, value = Operator.EQUAL, True
            case ast.UnaryOp(ast.Not(), ast.Name(variable)):
                operator, value = Operator.EQUAL, False
            case ast.Compare(ast.Name(variable), [symbol], [right]) if type(symbol) in _OPERATORS:
                operator, value = _OPERATORS[type(symbol)], self._scope.values.compared(right)
            case ast.Compare(left, [symbol], [ast.Name(variable)]) if type(symbol) in _OPERATORS:
                operator, value = _MIRRORED[_OPERATORS[type(symbol)]], self._scope.values.compared(left)
            case ast.Compare(lower, [first, second], [ast.Name(variable), right]) if (
                symbols := (_OPERATORS.get(type(first)), _OPERATORS.get(type(second)))
            ) in _RANGES:
                operator = _RANGES[symbols]
                value, upper = self._scope.values.compared(lower), self._scope.values.compared(right)
                if symbols[0] in (Operator.GREATER, Operator.GREATER_EQUAL):
                    value, upper = upper, value
            case _:
                raise NotUnderstood(
                    test.lineno,
                    "a condition compares a result or a variable with values, and combines comparisons by `and` or by"
                    " `or`, but this is {test}",
                    test=excerpt(test),
                )
        what = self._reference(variable, test)
        if isinstance(value, bool) and operator is Operator.DIFFERENT:
            operator, value = Operator.EQUAL, not value
        if isinstance(upper, bool | str):
            raise NotUnderstood(test.lineno, "{test} is not a range of numbers", test=excerpt(test))
        if (problem := comparison_problem(variable, self._scope.kind(what), operator, value, upper)) is not None:
            raise NotUnderstood(test.lineno, "{problem}", problem=problem)
        return Comparison(what, operator, value, upper)

    def _pair(self, test: ast.expr) -> Comparison | None:
        """Read a comparison of two values, such as `count >= limit`; None for other expressions."""
        match test:
            case ast.Compare(ast.Name(variable), [symbol], [ast.Name(other)]) if type(symbol) in _OPERATORS:
                operator = _OPERATORS[type(symbol)]
            case _:
                return None
        what, compared = self._reference(variable, test), self._reference(other, test)
        if what == compared:
            raise NotUnderstood(test.lineno, "{test} compares a value with itself", test=excerpt(test))
        kinds = self._scope.kind(what), self._scope.kind(compared)
        if (problem := pair_problem(variable, kinds[0], operator, other, kinds[1])) is not None:
            raise NotUnderstood(test.lineno, "{problem}", problem=problem)
        return Comparison(what, operator, "", None, compared)

    def _reference(self, variable: str, test: ast.expr) -> Reference:
        """Return the result or project parameter of a variable in a condition."""
        if variable in self._scope.results:
            return Reference(*self._scope.results[variable])
        if variable in self._scope.values.parameters and self._scope.parameter(variable) is None:
            return Reference(END_NODE, 0, self._scope.values.parameters[variable][0])
        raise NotUnderstood(test.lineno, "{variable} is not a result of an action above", variable=variable)
