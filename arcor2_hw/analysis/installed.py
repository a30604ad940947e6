"""Object types of installed distributions, found by their entry points without importing them."""

import importlib.util
import os
import site
import sys
from collections.abc import Iterator
from functools import lru_cache
from importlib.metadata import Distribution, EntryPoint, distributions
from pathlib import Path
from typing import Final

import humps

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
    """Return the object types of all installed distributions by name, for equal names only the first one.

    A distribution whose metadata cannot be read is listed as a type with a problem, named after its files.
    """
    found: dict[str, InstalledType] = {}
    seen: set[str] = set()
    for distribution in distributions():
        folder = Path(str(getattr(distribution, "_path", "")))
        own = folder.name.partition("-")[0]
        if own.lower() not in seen:  # Python imports the first of two versions in the search path
            seen.add(own.lower())
            for each in _types_of(distribution, folder, own):
                found.setdefault(each.name, each)
    return [found[name] for name in sorted(found)]


def installation_stamp() -> frozenset[tuple[str, int]]:
    """Return a value that differs after a distribution was installed, changed or removed."""
    found: set[tuple[str, int]] = set()
    for folder in tuple(sys.path):
        try:
            with os.scandir(folder or ".") as entries:
                marks = [each for each in entries if each.name.endswith((".dist-info", ".egg-info", ".pth"))]
            found |= {(each.path, each.stat().st_mtime_ns) for each in marks}
        except OSError:
            continue  # an archive, a missing folder, or a distribution that is just being removed
    return frozenset(found)


def find_new_distributions() -> None:
    """Let this process find distributions that were installed after it started, also editable ones."""
    for folder in {*site.getsitepackages(), site.getusersitepackages()} & set(sys.path):
        site.addsitedir(folder)
    importlib.invalidate_caches()


def _problem(template: str, place: Path | str, **values: object) -> Problem:
    return Problem(Message.of(template, **values), str(place), 1)


def _types_of(distribution: Distribution, folder: Path, exclude: str) -> Iterator[InstalledType]:
    try:
        points = [point for point in distribution.entry_points if point.group == GROUP]
        origin = (distribution.name or exclude, distribution.version or "") if points else ("", "")
    except (OSError, ValueError, LookupError, AttributeError, TypeError) as error:
        text = "the metadata of the distribution {own} cannot be read: {error!r}"
        problem = _problem(text, folder, own=exclude, error=error)
        yield InstalledType(str(humps.pascalize(exclude)), "", exclude, "", "", None, problem)
        return
    for point in points:
        if EntryPoint.pattern.fullmatch(point.value) is None:
            text = "the entry point {name} is invalid: {value!r}"
            problem = _problem(text, folder, name=point.name, value=point.value)
            yield InstalledType(point.name, point.value, *origin, "", None, problem)
        else:
            yield _installed(point, origin)


def _installed(point: EntryPoint, origin: tuple[str, str]) -> InstalledType:
    name = point.attr or point.name
    located = _locate(point.module)
    if located is None:
        text = "the module {module} of the entry point {name} is not installed"
        problem = _problem(text, point.value, module=point.module, name=point.name)
        return InstalledType(name, point.value, *origin, "", None, problem)
    path, is_package = located
    try:
        source = _read(str(path), path.stat().st_mtime_ns)
    except OSError as error:
        problem = _problem("the file cannot be read: {reason}", path, reason=error.strerror)
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
