"""`arcor2-hw analyse FILE`: show the actions and settings of an object type, from its source."""

import ast
import sys
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from arcor2_hw.analysis import Library, SourceFile, TypeAnalysis
from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import ObjectAction, ParameterMeta
from arcor2_server.cli.exit_status import ExitStatus

PIPE_WIDTH = 160
"""Maximum line length if the output is not a terminal."""


def analyse(file: Path, *, type_name: str | None = None) -> int:
    """Show what an object type offers, as clients will see it: settings, actions and problems.

    The file is only read: neither the driver nor what it imports is loaded, and no device is needed. The exit status
    tells whether there are problems.

    Parameters
    ----------
    file
        A Python module with one or more object types. Modules that it imports relatively are looked for beside it.
    type_name
        Show only this class.
    """
    try:
        source = file.read_bytes()
        names = [node.name for node in ast.parse(source, str(file)).body if isinstance(node, ast.ClassDef)]
    except OSError as error:
        return _fail(f"{file}: {error.strerror}", ExitStatus.NOT_FOUND)
    except (SyntaxError, ValueError, RecursionError) as error:
        line = f":{error.lineno}" if isinstance(error, SyntaxError) else ""
        reason = error.msg if isinstance(error, SyntaxError) else str(error) or "nested too deeply"
        return _fail(f"{file}{line}: {reason}", ExitStatus.ANALYSIS_PROBLEMS)
    if type_name is not None and type_name not in names:
        return _fail(f"{file} has no class {type_name}", ExitStatus.NOT_FOUND)
    module = _dotted(file.resolve())
    library = Library(SourceFile(name, module, source, str(file.resolve()), file.stem == "__init__") for name in names)
    found = [library.analyse(name) for name in ([type_name] if type_name else names)]
    shown = [one for one in found if one.is_object_type]
    if not shown:
        return _fail(f"{file} has no class that derives from Generic", ExitStatus.NOT_FOUND)
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=PIPE_WIDTH)
    problems = [_show(console, one) for one in shown]
    return ExitStatus.ANALYSIS_PROBLEMS if any(problems) else ExitStatus.OK


def _fail(reason: str, status: ExitStatus) -> ExitStatus:
    sys.stderr.write(f"arcor2-hw analyse: {reason}\n")
    return status


def _dotted(file: Path) -> str:
    """Return the full name of a file's module; one that is in no package is taken to be in its folder."""
    parts = [] if file.stem == "__init__" else [file.stem]
    folder = file.parent
    while (folder / "__init__.py").exists():
        parts.insert(0, folder.name)
        folder = folder.parent
    return ".".join(parts if len(parts) > 1 else [file.parent.name, *parts])


def _show(console: Console, found: TypeAnalysis) -> bool:
    """Print one type; return whether it has problems."""
    meta = found.meta
    problems = [] if isinstance(meta.problem, Unset) else [meta.problem]
    problems += [f"{action.name}: {action.problem}" for action in found.actions if action.disabled]
    kind = f"{meta.base}, abstract: it cannot be placed in a scene" if meta.abstract else meta.base
    console.print(f"[bold]{meta.type}[/] ({escape(kind)})", soft_wrap=True)
    console.print(f"  {escape(meta.description)}", soft_wrap=True)
    if found.implemented:
        console.print(f"  implements {', '.join(sorted(found.implemented))}", soft_wrap=True)
    if meta.settings:
        console.print(_parameters("setting", meta.settings))
    if found.actions:
        console.print(_actions(list(found.actions)))
    for problem in problems:
        console.print(f"  [red]problem:[/] {escape(problem)}", soft_wrap=True)
    console.print()
    return bool(problems)


def _parameters(title: str, parameters: list[ParameterMeta]) -> Table:
    table = Table(title, "type", "default", "allowed", "description", box=None, padding=(0, 2))
    for parameter in parameters:
        table.add_row(parameter.name, *_facts(parameter))
    return table


def _actions(actions: list[ObjectAction]) -> Table:
    table = Table("action", "parameter", "type", "default", "allowed", "description", box=None, padding=(0, 2))
    for action in actions:
        returns = f" → {', '.join(action.returns)}" if action.returns else ""
        mark = "[red]" if action.disabled else "[bold]"
        origin = "" if isinstance(action.origins, Unset) else f" (from {action.origins})"
        text = "" if isinstance(action.description, Unset) else action.description
        table.add_row(f"{mark}{action.name}[/]{escape(returns)}", "", "", "", "", escape(text + origin))
        for parameter in action.parameters:
            table.add_row("", parameter.name, *_facts(parameter))
    return table


def _facts(parameter: ParameterMeta) -> tuple[str, str, str, str]:
    texts = (parameter.default_value, parameter.extra, parameter.description)
    default, extra, description = ("" if isinstance(text, Unset) else escape(text) for text in texts)
    return parameter.type, default, extra, description
