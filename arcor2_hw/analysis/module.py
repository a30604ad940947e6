"""The names bound in one module: classes, functions, imports and values."""

import ast
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from arcor2_hw.analysis.source import AnalysisStopped, SourceFile
from arcor2_hw.messages import Message
from arcor2_hw.parsing import parse

FunctionNode: TypeAlias = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(slots=True)
class Import:
    """An imported name; `name` is None for the module itself."""

    module: str
    name: str | None
    line: int
    relative: bool
    guarded: bool


@dataclass(slots=True)
class Value:
    """A name bound to an expression, or only annotated."""

    expression: ast.expr | None
    annotation: ast.expr | None
    line: int


Binding: TypeAlias = "ClassInfo | FunctionNode | Import | Value"


@dataclass(slots=True, eq=False)
class ClassInfo:
    """A class statement with its members, in the order in which they are first bound."""

    name: str
    node: ast.ClassDef
    module: "Module"
    members: dict[str, Binding] = field(default_factory=dict)
    marks: dict[tuple[str, str], ast.expr] = field(default_factory=dict)
    """Values assigned to attributes of members: {("move", "__action__"): expression}."""

    def problem(self, message: str | Message, node: ast.AST | None = None, /, **values: object) -> AnalysisStopped:
        """Return an error at `node`, or at the class statement."""
        return self.module.problem(message, getattr(node, "lineno", self.node.lineno), **values)

    def function(self, name: str) -> FunctionNode | None:
        """Return the method that the class itself defines under this name."""
        found = self.members.get(name)
        return found if isinstance(found, ast.FunctionDef | ast.AsyncFunctionDef) else None


class Module:
    """A parsed source file.

    Raises:
        AnalysisStopped: It cannot be parsed; the error has file and line.
    """

    def __init__(self, file: SourceFile) -> None:
        self.file = file
        self.dotted = file.module
        self.is_package = file.is_package
        self.bindings: dict[str, Binding] = {}
        self.stars: list[Import] = []
        self.imports: list[Import] = []
        self.path = file.path or f"{file.module.replace('.', '/')}.py"
        try:
            tree = parse(file.source)
        except SyntaxError as error:
            raise self.problem("this is not valid Python: {reason}", error.lineno or 1, reason=error.msg) from None
        except (RecursionError, MemoryError):
            raise self.problem("the source is nested too deeply", 1) from None
        except ValueError as error:
            raise self.problem("the file is not text: {reason}", 1, reason=error) from None
        try:
            self._bind(tree.body, self.bindings, None)
        except RecursionError:
            raise self.problem("the source is nested too deeply", 1) from None

    def problem(self, message: str | Message, line: int, /, **values: object) -> AnalysisStopped:
        """Return an error at `line` of this file."""
        return AnalysisStopped(message, self.path, line, **values)

    # -------------------------------------------------------------------------------- binding
    def _bind(self, body: Sequence[ast.stmt], scope: dict[str, Binding], owner: ClassInfo | None) -> None:
        for statement, sure in _statements(body):
            match statement:
                case ast.FunctionDef() | ast.AsyncFunctionDef():
                    if not (statement.name in scope and _extends_property(statement)):
                        _set(scope, statement.name, statement, sure)
                case ast.ClassDef():
                    info = ClassInfo(statement.name, statement, self)
                    self._bind(statement.body, info.members, info)
                    _set(scope, statement.name, info, sure)
                case ast.Import() | ast.ImportFrom():
                    self._bind_import(statement, scope, sure)
                case ast.Assign(targets=targets, value=value):
                    for target in targets:
                        self._assign(target, value, scope, owner, sure)
                case ast.AnnAssign(target=ast.Name(id=name), value=value):
                    _set(scope, name, Value(value, statement.annotation, statement.lineno), sure)
                case _:
                    pass

    def _assign(
        self, target: ast.expr, value: ast.expr, scope: dict[str, Binding], owner: ClassInfo | None, sure: bool
    ) -> None:
        match target:
            case ast.Name(id=name):
                _set(scope, name, Value(value, None, target.lineno), sure)
            case ast.Attribute(value=ast.Name(id=member), attr=attribute) if owner is not None:
                owner.marks[member, attribute] = value
            case ast.Attribute(value=ast.Name(id=name), attr=attribute):
                # Tester.CANCEL_MAPPING = {...} after the class
                found = scope.get(name)
                if isinstance(found, ClassInfo):
                    _set(found.members, attribute, Value(value, None, target.lineno), sure)
            case ast.Attribute(value=ast.Attribute(value=ast.Name(id=name), attr=member), attr=attribute):
                # Tester.weigh.__action__ = ActionMetadata() after the class
                found = scope.get(name)
                if isinstance(found, ClassInfo):
                    found.marks[member, attribute] = value
            case _:
                pass

    def _bind_import(self, statement: ast.Import | ast.ImportFrom, scope: dict[str, Binding], sure: bool) -> None:
        line = statement.lineno
        if isinstance(statement, ast.Import):
            for alias in statement.names:
                found = Import(alias.name, None, line, False, not sure)
                self.imports.append(found)
                if alias.asname is None:
                    top = alias.name.partition(".")[0]
                    _set(scope, top, Import(top, None, line, False, not sure), sure)
                else:
                    _set(scope, alias.asname, found, sure)
            return
        module = self._absolute(statement)
        for alias in statement.names:
            found = Import(module, alias.name, line, statement.level > 0, not sure)
            self.imports.append(found)
            if alias.name == "*":
                self.stars.append(found)
            else:
                _set(scope, alias.asname or alias.name, found, sure)

    def _absolute(self, statement: ast.ImportFrom) -> str:
        """Return the full name of the module in a `from` statement."""
        if statement.level == 0:
            return statement.module or ""
        parts = self.dotted.split(".")
        up = statement.level - (1 if self.file.is_package else 0)
        if up >= len(parts):
            raise self.problem("the relative import leads outside of the package", statement.lineno)
        return ".".join([*parts[: len(parts) - up], *([statement.module] if statement.module else [])])


def _statements(body: Sequence[ast.stmt], sure: bool = True) -> Iterator[tuple[ast.stmt, bool]]:
    """Yield the statements that run when the module is imported, each with whether it certainly runs.

    Of alternatives the first one counts: the bindings in `try`, not those in its handlers.
    """
    for statement in body:
        match statement:
            case ast.If(body=then, orelse=other):
                yield from _statements(then, False)
                yield from _statements(other, False)
            case ast.Try(body=then, handlers=handlers, orelse=other, finalbody=final):
                yield from _statements(then, sure and not handlers)
                for handler in handlers:
                    yield from _statements(handler.body, False)
                yield from _statements(other, False)
                yield from _statements(final, sure)
            case ast.With(body=then):
                yield from _statements(then, sure)
            case _:
                yield statement, sure


def _set(scope: dict[str, Binding], name: str, binding: Binding, sure: bool) -> None:
    if sure or name not in scope:
        scope[name] = binding


def _extends_property(node: FunctionNode) -> bool:
    """Return whether this is the setter of a property defined above it."""
    return any(
        isinstance(decorator, ast.Attribute) and decorator.attr in {"setter", "getter", "deleter"}
        for decorator in node.decorator_list
    )
