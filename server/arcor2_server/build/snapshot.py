"""Copies the code of object types into a package: uploaded modules and driver folders."""

import ast
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

from arcor2_hw.analysis import Enumeration
from arcor2_hw.exceptions import InvalidProject
from arcor2_hw.parsing import parse
from arcor2_hw.runtime.type_files import files_of_type
from arcor2_server.build.naming import Names
from arcor2_server.build.style import docstring
from arcor2_server.object_types.catalog import PackageType

FOLDER: Final = "object_types"
_LEFT_OUT: Final = frozenset({"__pycache__", ".mypy_cache", ".ruff_cache", ".pytest_cache"})
_MODULE: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


class _Imports(NamedTuple):
    absolute: frozenset[str]
    """Dotted names that may be modules."""
    level: int
    """The largest number of leading dots of a relative import."""


@lru_cache(maxsize=1024)
def _imports(source: bytes) -> _Imports:
    """Return the imports of a source."""
    try:
        tree = parse(source)
    except (SyntaxError, ValueError):
        return _Imports(frozenset(), 0)  # the analysis reports the error
    found: set[str] = set()
    level = 0
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            level = max(level, node.level)
            if node.level == 0 and node.module:
                found.add(node.module)
                found.update(f"{node.module}.{alias.name}" for alias in node.names)
    return _Imports(frozenset(found), level)


def imported_packages(files: Mapping[str, bytes]) -> set[str]:
    """Return the names of the packages that the Python files among `files` import."""
    return {
        name.partition(".")[0]
        for path, content in files.items()
        if path.endswith(".py")
        for name in _imports(content).absolute
    }


def _files_below(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.rglob("*")):
        inner = path.relative_to(folder)
        hidden = any(part in _LEFT_OUT or part.startswith(".") for part in inner.parts)
        if not hidden and path.suffix != ".pyc" and path.is_file() and path.resolve().is_relative_to(folder.resolve()):
            yield path


def _module_names(package_type: PackageType, folder: Path) -> tuple[str, str]:
    """Return the dotted names of a driver's folder and of the type's module in it ("" for the folder itself)."""
    module = package_type.entry_point.partition(":")[0].split(".")
    for end in range(1, len(module) + 1):
        *between, last = module[end:] or [""]
        files = (folder.joinpath(*between, f"{last}.py"), folder.joinpath(*between, last, "__init__.py"))
        # A module and nested folders may have the same name: check which files exist.
        if module[end - 1] == folder.name and any(file.is_file() for file in files):
            return ".".join(module[:end]), ".".join(module[end:])
    raise InvalidProject(
        "object type {name}: its entry point {entry_point} is not in its folder {folder_name}",
        name=package_type.name,
        entry_point=package_type.entry_point,
        folder_name=folder.name,
    )


def _check_imports(package_type: PackageType, path: Path, content: bytes, own_name: str) -> None:
    """Raise InvalidProject if a driver imports itself by its full name, or a module outside of its folder.

    With such an import the package would run the installed code instead of its copy.
    """
    if path.suffix != ".py" or package_type.folder is None:
        return
    imports = _imports(content)
    if imports.level > len(path.relative_to(package_type.folder).parts):
        raise InvalidProject(
            "object type {name}: {path_name} imports from outside of the folder {folder_name}",
            name=package_type.name,
            path_name=path.name,
            folder_name=package_type.folder.name,
        )
    vendor = own_name.partition(".")[0]
    for name in imports.absolute:
        if (
            name == own_name
            or name.startswith(f"{own_name}.")
            or (vendor != "arcor2_hw" and name.partition(".")[0] == vendor)
        ):
            raise InvalidProject(
                "object type {name}: {path_name} imports {other_name}; a driver must import its own folder relatively",
                name=package_type.name,
                path_name=path.name,
                other_name=name,
            )


def _import_module(
    package_type: PackageType, own_name: str, copied: str, inner: str, kinds: Iterable[Enumeration]
) -> bytes:
    """Return a module that imports an installed type and the enumerations of its actions from the copied folder."""
    place = f".{copied}{'.' if inner else ''}{inner}"
    imported = {package_type.entry_point.partition(":")[2] or package_type.name: place}
    for kind in kinds:
        inside = kind.module == own_name or kind.module.startswith(f"{own_name}.")
        source = f".{copied}{kind.module.removeprefix(own_name)}" if inside else kind.module
        name = kind.name.partition(".")[0]
        if "." in kind.name and imported.get(name) == place:
            continue  # nested in the type itself
        if imported.setdefault(name, source) != source:
            raise InvalidProject(
                "object type {name}: two parameter types of its actions have the name {other_name}",
                name=package_type.name,
                other_name=name,
            )
    about = docstring(
        f"{package_type.name} of {package_type.distribution} {package_type.version}, as of the build of this package."
    )
    lines = [f"from {source} import {name} as {name}" for name, source in imported.items()]
    return "\n".join([about, "", *lines, ""]).encode()


def files_of(types: Sequence[PackageType], enumerations: Mapping[str, Iterable[Enumeration]]) -> dict[str, bytes]:
    """Return the files of object types by path in the package.

    Args:
        types: the object types.
        enumerations: parameter types of the actions, by object type.

    Raises:
        InvalidProject: a type cannot be copied.
    """
    files: dict[str, bytes] = {f"{FOLDER}/__init__.py": b""}
    for one in types:
        if not _MODULE.fullmatch(one.module):
            raise InvalidProject(
                "object type {name}: {module!r} is not a valid module name", name=one.name, module=one.module
            )
        if one.source:
            texts = files_of_type(one.module, one.source, one.modules)
            files |= {f"{FOLDER}/{path}": text.encode() for path, text in texts.items()}
    names = Names(one.module for one in types)
    folders: dict[Path, str] = {}
    for one in types:
        if one.source:
            continue
        if one.folder is None or not one.folder.is_dir():
            raise InvalidProject("object type {name} cannot be copied: it is not in its own folder", name=one.name)
        own, inner = _module_names(one, one.folder)
        if one.folder not in folders:
            folders[one.folder] = copied = names.claim(one.folder.name, f"{one.folder.name}_driver")
            for path in _files_below(one.folder):
                content = path.read_bytes()
                _check_imports(one, path, content, own)
                files[f"{FOLDER}/{copied}/{path.relative_to(one.folder).as_posix()}"] = content
        copied = folders[one.folder]
        files[f"{FOLDER}/{one.module}.py"] = _import_module(one, own, copied, inner, enumerations.get(one.name, ()))
    return files
