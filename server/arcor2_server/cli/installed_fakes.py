"""Finds the simulated devices of installed distributions by entry point, without importing them."""

import ast
import importlib.util
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Final

from msgspec import Struct

from arcor2_hw.parsing import parse

GROUP: Final = "arcor2_hw.fakes"
"""The entry point group of fakes: `tester = "package.module"`. The module is run with `python -m`."""


class InstalledFake(Struct, frozen=True):
    """A fake: its module, its description, and the problem if its source code cannot be read."""

    name: str
    module: str
    wire: str = ""
    description: str = ""
    problem: str = ""


def installed_fakes() -> list[InstalledFake]:
    """Return the fakes of all installed distributions, sorted by name.

    If two have the same name, the first one is used.
    """
    found: dict[str, InstalledFake] = {}
    for point in entry_points(group=GROUP):
        found.setdefault(point.name, _read(point))
    return [found[name] for name in sorted(found)]


def _read(point: EntryPoint) -> InstalledFake:
    """Read a fake without importing it: its constant WIRE and the first line of its docstring."""
    file = _source(point.value)
    if file is None:
        return InstalledFake(point.name, point.value, problem=f"the module {point.value} is not installed")
    try:
        tree = parse(file.read_bytes())
    except (OSError, SyntaxError, ValueError) as error:
        return InstalledFake(point.name, point.value, problem=f"{file} cannot be read: {error}")
    wire = next(
        (
            node.value.value
            for node in tree.body
            if isinstance(node, ast.Assign | ast.AnnAssign)
            and isinstance(target := node.targets[0] if isinstance(node, ast.Assign) else node.target, ast.Name)
            and target.id == "WIRE"
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ),
        "",
    )
    lines = (ast.get_docstring(tree) or "").splitlines()
    return InstalledFake(point.name, point.value, wire, lines[0] if lines else "")


def _source(dotted: str) -> Path | None:
    """Return the file of a module, None if it is missing. No package is imported."""
    top, *rest = dotted.split(".")
    try:
        spec = importlib.util.find_spec(top)
    except (ImportError, ValueError):
        return None
    if spec is None:
        return None
    if not rest:
        return Path(spec.origin) if spec.origin else None
    for place in spec.submodule_search_locations or ():
        base = Path(place).joinpath(*rest)
        for file in (base / "__init__.py", base.with_suffix(".py")):
            if file.is_file():
                return file
    return None
