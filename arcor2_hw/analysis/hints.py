"""Type hints (PEP 484) as parameter types."""

import ast
from typing import Final

from arcor2_hw.actions.parameter_types import ParameterType, by_annotation
from arcor2_hw.analysis.constants import enum_kind
from arcor2_hw.analysis.module import ClassInfo, Module
from arcor2_hw.analysis.source import AnalysisStopped
from arcor2_hw.analysis.symbols import External, Resolver, Symbol, framework_name
from arcor2_hw.parsing import parse_expression

_SCALARS: Final = {"builtins.bool", "builtins.int", "builtins.float", "builtins.str"}
_PICTURE: Final = "PIL.Image.Image"


def plain(hint: ast.expr, module: Module) -> ast.expr:
    """Return a hint without quotes around it.

    Raises:
        AnalysisStopped: The quoted text is not an expression.
    """
    if isinstance(hint, ast.Constant) and isinstance(hint.value, str):
        try:
            return ast.copy_location(parse_expression(hint.value.strip()), hint)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise module.problem("{hint!r} is not a type hint", hint.lineno, hint=hint.value[:40]) from None
    return hint


def without_none(hint: ast.expr, module: Module, resolver: Resolver) -> tuple[ast.expr, bool]:
    """Return the type X of `X | None`, `Optional[X]` or `Union[X, None]`, and whether None is allowed."""
    hint = plain(hint, module)
    members = [plain(member, module) for member in _members(hint, module, resolver)]
    rest = [member for member in members if not _is_none(member)]
    if len(rest) == 1 and len(members) > 1:
        return rest[0], True
    return hint, False


def unannotated(hint: ast.expr, module: Module, resolver: Resolver) -> ast.expr:
    """Return the type X of `Annotated[X, ...]`, and any other hint as it is."""
    hint = plain(hint, module)
    match hint:
        case ast.Subscript(value=value, slice=ast.Tuple(elts=[first, *_])):
            if resolver.expression(value, module) == External("typing.Annotated"):
                return first
    return hint


def _members(hint: ast.expr, module: Module, resolver: Resolver) -> list[ast.expr]:
    match hint:
        case ast.BinOp(left=left, op=ast.BitOr(), right=right):
            return [*_members(plain(left, module), module, resolver), *_members(plain(right, module), module, resolver)]
        case ast.Subscript(value=value, slice=inner):
            match resolver.expression(value, module):
                case External(dotted="typing.Optional"):
                    return [*_members(plain(inner, module), module, resolver), ast.Constant(None)]
                case External(dotted="typing.Union"):
                    return list(inner.elts) if isinstance(inner, ast.Tuple) else [inner]
    return [hint]


def _is_none(hint: ast.expr) -> bool:
    return isinstance(hint, ast.Constant) and hint.value is None


def meaning(hint: ast.expr, module: Module, owner: ClassInfo | None, resolver: Resolver) -> Symbol | None:
    """Return the symbol that a hint names."""
    return resolver.expression(plain(hint, module), module, owner)


def parameter_type_of(
    hint: ast.expr, module: Module, owner: ClassInfo | None, resolver: Resolver
) -> tuple[ParameterType, ClassInfo | None]:
    """Return the parameter type of a hint, and its enumeration if it has one.

    Raises:
        AnalysisStopped: The hint is not a parameter type; the message names it.
    """
    symbol = meaning(hint, module, owner, resolver)
    found: ParameterType | None = None
    if isinstance(symbol, ClassInfo):
        kind = enum_kind(symbol, resolver)
        if kind is not None and (found := by_annotation(kind)) is not None:
            return found, symbol
    elif isinstance(symbol, External) and (symbol.dotted in _SCALARS or symbol.dotted == _PICTURE):
        found = by_annotation(symbol.dotted)
    elif (name := framework_name(symbol)) is not None and name not in ("StrEnum", "IntEnum", "Image"):
        found = by_annotation(name)
    if found is None:
        raise unsupported(hint, module, symbol)
    return found, None


def unsupported(hint: ast.expr, module: Module, symbol: Symbol | None) -> AnalysisStopped:
    """Return the error for a hint that is not a parameter type."""
    shown = shown_hint(plain(hint, module))
    if symbol is None and isinstance(plain(hint, module), ast.Name):
        return module.problem("the name {name} is not defined", hint.lineno, name=shown)
    return module.problem("the type {type} is not supported", hint.lineno, type=shown)


def shown_hint(hint: ast.expr) -> str:
    """Return a hint as source text."""
    try:
        return ast.unparse(hint)[:60]
    except (RecursionError, ValueError):
        return "of this parameter"


def results(hint: ast.expr, module: Module, resolver: Resolver) -> list[ast.expr]:
    """Return the hints of the results: none for None, several for `tuple[A, B]`, otherwise one."""
    hint = plain(hint, module)
    if _is_none(hint):
        return []
    if isinstance(hint, ast.Subscript):
        symbol = resolver.expression(hint.value, module)
        if isinstance(symbol, External) and symbol.dotted in ("builtins.tuple", "typing.Tuple"):
            return list(hint.slice.elts) if isinstance(hint.slice, ast.Tuple) else [hint.slice]
    return [hint]


def normal(hint: ast.expr | None, module: Module, resolver: Resolver) -> str:
    """Return a hint in a normal form, in which equivalent spellings, quotes and orders are equal."""
    if hint is None:
        return ""
    hint = plain(hint, module)
    members = _members(hint, module, resolver)
    if len(members) > 1:
        return "|".join(sorted(normal(member, module, resolver) for member in members))
    match hint:
        case ast.Subscript(value=value, slice=inner):
            elements = inner.elts if isinstance(inner, ast.Tuple) else [inner]
            return f"{normal(value, module, resolver)}[{','.join(normal(e, module, resolver) for e in elements)}]"
        case ast.Constant(value=value):
            return repr(value)
        case ast.Name() | ast.Attribute():
            symbol = resolver.expression(hint, module)
            name = (hint.id if isinstance(hint, ast.Name) else hint.attr) if symbol is None else _end(symbol, hint)
            return {"List": "list", "Set": "set", "Dict": "dict", "Tuple": "tuple"}.get(name, name)
        case _:
            return shown_hint(hint)


def _end(symbol: Symbol, hint: ast.Name | ast.Attribute) -> str:
    if isinstance(symbol, External):
        return symbol.dotted.rpartition(".")[2]
    if isinstance(symbol, ClassInfo):
        return symbol.name
    return hint.id if isinstance(hint, ast.Name) else hint.attr
