"""The frame of a script around its loop: imports, names of objects and project parameters, entry point."""

import ast
from dataclasses import dataclass, field
from typing import Final

from arcor2_server.build.reading.errors import NotUnderstood, shown

_LIBRARIES: Final = ("arcor2_hw", "arcor2", "arcor2_runtime", "object_types", "__future__", "typing")
"""Packages that a generated script, ours or an older one's, may import from."""
_ENTRY: Final = frozenset({"Resources", "main", "print_exception"})
"""All that the entry of a script calls."""


@dataclass(slots=True)
class Script:
    """A script taken apart. `loop` is what repeats; names are the script's own.

    objects: ids of scene objects. constants: what stands for project parameters, as written. imports: what a name was
    called where it comes from.
    """

    loop: list[ast.stmt] = field(default_factory=list)
    points: str = ""
    resources: str = ""
    objects: dict[str, str] = field(default_factory=dict)
    constants: dict[str, ast.expr] = field(default_factory=dict)
    imports: dict[str, str] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)

    def claim(self, name: str, line: int) -> None:
        """Note where a name is given its one meaning; NotUnderstood when it has another one already."""
        if name in self.lines:
            raise NotUnderstood(
                line, "{name} means something else already, since line {row}", name=name, row=self.lines[name]
            )
        self.lines[name] = line


def read(source: str) -> Script:
    """Take a script apart. Raises NotUnderstood naming the line."""
    try:
        module = ast.parse(source, "script.py")
    except SyntaxError as error:
        raise NotUnderstood(error.lineno or 1, error.msg, error.text or "") from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise NotUnderstood(1, "this is no Python: {reason}", reason=error) from error
    script = Script()
    main: ast.FunctionDef | None = None
    for node in module.body:
        match node:
            case ast.Expr(ast.Constant(str())):
                continue
            case ast.ImportFrom():
                _import(script, node)
            case ast.FunctionDef(name="main") if main is None:
                main = node
            case ast.If(ast.Compare(ast.Name("__name__"), [ast.Eq()], [ast.Constant("__main__")]), _, []):
                _check_entry(node)
            case _:
                raise NotUnderstood(
                    node.lineno,
                    "beside its imports, main and its entry a script has nothing, but here is {node}",
                    node=shown(node),
                )
    if main is None:
        raise NotUnderstood(1, "there is no function main")
    _main(script, main)
    return script


def _import(script: Script, node: ast.ImportFrom) -> None:
    module = node.module or ""
    if node.level or (module != "action_points" and module.partition(".")[0] not in _LIBRARIES):
        raise NotUnderstood(
            node.lineno, "a script imports object types and our library only, not from {module}", module=module or "."
        )
    for alias in node.names:
        name = alias.asname or alias.name
        if name == "*":
            raise NotUnderstood(node.lineno, "an import has to name what it takes")
        script.claim(name, node.lineno)
        script.imports[name] = alias.name


def _check_entry(entry: ast.If) -> None:
    for node in ast.walk(entry):
        if isinstance(node, ast.Call) and not (isinstance(node.func, ast.Name) and node.func.id in _ENTRY):
            raise NotUnderstood(
                node.lineno, "the entry of a script only calls main, but here is {node}", node=shown(node)
            )
        if isinstance(node, ast.While | ast.For):
            raise NotUnderstood(node.lineno, "the entry of a script calls main once")


def _main(script: Script, main: ast.FunctionDef) -> None:
    arguments = main.args
    if len(arguments.args) != 1 or arguments.vararg or arguments.kwonlyargs or arguments.kwarg or main.decorator_list:
        raise NotUnderstood(main.lineno, "main takes the resources and nothing else")
    script.resources = arguments.args[0].arg
    script.claim(script.resources, main.lineno)
    found = False
    for node in main.body:
        if found:
            raise NotUnderstood(node.lineno, "nothing stands behind the loop, but here is {node}", node=shown(node))
        match node:
            case ast.Expr(ast.Constant(str())) | ast.Pass():
                continue
            case ast.While(ast.Constant(True), body, []):
                script.loop = body
                found = True
            case ast.Assign([ast.Name(name)], value) | ast.AnnAssign(ast.Name(name), _, ast.expr() as value):
                script.claim(name, node.lineno)
                _set_up(script, name, value)
            case _:
                raise NotUnderstood(
                    node.lineno,
                    "before the loop stand action points, objects and project parameters, but here is {node}",
                    node=shown(node),
                )
    if not found:
        raise NotUnderstood(main.lineno, "main has no loop (`while True:`)")


def _set_up(script: Script, name: str, value: ast.expr) -> None:
    match value:
        case ast.Call(ast.Name("ActionPoints"), [ast.Name(resources)], []) if resources == script.resources:
            script.points = name
        case ast.Subscript(ast.Attribute(ast.Name(resources), "objects"), ast.Constant(str(object_id))) if (
            resources == script.resources
        ):
            script.objects[name] = object_id
        case ast.Constant() | ast.UnaryOp(ast.USub(), ast.Constant()):
            script.constants[name] = value
        case _:
            raise NotUnderstood(
                value.lineno,
                "{name} is to be an object ({resources}.objects[...]), the action points or a plain value, not {value}",
                name=name,
                resources=script.resources,
                value=shown(value),
            )
