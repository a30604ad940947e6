"""The files of uploaded object types in the package `object_types`.

A type without modules of its own is a module. One with modules is a package that contains them, so that two types may
have modules of the same name.
"""

import ast
from collections.abc import Mapping

from arcor2_hw.parsing import parse


def sibling_modules(source: str) -> set[str]:
    """Return the sibling modules that an object type's module imports (`from .arm import Arm`)."""
    found: set[str] = set()
    try:
        tree = parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return found  # the analysis reports errors of the source
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level == 1:
            found |= {node.module.partition(".")[0]} if node.module else {alias.name for alias in node.names}
    return found


def shared_modules(source: str, modules: Mapping[str, str]) -> set[str]:
    """Return the sibling modules that a type and its own modules import, without its own modules."""
    return set().union(*map(sibling_modules, (source, *modules.values()))) - modules.keys()


def forwarding_source(module: str) -> str:
    """Return the source of a module that forwards to a shared module."""
    return (
        f'"""The module {module}, which does not belong to this object type only."""\n\n'
        "import importlib\nimport sys\n\n"
        f'sys.modules[__name__] = importlib.import_module("object_types.{module}")\n'
    )


def files_of_type(module: str, source: str, modules: Mapping[str, str]) -> dict[str, str]:
    """Return the files of a type by path below `object_types`.

    Args:
        module: Name of the type's module.
        source: Source of the type.
        modules: Sources of the modules that belong to the type, by name.
    """
    if not modules:
        return {f"{module}.py": source}
    files = {f"{module}/__init__.py": source}
    files |= {f"{module}/{name}.py": text for name, text in modules.items()}
    for name in sorted(shared_modules(source, modules)):
        files[f"{module}/{name}.py"] = forwarding_source(name)
    return files


def own_modules(folder: Mapping[str, str]) -> dict[str, str]:
    """Return the modules that belong to a type from the modules in its folder, without forwarding ones."""
    return {name: text for name, text in folder.items() if name != "__init__" and text != forwarding_source(name)}
