"""`arcor2-hw analyse`: show the actions and settings of an object type from its source code."""

import ast
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from arcor2_hw.analysis import Library, SourceFile, TypeAnalysis
from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import ObjectAction, ParameterMeta
from arcor2_hw.parsing import parse
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.tables import console


def analyse(file: Path, *, type_name: str | None = None) -> int:
    """Show the settings, actions and problems of object types.

    Parameters
    ----------
    file
        A Python module with one or more object types. Modules that it imports relatively are read from the same folder.
    type_name
        Show only this class.
    """
    try:
        source = file.read_bytes()
        names = [node.name for node in parse(source, str(file)).body if isinstance(node, ast.ClassDef)]
    except OSError as error:
        return fail("analyse", f"{file}: {error.strerror}", ExitStatus.NOT_FOUND)
    except (SyntaxError, ValueError, RecursionError) as error:
        line = f":{error.lineno}" if isinstance(error, SyntaxError) else ""
        reason = error.msg if isinstance(error, SyntaxError) else str(error) or "nested too deeply"
        return fail("analyse", f"{file}{line}: {reason}", ExitStatus.ANALYSIS_PROBLEMS)
    if type_name is not None and type_name not in names:
        return fail("analyse", f"{file} has no class {type_name}", ExitStatus.NOT_FOUND)
    module = _module_name(file.resolve())
    library = Library(SourceFile(name, module, source, str(file.resolve()), file.stem == "__init__") for name in names)
    analyses = [library.analyse(name) for name in ([type_name] if type_name else names)]
    types = [analysis for analysis in analyses if analysis.is_object_type]
    if not types:
        return fail("analyse", f"{file} has no class that derives from Generic", ExitStatus.NOT_FOUND)
    problems = [_show(console(), analysis) for analysis in types]
    return ExitStatus.ANALYSIS_PROBLEMS if any(problems) else ExitStatus.OK


def _module_name(file: Path) -> str:
    """Return the full name of a file's module. A folder without __init__.py counts as a package too."""
    parts = [] if file.stem == "__init__" else [file.stem]
    folder = file.parent
    while (folder / "__init__.py").exists():
        parts.insert(0, folder.name)
        folder = folder.parent
    return ".".join(parts if len(parts) > 1 else [file.parent.name, *parts])


def _show(out: Console, analysis: TypeAnalysis) -> bool:
    """Print a type; return whether it has problems."""
    meta = analysis.meta
    problems = [] if isinstance(meta.problem, Unset) else [meta.problem]
    problems += [f"{action.name}: {action.problem}" for action in analysis.actions if action.disabled]
    kind = f"{meta.base}, abstract: it cannot be placed in a scene" if meta.abstract else meta.base
    shown = "" if meta.shown_name == meta.type else f" “{escape(meta.shown_name)}”"
    out.print(f"[bold]{meta.type}[/]{shown} ({escape(kind)})", soft_wrap=True)
    out.print(f"  {escape(meta.description)}", soft_wrap=True)
    if analysis.implemented:
        out.print(f"  implements {', '.join(sorted(analysis.implemented))}", soft_wrap=True)
    if meta.settings:
        out.print(_settings(meta.settings))
    if analysis.actions:
        out.print(_actions(list(analysis.actions)))
    for problem in problems:
        out.print(f"  [red]problem:[/] {escape(problem)}", soft_wrap=True)
    out.print()
    return bool(problems)


def _settings(parameters: list[ParameterMeta]) -> Table:
    table = Table("setting", "type", "default", "allowed", "description", box=None, padding=(0, 2))
    for parameter in parameters:
        table.add_row(parameter.name, *_columns(parameter))
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
            table.add_row("", parameter.name, *_columns(parameter))
    return table


def _columns(parameter: ParameterMeta) -> tuple[str, str, str, str]:
    texts = (parameter.default_value, parameter.extra, parameter.description)
    default, extra, description = ("" if isinstance(text, Unset) else escape(text) for text in texts)
    return parameter.type, default, extra, description
