"""Keyword-only parameters of actions."""

from collections.abc import Iterable

from arcor2_hw.analysis.hierarchy import Hierarchy
from arcor2_hw.analysis.module import ClassInfo
from arcor2_hw.data.object_type import ObjectAction


def keyword_only(info: ClassInfo, actions: Iterable[ObjectAction], hierarchy: Hierarchy) -> frozenset[tuple[str, str]]:
    """Return the parameters after a bare `*` of the actions of a class, except `an`, by action and parameter."""
    found: set[tuple[str, str]] = set()
    for action in actions:
        defined = (each.function(action.name) for each in hierarchy.ancestors(info))
        if (node := next((node for node in defined if node is not None), None)) is not None:
            found |= {(action.name, argument.arg) for argument in node.args.kwonlyargs if argument.arg != "an"}
    return frozenset(found)
