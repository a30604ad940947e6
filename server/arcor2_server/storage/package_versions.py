"""Versions of the software that a package needs: Python, this library, and distributions that drivers import."""

import importlib.metadata
import inspect
import platform
import re
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Final

import msgspec
from msgspec import field

from arcor2_hw.data.base import Data
from arcor2_hw.data.older_names import OLDER_PACKAGES

FILE: Final = "versions.json"
_OURS: Final = "arcor2-hw"
_SEPARATORS: Final = re.compile(r"[-_.]+")
"""Characters that are equivalent in names of distributions (PEP 503)."""


class Versions(Data, frozen=True):
    """The content of versions.json."""

    arcor2_hw: str
    python: str
    distributions: dict[str, str] = field(default_factory=dict)


@cache
def _distributions() -> dict[str, str]:
    """Return the distribution of each importable name.

    importlib.metadata.packages_distributions of Python 3.11 does not list top-level compiled modules.
    """
    found: dict[str, str] = {}
    for distribution in importlib.metadata.distributions():
        name = _SEPARATORS.sub("-", distribution.metadata["Name"]).lower()
        for first, inside in _top_level(distribution):
            module = first if inside else inspect.getmodulename(first)
            if module and module.isidentifier():
                found.setdefault(module, name)
    return found


def _top_level(distribution: importlib.metadata.Distribution) -> set[tuple[str, bool]]:
    """Return the first parts of the paths of a distribution's files, and whether the path has more parts."""
    if (record := distribution.read_text("RECORD")) is None:  # not installed from a wheel
        return {(path.parts[0], len(path.parts) > 1) for path in distribution.files or ()}
    # A path object for each of some ten thousand files would take most of the time.
    paths = (line.partition(",")[0].strip('"').partition("/") for line in record.splitlines())
    return {(first, bool(slash)) for first, slash, _ in paths if first}


def present(imported: Iterable[str]) -> Versions:
    """Return the installed versions of the distributions that provide the packages `imported`."""
    # Imports of older ARCOR2 packages are redirected to this library when sources run.
    foreign = set(imported) - sys.stdlib_module_names - {"arcor2_hw"} - OLDER_PACKAGES
    # Listing the distributions takes 0.1 s the first time, so it is done only if needed.
    known = _distributions() if foreign else {}
    wanted = {known[name] for name in foreign if name in known} - {_OURS}
    return Versions(
        importlib.metadata.version(_OURS),
        platform.python_version(),
        {name: importlib.metadata.version(name) for name in sorted(wanted)},
    )


def check_versions(package: Path) -> list[str]:
    """Return a sentence for each difference between the versions of a package and those installed here.

    The list is empty for a package without versions.json (an older one, or one built elsewhere).
    """
    try:
        built = msgspec.json.decode((package / FILE).read_bytes(), type=Versions)
    except FileNotFoundError:
        return []
    except (OSError, msgspec.MsgspecError) as error:
        return [f"{FILE} of the package cannot be read: {error}"]
    differences = []
    here = platform.python_version()
    if built.python.split(".")[:2] != here.split(".")[:2]:
        differences.append(f"The package was built for Python {built.python}, but {here} is installed.")
    for name, version in {_OURS: built.arcor2_hw, **built.distributions}.items():
        try:
            found = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            differences.append(f"The package was built with {name} {version}, which is not installed.")
            continue
        if found != version:
            differences.append(f"The package was built with {name} {version}, but {found} is installed.")
    return differences
