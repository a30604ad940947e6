"""Parsing of Python source."""

import ast
import contextlib
import gc
from collections.abc import Iterator
from typing import Any, Final

ATTEMPTS: Final = 10
"""Number of times that a source is parsed before an error of the interpreter is raised."""


def parse(source: str | bytes, filename: str = "<unknown>") -> ast.Module:
    """Parse a module as `ast.parse` does, also while another thread parses.

    CPython before 3.11.8 counts the depth of the syntax tree for all threads together. If another thread or a
    finalizer parses, or formats a traceback, at the same time, `ast.parse` raises SystemError (python/cpython#106905).

    Raises:
        SyntaxError: It is not valid Python.
        ValueError: It has null bytes.
        RecursionError: It is nested too deeply.
        MemoryError: It is nested too deeply.
    """
    module: ast.Module = _parsed(source, filename, "exec")
    return module


def parse_expression(source: str) -> ast.expr:
    """Parse an expression. Raise as `parse`."""
    expression: ast.Expression = _parsed(source, "<unknown>", "eval")
    return expression.body


def _parsed(source: str | bytes, filename: str, mode: str) -> Any:
    for _ in range(ATTEMPTS - 1):
        with contextlib.suppress(SystemError):
            return ast.parse(source, filename, mode)
    return ast.parse(source, filename, mode)


@contextlib.contextmanager
def paused_garbage_collection() -> Iterator[None]:
    """Pause the garbage collector while syntax trees are created, unless another thread has paused it.

    They are many objects without cycles that all remain. Collection would double the time, and block all threads.
    """
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
