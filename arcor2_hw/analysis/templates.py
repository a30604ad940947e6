"""Message templates in source files: the keys of translations."""

import ast
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from string import Formatter
from typing import Final, NamedTuple, TypeAlias

from arcor2_hw.data.base import Data
from arcor2_hw.messages import key_of
from arcor2_hw.parsing import parse, paused_garbage_collection

LIBRARY: Final = Path(__file__).resolve().parents[1]
"""Folder of `arcor2_hw`, whose errors drivers raise and derive from."""
_ROOT: Final = "Arcor2Error"
_NOT_IMPLEMENTED: Final = "Arcor2NotImplemented"
"""Error whose message is the name of a method."""
_ALARM: Final = ("text", "remedy", "severity", "health")
_MARKED: Final = {
    "Message.of": ("template",),
    "Phrase.of": ("template",),
    "translatable": ("texts",),
    "AlarmText": _ALARM,
    "Fault": _ALARM,
}
"""Parameters of other calls that take texts for users. `Fault` is a tuple that a driver declares for its alarms."""
_DATA: Final = frozenset({"NotificationData", "WebApiError"})
"""Data that always contain a text for users."""
_WORDS: Final = re.compile(r"[A-Za-z]+ [a-z]+")
_CLASS: Final = re.compile(rb"^[ \t]*class\s+(\w+)\s*\(([^)]*)\)", re.MULTILINE)
_NAME: Final = re.compile(rb"\w+")
_TEXTS: Final = frozenset({"message", "template", "texts", "text", "remedy"})


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
        SyntaxError: A file with a text for users is not valid Python.
    """
    scans, errors = _with_errors(files)
    return [found for path, scan in scans.items() for found in _templates(scan, errors, str(path))]


def hard_coded(files: Iterable[Path]) -> list[str]:
    """Return the places where a text for users cannot be translated, with the call.

    The message of an error is formatted before it becomes a template, a value of a template is an English phrase, or
    an event or answer gets a text without its key.

    Raises:
        SyntaxError: A file with a text for users is not valid Python.
    """
    scans, errors = _with_errors(files)
    return [
        f"{path}:{call.lineno} {ast.unparse(call)[:120]}"
        for path, scan in scans.items()
        for call, function in scan.calls
        if _is_hard_coded(scan, call, function, errors)
    ]


def _is_hard_coded(scan: "_Scan", call: ast.Call, function: ast.AST | None, errors: _Errors) -> bool:
    called = ast.unparse(call.func)
    short = called.rpartition(".")[2]
    given = {keyword.arg: keyword.value for keyword in call.keywords}
    if short in _DATA:
        return None not in given and "key" not in given
    parameters = _MARKED.get(called) or errors.get(short)
    if not parameters or called == _NOT_IMPLEMENTED:
        return False
    texts = [call.args[place] for place, name in enumerate(parameters) if name in _TEXTS and place < len(call.args)]
    texts += [value for name, value in given.items() if name in _TEXTS.intersection(parameters)]
    values = [value for name, value in given.items() if name is not None and name not in parameters]
    return any(
        _is_formatted(each) and not list(scan.literals(each, function))
        for text in texts
        for each in scan.assigned_to(text, function)
    ) or any(_is_phrase(each) for value in values for each in scan.assigned_to(value, function))


def _is_formatted(node: ast.expr) -> bool:
    """Whether an expression is a text that contains values."""
    match node:
        case ast.JoinedStr(values=parts):
            return any(isinstance(part, ast.FormattedValue) for part in parts)
        case ast.IfExp(body=body, orelse=orelse):
            return _is_formatted(body) or _is_formatted(orelse)
        case ast.Call(func=ast.Name(id="str")):
            return True
    return False


def _is_phrase(node: ast.expr) -> bool:
    """Whether an expression is or contains an English phrase: at least two words in a row, or `str(error)`."""
    match node:
        case ast.Constant(value=str(text)):
            return _WORDS.search(text) is not None
        case ast.JoinedStr(values=parts):
            return any(_is_phrase(part) for part in parts if isinstance(part, ast.Constant))
        case ast.IfExp(body=body, orelse=orelse):
            return _is_phrase(body) or _is_phrase(orelse)
        case ast.Call(func=ast.Name(id="str"), args=[ast.Name(id="error" | "e")]):
            return True
    return False


class _Scan(NamedTuple):
    """Required content of a syntax tree.

    Attributes:
        classes: All classes.
        calls: All calls, with the innermost function around each; None at the level of the module.
        assigned: Expressions that each function assigns to its variables, by function and name.
    """

    classes: list[ast.ClassDef]
    calls: list[tuple[ast.Call, ast.AST | None]]
    assigned: defaultdict[tuple[ast.AST | None, str], list[ast.expr]]

    @classmethod
    def of(cls, tree: ast.AST) -> "_Scan":
        found = cls([], [], defaultdict(list))
        found._visit(tree, None)
        return found

    def _visit(self, node: ast.AST, function: ast.AST | None) -> None:
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                function = node
            case ast.ClassDef():
                self.classes.append(node)
            case ast.Call():
                self.calls.append((node, function))
            case (
                ast.Assign(targets=[ast.Name(id=name)], value=value)
                | ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value)
            ):
                self.assigned[function, name].append(value)
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=ast.Tuple(elts=given)):
                for target, value in zip(targets, given, strict=False):
                    if isinstance(target, ast.Name):
                        self.assigned[function, target.id].append(value)
        for child in ast.iter_child_nodes(node):
            self._visit(child, function)

    def assigned_to(self, node: ast.expr, function: ast.AST | None) -> list[ast.expr]:
        """Return the expressions that the function assigns to a variable; other expressions unchanged."""
        return (self.assigned.get((function, node.id)) if isinstance(node, ast.Name) else None) or [node]

    def literals(
        self, node: ast.expr | None, function: ast.AST | None, passed: frozenset[str] = frozenset()
    ) -> Iterator[str]:
        """Yield the texts that an argument can be: literals, those of an expression, a variable or a table."""
        match node:
            case ast.Constant(value=str(text)) if text:
                yield text
            case ast.IfExp(body=body, orelse=orelse):
                yield from self.literals(body, function, passed)
                yield from self.literals(orelse, function, passed)
            case ast.Name(id=name) if name not in passed:
                for value in self.assigned.get((function, name)) or self.assigned.get((None, name)) or []:
                    yield from self.literals(value, function, passed | {name})
            case ast.Dict(values=elements) | ast.Tuple(elts=elements) | ast.List(elts=elements):
                for element in elements:
                    yield from self.literals(element, function, passed)
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                yield from self._joined([left, right], function, passed)
            case ast.JoinedStr(values=parts):
                found = [part.value if isinstance(part, ast.FormattedValue) else part for part in parts]
                yield from self._joined(found, function, passed)

    def _joined(self, parts: list[ast.expr], function: ast.AST | None, passed: frozenset[str]) -> Iterator[str]:
        """Yield the text that constants form, if all parts are constants."""
        found = ["".join(self.literals(part, function, passed)) for part in parts]
        if all(found):
            yield "".join(found)


def _scanned(files: Iterable[Path]) -> dict[Path, _Scan]:
    with paused_garbage_collection():
        return {path: _Scan.of(parse(path.read_bytes(), str(path))) for path in files}


def _with_errors(files: Iterable[Path]) -> tuple[dict[Path, _Scan], _Errors]:
    """Return the scans of the files that have texts for users, and the error classes that are known in them."""
    contents = {path: path.read_bytes() for path in files}
    errors = dict(_errors_of_library())
    own = {path: content for path, content in contents.items() if LIBRARY not in path.parents}
    errors |= _errors(_scanned(_defining_errors(own, errors)).values(), errors)
    names = [*_MARKED, *_DATA, *(name for name, parameters in errors.items() if parameters)]
    # Parsing takes much longer than the search for a call. A name in a comment means only that a file is parsed.
    call = re.compile(rb"\b(?:%s)\s*\(" % "|".join(map(re.escape, names)).encode())
    return _scanned(path for path, content in contents.items() if call.search(content)), errors


def _defining_errors(contents: Mapping[Path, bytes], known: Iterable[str]) -> list[Path]:
    """Return the files that may define classes derived from known ones, by their text."""
    classes = {path: _CLASS.findall(content) for path, content in contents.items()}
    names, found = {name.encode() for name in known}, dict.fromkeys(contents, False)
    while True:
        before = len(names)
        for path, defined in classes.items():
            derived = {name for name, bases in defined if name in names or names.intersection(_NAME.findall(bases))}
            names |= derived
            found[path] |= bool(derived)
        if len(names) == before:
            return [path for path, defines in found.items() if defines]


@lru_cache(maxsize=1)
def _errors_of_library() -> _Errors:
    contents = {path: path.read_bytes() for path in sources(LIBRARY)}
    return _errors(_scanned(_defining_errors(contents, [_ROOT])).values(), {_ROOT: ()})


def _errors(scans: Iterable[_Scan], known: _Errors) -> dict[str, tuple[str, ...] | None]:
    """Return the error classes that derive from known ones, by the names of the bases."""
    classes = [node for scan in scans for node in scan.classes]
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


def _templates(scan: _Scan, errors: _Errors, path: str) -> Iterator[Template]:
    for node, function in scan.calls:
        called = ast.unparse(node.func)
        parameters = _MARKED.get(called) or errors.get(called.rpartition(".")[2])
        if not parameters or called == _NOT_IMPLEMENTED:
            continue
        given = {keyword.arg: keyword.value for keyword in node.keywords if keyword.arg is not None}
        values = frozenset(given).difference(parameters)
        unknown = any(keyword.arg is None for keyword in node.keywords)  # **values
        for name in _TEXTS.intersection(parameters):
            place = parameters.index(name)
            argument = given.get(name) or (node.args[place] if place < len(node.args) else None)
            for text in scan.literals(argument, function):
                fields = fields_of(text) if values or unknown else frozenset()
                key = key_of(text) if values or unknown else text
                yield Template(key, fields, fields | values if unknown else values, path, node.lineno)
