"""Syntax tree nodes of generated scripts. Nodes are cached and shared: never modify them."""

import ast
from functools import lru_cache
from typing import Final

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


@lru_cache(maxsize=4096)
def dotted(first: str, parts: tuple[str, ...]) -> ast.expr:
    """Return `first.part.part`."""
    if not parts:
        return name(first)
    return ast.Attribute(dotted(first, parts[:-1]), parts[-1], _LOAD)


def equals(variable: str, value: bool | int | str) -> ast.expr:
    """Return `variable == value`."""
    return ast.Compare(name(variable), [ast.Eq()], [ast.Constant(value)])


def differs(variable: str, value: bool | int | str) -> ast.expr:
    """Return `variable != value`."""
    return ast.Compare(name(variable), [ast.NotEq()], [ast.Constant(value)])
