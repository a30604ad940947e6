"""Constants in a source: literals, names of literals, members of enumerations, simple arithmetic."""

import ast
import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from arcor2_hw.analysis.module import ClassInfo, Module, Value
from arcor2_hw.analysis.source import AnalysisStopped
from arcor2_hw.analysis.symbols import Constant, External, Resolver, framework_name

_BINARY: Final[dict[type[ast.operator], Callable[[Any, Any], Any]]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_EXTERNAL: Final = {"math.pi": math.pi, "math.tau": math.tau, "math.e": math.e, "math.inf": math.inf}
_SETS: Final[dict[str, Callable[..., Any]]] = {"builtins.set": set, "builtins.frozenset": frozenset}
_DEPTH: Final = 40


@dataclass(frozen=True, slots=True)
class EnumMember:
    """A member of an enumeration."""

    owner: ClassInfo
    name: str
    value: str | int


def enum_kind(info: ClassInfo, resolver: Resolver, depth: int = _DEPTH) -> str | None:
    """Return StrEnum or IntEnum for an enumeration derived from ours, None for any other class."""
    for base in info.node.bases:
        symbol = resolver.expression(base, info.module)
        name = framework_name(symbol)
        if name in ("StrEnum", "IntEnum"):
            return name
        if isinstance(symbol, ClassInfo) and depth > 0 and (kind := enum_kind(symbol, resolver, depth - 1)):
            return kind
    return None


def enum_members(info: ClassInfo, resolver: Resolver) -> dict[str, str | int] | None:
    """Return the members of an enumeration by name, None for any other class.

    Raises:
        AnalysisStopped: A value cannot be determined from the source.
    """
    kind = enum_kind(info, resolver)
    if kind is None:
        return None
    result: dict[str, str | int] = {}
    for name, member in info.members.items():
        if name.startswith("_") or not isinstance(member, Value) or member.expression is None:
            continue
        value: Any
        if _is_auto(member.expression, info, resolver):
            number = max((v for v in result.values() if isinstance(v, int)), default=0) + 1
            value = name.lower() if kind == "StrEnum" else number
        else:
            value = constant(member.expression, info.module, info, resolver)
        if type(value) is not (str if kind == "StrEnum" else int):
            raise info.problem(
                "{cls}.{name} must be a member of type {type}, not {value!r:.40}",
                member.expression,
                cls=info.name,
                name=name,
                type=kind,
                value=value,
            )
        result[name] = value
    return result


def _is_auto(expression: ast.expr, info: ClassInfo, resolver: Resolver) -> bool:
    return isinstance(expression, ast.Call) and resolver.expression(expression.func, info.module) == External(
        "enum.auto"
    )


def constant(
    expression: ast.expr, module: Module, owner: ClassInfo | None, resolver: Resolver, depth: int = _DEPTH
) -> Any:
    """Return the value of an expression.

    Raises:
        AnalysisStopped: The value cannot be determined without running the code; the error has the line.
    """

    def again(part: ast.expr) -> Any:
        return constant(part, module, owner, resolver, depth - 1)

    if depth <= 0:
        raise _unreadable(expression, module)
    try:
        match expression:
            case ast.Constant(value=value):
                return value
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -again(operand)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return +again(operand)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return not again(operand)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                a, b = again(left), again(right)
                if type(a) in (int, float) and type(b) in (int, float):
                    return _BINARY[type(op)](a, b)
            case ast.Tuple(elts=elements):
                return tuple(again(element) for element in elements)
            case ast.List(elts=elements):
                return [again(element) for element in elements]
            case ast.Set(elts=elements):
                return {again(element) for element in elements}
            case ast.Dict(keys=keys, values=values) if None not in keys:
                return {again(key): again(value) for key, value in zip(keys, values, strict=True) if key is not None}
            case ast.Call(func=func, args=arguments, keywords=[]):
                symbol = resolver.expression(func, module, owner)
                if framework_name(symbol) == "DynamicParamTuple":
                    return tuple(again(argument) for argument in arguments)
                if isinstance(symbol, External) and symbol.dotted in _SETS:
                    return _SETS[symbol.dotted](*(again(argument) for argument in arguments))
            case ast.Attribute(value=function, attr="__name__") if _last(function):
                return _last(function)
            case ast.Attribute(value=inner, attr="value"):
                member = again(inner)
                if isinstance(member, EnumMember):
                    return member.value
            case ast.Name() | ast.Attribute():
                return _named(expression, module, owner, resolver, depth)
            case _:
                pass
    except (TypeError, ValueError, ArithmeticError):
        raise _unreadable(expression, module) from None
    raise _unreadable(expression, module)


def _unreadable(expression: ast.expr, module: Module) -> AnalysisStopped:
    text = "the value {value} cannot be determined from the source"
    return module.problem(text, expression.lineno, value=_shown(expression))


def _named(expression: ast.expr, module: Module, owner: ClassInfo | None, resolver: Resolver, depth: int) -> Any:
    symbol = resolver.expression(expression, module, owner)
    match symbol:
        case External(dotted=dotted) if dotted in _EXTERNAL:
            return _EXTERNAL[dotted]
        case Constant(value=value, module=where, owner=inside):
            if inside is not None and isinstance(expression, ast.Attribute):
                members = enum_members(inside, resolver) if enum_kind(inside, resolver) else None
                if members is not None and expression.attr in members:
                    return EnumMember(inside, expression.attr, members[expression.attr])
            if value.expression is not None:
                return constant(value.expression, where, inside, resolver, depth - 1)
        case _:
            pass
    raise _unreadable(expression, module)


def _last(expression: ast.expr) -> str:
    match expression:
        case ast.Name(id=name):
            return name
        case ast.Attribute(attr=name):
            return name
        case _:
            return ""


def _shown(expression: ast.expr) -> str:
    try:
        text = ast.unparse(expression)
    except (RecursionError, ValueError):
        return "here"
    return text if len(text) <= 60 else f"{text[:57]}..."
