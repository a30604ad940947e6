"""Errors in scripts that do not follow the conventions of generated scripts."""

import ast

from arcor2_hw.exceptions import InvalidProject
from arcor2_hw.messages import Message


class NotUnderstood(InvalidProject):
    """A line of a script cannot be converted to actions and logic. `line` counts from 1, `problem` does not name it."""

    code = "script_not_understood"

    def __init__(self, line: int, message: str, detail: str = "", **values: object) -> None:
        problem = Message.of(message, **values)
        super().__init__("script.py, line {line}: {problem}", detail, line=line, problem=problem)
        self.line, self.problem = line, problem


def excerpt(node: ast.AST) -> str:
    """Return the code of a node for an error message, at most 60 characters."""
    try:
        text = " ".join(ast.unparse(node).split())
    except RecursionError:
        return "this"
    return text if len(text) <= 60 else f"{text[:57]}..."
