"""Enumerations of actions' parameters: where they are defined, and the names of their members."""

from collections.abc import Iterable
from typing import Final

from arcor2_hw.analysis.constants import enum_members
from arcor2_hw.analysis.hierarchy import Hierarchy
from arcor2_hw.analysis.hints import parameter_type_of
from arcor2_hw.analysis.module import ClassInfo, FunctionNode
from arcor2_hw.analysis.source import AnalysisStopped
from arcor2_hw.data.base import Data
from arcor2_hw.data.object_type import ObjectAction

_KINDS: Final = ("string_enum", "integer_enum")


class Enumeration(Data, frozen=True):
    """An enumeration: the dotted module that defines it, its name there (`Arm.Grip` when nested), members by value."""

    module: str
    name: str
    members: dict[str | int, str]


def enumerations_of(
    info: ClassInfo, actions: Iterable[ObjectAction], hierarchy: Hierarchy
) -> dict[tuple[str, str], Enumeration]:
    """Return the enumerations of the actions of a class, by action and parameter."""
    found: dict[tuple[str, str], Enumeration] = {}
    for action in actions:
        wanted = {parameter.name for parameter in action.parameters if parameter.type in _KINDS}
        if not wanted:
            continue
        defined = ((each, each.function(action.name)) for each in hierarchy.ancestors(info))
        owner, node = next(((each, node) for each, node in defined if node is not None), (info, None))
        if node is None:
            continue
        for name in wanted:
            if (enumeration := _taken(owner, node, name, hierarchy)) is not None:
                found[action.name, name] = enumeration
    return found


def _taken(owner: ClassInfo, node: FunctionNode, parameter: str, hierarchy: Hierarchy) -> Enumeration | None:
    arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    hint = next((argument.annotation for argument in arguments if argument.arg == parameter), None)
    if hint is None:
        return None
    try:
        _, kind = parameter_type_of(hint, owner.module, owner, hierarchy.resolver)
        members = enum_members(kind, hierarchy.resolver) if kind is not None else None
    except AnalysisStopped:
        return None
    if kind is None or members is None:
        return None
    path = _path(kind)
    if path is None:
        return None
    # The first of several names of one value is the member, the others are aliases.
    by_value = {value: name for name, value in reversed(members.items())}
    return Enumeration(kind.module.dotted, path, by_value)


def _path(kind: ClassInfo) -> str | None:
    """Return the name of a class in its module, or None if it is local to a function."""
    top = kind.module.bindings
    if top.get(kind.name) is kind:
        return kind.name
    for each in top.values():
        if isinstance(each, ClassInfo) and each.members.get(kind.name) is kind:
            return f"{each.name}.{kind.name}"
    return None
