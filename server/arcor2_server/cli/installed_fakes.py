"""The fakes of installed distributions, found by entry point and read as source without importing them."""

import ast
import importlib.util
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Final

from msgspec import Struct

GROUP: Final = "arcor2_hw.fakes"
"""The entry point group in which a distribution names its fakes: `tester = "package.module"`, run by `python -m`."""


class InstalledFake(Struct, frozen=True):
    """A fake: what `python -m` runs, and what its source says of it; `problem` when there is none to be read."""

    name: str
    module: str
    wire: str = ""
    description: str = ""
    problem: str = ""


def installed_fakes() -> list[InstalledFake]:
    """Return the fakes of all installed distributions, by name; of two with one name the first."""
    found: dict[str, InstalledFake] = {}
    for point in entry_points(group=GROUP):
        found.setdefault(point.name, _read(point))
    return [found[name] for name in sorted(found)]


def _read(point: EntryPoint) -> InstalledFake:
    """Read a fake's source: its description is the docstring's first line, its wire a constant WIRE."""
    file = _source(point.value)
    if file is None:
        return InstalledFake(point.name, point.value, problem=f"the module {point.value} is not installed")
    try:
        tree = ast.parse(file.read_bytes())
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
    """Find a module's file; only the finder of the top-level package is asked, and no package is imported."""
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
