"""Message templates in source files: the keys of translations.

`python -m arcor2_hw.analysis.templates FOLDER` prints those of a folder as a translation that has to be filled in.
"""

import ast
import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from string import Formatter
from typing import Final, TypeAlias

from arcor2_hw.data.base import Data
from arcor2_hw.messages import key_of

LIBRARY: Final = Path(__file__).resolve().parents[1]
"""Folder of `arcor2_hw`, whose errors drivers raise and derive from."""
_ROOT: Final = "Arcor2Error"


class Template(Data, frozen=True):
    """One template of a message.

    Attributes:
        key: The template with plain `{name}` fields, or the text of a message without values.
        fields: Names of the fields.
        values: Names of the values that the code passes; equal to `fields` if the code is correct.
        path: File.
        line: Line of the call.
    """

    key: str
    fields: frozenset[str]
    values: frozenset[str]
    path: str
    line: int


_Errors: TypeAlias = Mapping[str, tuple[str, ...] | None]
"""Parameters of `__init__` by name of the error class; None if it takes no message."""


def fields_of(template: str) -> frozenset[str]:
    """Return the names of the fields of a template.

    Raises:
        ValueError: The template is malformed.
    """
    return frozenset(name for _, name, _, _ in Formatter().parse(template) if name is not None)


def sources(folder: Path) -> list[Path]:
    """Return the Python files of a folder and its subfolders."""
    return sorted(path for path in folder.rglob("*.py") if "node_modules" not in path.parts)


def templates(files: Iterable[Path]) -> list[Template]:
    """Return the templates in source files: of errors of `arcor2_hw` and of these files, and of `Message.of`.

    Raises:
        SyntaxError: A file is not valid Python.
    """
    trees = {path: ast.parse(path.read_bytes(), str(path)) for path in files}
    errors = dict(_errors_of_library()) | _errors(trees.values(), _errors_of_library())
    return [found for path, tree in trees.items() for found in _templates(tree, errors, str(path))]


@lru_cache(maxsize=1)
def _errors_of_library() -> _Errors:
    return _errors((ast.parse(path.read_bytes(), str(path)) for path in sources(LIBRARY)), {_ROOT: ()})


def _errors(trees: Iterable[ast.AST], known: _Errors) -> dict[str, tuple[str, ...] | None]:
    """Return the error classes that derive from known ones, by the names of the bases."""
    classes = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    found = dict(known)
    while True:
        before = len(found)
        for node in classes:
            bases = [ast.unparse(base).rpartition(".")[2] for base in node.bases]
            parent = next((base for base in bases if base in found), None)
            if node.name == _ROOT or parent is not None:
                found[node.name] = _parameters(node, found.get(parent or ""))
        if len(found) == before:
            return found


def _parameters(node: ast.ClassDef, inherited: tuple[str, ...] | None) -> tuple[str, ...] | None:
    for each in node.body:
        if isinstance(each, ast.FunctionDef) and each.name == "__init__":
            names = tuple(argument.arg for argument in [*each.args.args, *each.args.kwonlyargs][1:])
            return names if "message" in names and each.args.kwarg is not None else None
    return inherited


def _templates(tree: ast.AST, errors: _Errors, path: str) -> Iterator[Template]:
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        called = ast.unparse(node.func)
        parameters = ("template",) if called == "Message.of" else errors.get(called.rpartition(".")[2])
        if not parameters:
            continue
        place = parameters.index("template" if called == "Message.of" else "message")
        given = {keyword.arg: keyword.value for keyword in node.keywords if keyword.arg is not None}
        argument = given.get("message") or (node.args[place] if place < len(node.args) else None)
        values = frozenset(given).difference(parameters)
        for text in _literals(argument):
            fields = fields_of(text) if values else frozenset()
            yield Template(key_of(text) if values else text, fields, values, path, node.lineno)


def _literals(node: ast.expr | None) -> Iterator[str]:
    """Yield the texts that an argument can be: a literal, or the literals of a conditional expression."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value:
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from _literals(node.body)
        yield from _literals(node.orelse)


if __name__ == "__main__":
    empty = {each.key: "" for each in templates(sources(Path(sys.argv[1])))}
    sys.stdout.write(json.dumps(dict(sorted(empty.items())), indent=2, ensure_ascii=False) + "\n")
