"""Display names, categories and icons of types and their actions in the editor."""

import ast
import re
from typing import Final, NamedTuple

from arcor2_hw.analysis.constants import constant
from arcor2_hw.analysis.hierarchy import Hierarchy
from arcor2_hw.analysis.module import ClassInfo, FunctionNode
from arcor2_hw.analysis.source import AnalysisStopped, sendable
from arcor2_hw.analysis.symbols import framework_name
from arcor2_hw.data.base import UNSET, Unset

_ICON: Final = re.compile(r"[a-z0-9][a-z0-9_-]{0,39}")
_LONGEST: Final = 40


class Presentation(NamedTuple):
    """Category and icon name in the editor."""

    category: str | Unset = UNSET
    icon: str | Unset = UNSET


def of_type(info: ClassInfo, hierarchy: Hierarchy) -> Presentation:
    """Return the class attributes `category` and `icon`, own or inherited.

    Invalid values are ignored without an error, because an older type may use these names for something else.
    """

    def text(name: str) -> object:
        try:
            return hierarchy.attribute(info, name)
        except AnalysisStopped:
            return None

    return Presentation(_title(text("category")), _icon(text("icon")))


def display_name(info: ClassInfo, hierarchy: Hierarchy) -> str | Unset:
    """Return the class attribute `display_name` of the type itself; an invalid value is ignored."""
    if "display_name" not in info.members:
        return UNSET
    try:
        return _title(hierarchy.attribute(info, "display_name"))
    except AnalysisStopped:
        return UNSET


def of_action(node: FunctionNode, owner: ClassInfo, inherited: Presentation, hierarchy: Hierarchy) -> Presentation:
    """Return the arguments of `@action(category=..., icon=...)`; default: those of the type."""
    resolver = hierarchy.resolver
    for decorator in node.decorator_list:
        if not isinstance(decorator, ast.Call):
            continue
        if framework_name(resolver.expression(decorator.func, owner.module, owner)) != "action":
            continue
        given = {}
        for keyword in decorator.keywords:
            if keyword.arg in ("category", "icon"):
                given[keyword.arg] = constant(keyword.value, owner.module, owner, resolver)
        category, icon = _title(given.get("category")), _icon(given.get("icon"))
        for name, value in (("category", category), ("icon", icon)):
            if name in given and isinstance(value, Unset):
                raise owner.problem(
                    "{action}: {value!r:.60} is not a valid {name}",
                    decorator,
                    action=node.name,
                    value=given[name],
                    name=name,
                )
        return Presentation(
            inherited.category if isinstance(category, Unset) else category,
            inherited.icon if isinstance(icon, Unset) else icon,
        )
    return inherited


def _title(value: object) -> str | Unset:
    if not isinstance(value, str) or not value.strip() or len(value) > _LONGEST or not value.isprintable():
        return UNSET
    return sendable(value.strip())


def _icon(value: object) -> str | Unset:
    return value if isinstance(value, str) and _ICON.fullmatch(value) else UNSET
