"""The few kinds of expression that a generated script is made of."""

import ast


def name(name: str) -> ast.Name:
    """Give a variable."""
    return ast.Name(name, ast.Load())


def assign(name: str, value: ast.expr) -> ast.Assign:
    """Give `name = value`."""
    return ast.Assign([ast.Name(name, ast.Store())], value, lineno=0)


def dotted(first: str, parts: tuple[str, ...]) -> ast.expr:
    """Give `first.part.part`."""
    result: ast.expr = name(first)
    for part in parts:
        result = ast.Attribute(result, part, ast.Load())
    return result


def equals(variable: str, value: bool | int | str) -> ast.expr:
    """Give `variable == value`."""
    return ast.Compare(name(variable), [ast.Eq()], [ast.Constant(value)])


def differs(variable: str, value: bool | int | str) -> ast.expr:
    """Give `variable != value`."""
    return ast.Compare(name(variable), [ast.NotEq()], [ast.Constant(value)])
