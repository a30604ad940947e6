"""Object types of installed distributions, found by their entry points without importing them."""

import importlib.util
import sys
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Final

from arcor2_hw.analysis.source import Problem, SourceFile
from arcor2_hw.data.base import Data
from arcor2_hw.messages import Message

GROUP: Final = "arcor2_hw.object_types"
"""Entry point group of object types: `UR5e = "package.module:UR5e"`."""


class InstalledType(Data, frozen=True):
    """An object type of an installed distribution.

    Attributes:
        entry_point: `module:Class`.
        folder: Folder of its file and the files that belong to it.
        file: None when it cannot be found or read.
        problem: Why it cannot be found or read.
    """

    name: str
    entry_point: str
    distribution: str
    version: str
    folder: str
    file: SourceFile | None
    problem: Problem | None = None


def installed_types() -> list[InstalledType]:
    """Return the object types of all installed distributions by name, for equal names the first one."""
    found: dict[str, InstalledType] = {}
    for point in entry_points(group=GROUP):
        each = _installed(point)
        found.setdefault(each.name, each)
    return [found[name] for name in sorted(found)]


def _installed(point: EntryPoint) -> InstalledType:
    distribution = point.dist
    name = point.attr or point.name
    origin = (distribution.name, distribution.version) if distribution is not None else ("", "")
    located = _locate(point.module)
    if located is None:
        text = "the module {module} of the entry point {name} is not installed"
        problem = Problem(Message.of(text, module=point.module, name=point.name), point.value, 1)
        return InstalledType(name, point.value, *origin, "", None, problem)
    path, is_package = located
    try:
        source = _read(str(path), path.stat().st_mtime_ns)
    except OSError as error:
        problem = Problem(Message.of("the file cannot be read: {reason}", reason=error.strerror), str(path), 1)
        return InstalledType(name, point.value, *origin, str(path.parent), None, problem)
    file = SourceFile(name, point.module, source, str(path), is_package)
    return InstalledType(name, point.value, *origin, str(path.parent), file)


def _locate(dotted: str) -> tuple[Path, bool] | None:
    """Find the file of a module. Only the finder of the top-level package is used; no package is imported."""
    top, *rest = dotted.split(".")
    if not all(part.isidentifier() for part in (top, *rest)):
        return None
    for place in _top_level(top):
        base = place.joinpath(*rest)
        if rest and (path := base.with_suffix(".py")).is_file():
            return path, False
        if (path := base / "__init__.py").is_file():
            return path, True
    return None


def _top_level(name: str) -> list[Path]:
    """Return the folders of a top-level package, also of an editable installation or a namespace package."""
    loaded = sys.modules.get(name)
    if loaded is not None and getattr(loaded, "__path__", None):
        return [Path(place) for place in loaded.__path__]
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return []
    return [Path(place) for place in spec.submodule_search_locations or ()] if spec is not None else []


@lru_cache(maxsize=512)
def _read(path: str, modified: int) -> bytes:  # noqa: ARG001 - the time of the last change is part of the key
    return Path(path).read_bytes()
