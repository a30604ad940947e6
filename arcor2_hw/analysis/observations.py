"""Observations of object types that interlocks compare (`@observation`)."""

import ast
import re
from collections.abc import Iterator
from typing import Final

from arcor2_hw.actions.json_values import encode
from arcor2_hw.analysis.constants import enum_members
from arcor2_hw.analysis.hierarchy import Hierarchy
from arcor2_hw.analysis.hints import meaning, parameter_type_of, plain
from arcor2_hw.analysis.module import ClassInfo, FunctionNode
from arcor2_hw.analysis.source import sendable
from arcor2_hw.analysis.symbols import framework_name
from arcor2_hw.analysis.units import unit_in
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.object_type import ObservationMeta

_ERRORS: Final = re.compile(r"\s+Raises? .*")
"""The sentences of a docstring about errors, which are not shown to users."""
_TYPES: Final = ("boolean", "integer", "double", "string", "string_enum", "integer_enum")
"""Parameter types of values that can be compared."""


def observations_of(info: ClassInfo, hierarchy: Hierarchy) -> list[ObservationMeta]:
    """Return the observations of a class and its ancestors, by name.

    Raises:
        Broken: The type of an observation cannot be compared.
    """
    return sorted(_found(info, hierarchy), key=lambda one: one.name)


def _found(info: ClassInfo, hierarchy: Hierarchy) -> Iterator[ObservationMeta]:
    seen: set[str] = set()
    for owner in hierarchy.ancestors(info):
        for name in owner.members:
            node = owner.function(name)
            if node is None or name in seen or hierarchy.is_hook_only(node, owner):
                continue
            if _is_marked(owner, node, hierarchy):
                yield _observation(owner, node, hierarchy)
        seen |= set(owner.members)


def _is_marked(owner: ClassInfo, node: FunctionNode, hierarchy: Hierarchy) -> bool:
    symbols = (hierarchy.resolver.expression(each, owner.module, owner) for each in node.decorator_list)
    return any(framework_name(symbol) == "observation" for symbol in symbols)


def _observation(owner: ClassInfo, node: FunctionNode, hierarchy: Hierarchy) -> ObservationMeta:
    resolver, name = hierarchy.resolver, node.name
    given = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs][1:]
    if node.returns is None or len(given) > 1:
        raise owner.problem("{observation}: an observation needs a return annotation and at most one parameter", node,
                            observation=name)  # fmt: skip
    hint = plain(node.returns, owner.module)
    if (
        isinstance(hint, ast.Subscript)
        and framework_name(meaning(hint.value, owner.module, owner, resolver)) == "Reading"
    ):
        hint = hint.slice
    kind, enumeration = parameter_type_of(hint, owner.module, owner, resolver)
    if kind.name not in _TYPES:
        raise owner.problem("{observation}: values of the type {type} cannot be compared", node, observation=name,
                            type=kind.name)  # fmt: skip
    members = None if enumeration is None else enum_members(enumeration, resolver)
    text = (ast.get_docstring(node, clean=False) or "").strip().partition("\n")[0]
    return ObservationMeta(
        name,
        kind.name,
        sendable(_ERRORS.sub("", text)),
        unit_in(text) or UNSET,
        UNSET if members is None else [encode(value) for value in dict.fromkeys(members.values())],
        bool(given) or UNSET,
    )
