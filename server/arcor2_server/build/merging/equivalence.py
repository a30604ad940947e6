"""Decides whether a generated statement and a hand-written statement are equivalent."""

import ast
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

_MIRRORED: Final[Mapping[type[ast.cmpop], type[ast.cmpop]]] = {
    ast.Eq: ast.Eq,
    ast.NotEq: ast.NotEq,
    ast.Lt: ast.Gt,
    ast.LtE: ast.GtE,
    ast.Gt: ast.Lt,
    ast.GtE: ast.LtE,
}
_PLAIN: Final[Mapping[type[ast.cmpop], type[ast.cmpop]]] = {ast.Is: ast.Eq, ast.IsNot: ast.NotEq}
_OPPOSITE: Final = {ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}

Meaning = tuple[Any, ...]


class DeclaredParameter(NamedTuple):
    """A parameter of the method or function that an action calls, with the expression for its default value."""

    name: str
    type: str
    default: ast.expr | None = None


DeclaredOf = Callable[[str], Sequence[DeclaredParameter]]
"""Returns the parameters of the method or function that the action with a name calls."""


def action_name(node: ast.AST) -> str:
    """Return the name of the action that a statement or call runs, empty if it runs none."""
    call = node.value if isinstance(node, ast.Expr | ast.Assign | ast.AnnAssign) else node
    if isinstance(call, ast.Call) and call.keywords:
        for keyword in reversed(call.keywords):
            if keyword.arg == "an" and isinstance(keyword.value, ast.Constant) and isinstance(keyword.value.value, str):
                return keyword.value.value
    return ""


# ---------------------------------------------------------------------------------------------- conditions
def condition(test: ast.expr) -> Meaning:
    """Return the normal form of a condition, which is the same for `not x`, `x == False` and `False == x`."""
    match test:
        case ast.Name(name):
            return ast.Eq, name, _value(True)
        case ast.UnaryOp(ast.Not(), operand):
            return negated(condition(operand))
        case ast.BoolOp(connective, values):
            return type(connective), *map(condition, values)
        case ast.Compare(left, [symbol], [right]):
            kind = _PLAIN.get(type(symbol), type(symbol))
            if isinstance(right, ast.Name) and not isinstance(left, ast.Name):
                kind, left, right = _MIRRORED.get(kind, kind), right, left
            if isinstance(right, ast.Constant) and isinstance(right.value, bool) and kind is ast.NotEq:
                kind, right = ast.Eq, ast.Constant(not right.value)
            return kind, _text(left), _text(right)
        case ast.Compare(lower, [first, second], [middle, upper]):
            above, below = type(first), type(second)
            if above in (ast.Gt, ast.GtE):
                lower, above, below, upper = upper, _MIRRORED[below], _MIRRORED[above], lower
            return above, below, _text(lower), _text(middle), _text(upper)
    return (_text(test),)


def negated(meaning: Meaning) -> Meaning:
    """Return the form of the opposite condition."""
    match meaning:
        case (kind, str(left), tuple() as value) if kind is ast.Eq and value[:1] == (bool,):
            return kind, left, (bool, not value[1])
        case (kind, left, right) if kind in _OPPOSITE:
            return _OPPOSITE[kind], left, right
        case (first, inner) if first is ast.Not:
            found: Meaning = inner
            return found
    return ast.Not, meaning


def _value(value: object) -> Meaning:
    return type(value), value


def _text(node: ast.expr) -> Any:
    match node:
        case ast.Name(name):
            return name
        case ast.Attribute(value, attribute):
            return _text(value), attribute
        case ast.Constant(value):
            return _value(value)
        case ast.UnaryOp(ast.USub(), ast.Constant(int() | float() as value)):
            return _value(-value)
    return ast.dump(node)


# ---------------------------------------------------------------------------------------------- statements
def same(generated: ast.stmt, written: ast.stmt, declared: DeclaredOf) -> bool:
    """Return whether two simple statements, or the heads of two compound statements, are equivalent."""
    match generated, written:
        case (ast.If(test=one), ast.If(test=other)):
            return condition(one) == condition(other)
        case (ast.While(test=one), ast.While(test=other)):
            return ast.dump(one) == ast.dump(other)
        case (ast.Try(), ast.Try()):
            return True
        case (ast.FunctionDef(), ast.FunctionDef()):
            return all(
                _dump(getattr(generated, part)) == _dump(getattr(written, part))
                for part in ("name", "args", "returns", "decorator_list")
            )
    if name := action_name(generated):
        return name == action_name(written) and _same_call(generated, written, declared(name))
    return ast.dump(generated) == ast.dump(written)


def _dump(value: Any) -> Any:
    if isinstance(value, list):
        return [_dump(each) for each in value]
    return ast.dump(value) if isinstance(value, ast.AST) else value


def _parts(node: ast.stmt) -> tuple[ast.expr | None, ast.Call | None]:
    match node:
        case ast.Expr(ast.Call() as call):
            return None, call
        case ast.Assign([target], ast.Call() as call) | ast.AnnAssign(target, _, ast.Call() as call):
            return target, call
    return None, None


def _same_call(generated: ast.stmt, written: ast.stmt, declared: Sequence[DeclaredParameter]) -> bool:
    """Return whether two calls have the same target, function and arguments, by position or by name."""
    (target, call), (other_target, other) = _parts(generated), _parts(written)
    if call is None or other is None or _text(call.func) != _text(other.func) or _names(target) != _names(other_target):
        return False
    given, found = _arguments(call, declared), _arguments(other, declared)
    defaults = {one.name: _argument(one.default, one.type) for one in declared if one.default is not None}
    if any(name not in defaults or given[name] != defaults[name] for name in given.keys() - found.keys()):
        return False
    return all(given.get(name) == value for name, value in found.items())


def _names(target: ast.expr | None) -> Any:
    if isinstance(target, ast.Tuple):
        return [_text(each) for each in target.elts]
    return None if target is None else _text(target)


def _arguments(call: ast.Call, declared: Sequence[DeclaredParameter]) -> dict[str, Any]:
    """Return the arguments of a call by parameter; a number for a double is a float."""
    kinds = {one.name: one.type for one in declared}
    named = [(one.name, node) for one, node in zip(declared, call.args, strict=False)]
    named += [(keyword.arg or "**", keyword.value) for keyword in call.keywords]
    return {name: _argument(node, kinds.get(name, "")) for name, node in named}


def _argument(node: ast.expr, kind: str) -> Any:
    found = _text(node)
    if kind == "double" and isinstance(found, tuple) and found[0] is int:
        return _value(float(found[1]))
    return found
