"""Values of a recipe, which replace the constants and variables of a package when it runs. The files do not change."""

import ast
from collections.abc import Mapping
from typing import Any, Final

import msgspec
from msgspec.structs import replace

from arcor2_hw.data.project import Project
from arcor2_hw.exceptions import InvalidPackage

_LITERALS: Final = {"boolean": bool, "double": float, "integer": int, "string": str}


def with_values(project: Project, values: Mapping[str, str]) -> Project:
    """Return a project with other values.

    Args:
        project: the project.
        values: values by the ids of project parameters, JSON in a string.

    Raises:
        InvalidPackage: the project has no such parameter.
    """
    known = {parameter.id for parameter in project.parameters}
    if unknown := sorted(values.keys() - known):
        raise InvalidPackage("The project has no constant or variable {names}.", names=", ".join(unknown))
    parameters = [replace(one, value=values.get(one.id, one.value)) for one in project.parameters]
    return replace(project, parameters=parameters)


def set_values(tree: ast.Module, project: Project, values: Mapping[str, str]) -> None:
    """Replace the values of constants and variables in a generated script. Lines stay where they are.

    A generated script assigns them, in the order of the project, between the objects and the logic.

    Args:
        tree: the script.
        project: the project as stored in the package.
        values: values by the ids of project parameters, JSON in a string.

    Raises:
        InvalidPackage: the script assigns other constants than the project has, so that it was edited by hand.
    """
    literals = [one for one in project.parameters if one.type in _LITERALS]
    ordered = sorted(literals, key=lambda one: one.variable is True)  # constants first
    found = _assigned(tree)
    if len(found) != len(ordered):
        raise InvalidPackage(
            "The values of the recipe cannot be used: the script assigns {found} constants and variables, the project "
            "has {expected}. Build the package again.",
            found=len(found),
            expected=len(ordered),
        )
    for parameter, assignment in zip(ordered, found, strict=True):
        if parameter.id not in values:
            continue
        before = assignment.value
        if before is None or ast.literal_eval(before) != msgspec.json.decode(parameter.value):
            raise InvalidPackage(
                "The value of {name} cannot be used: the script does not assign the value that the project states. "
                "Build the package again.",
                name=parameter.name,
            )
        value: Any = msgspec.json.decode(values[parameter.id], type=_LITERALS[parameter.type])
        after = ast.parse(repr(value), mode="eval").body
        for node in ast.walk(after):
            ast.copy_location(node, before)
        assignment.value = after


def _assigned(tree: ast.Module) -> list[ast.Assign | ast.AnnAssign]:
    """Return the assignments of literals before the logic in `main` of a generated script."""
    main = next((node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "main"), None)
    found: list[ast.Assign | ast.AnnAssign] = []
    for node in () if main is None else main.body:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):  # the docstring
            continue
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            break
        if isinstance(node.value, ast.Call) and isinstance(node.value.func, ast.Attribute):  # an action
            break
        try:
            ast.literal_eval(node.value)
        except ValueError:
            continue  # an object
        found.append(node)
    return found
