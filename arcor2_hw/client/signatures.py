"""Names, parameters and descriptions of the methods of Requests, from the declarations of the requests."""

import re
import typing
from collections.abc import Sequence, Set
from inspect import Parameter
from typing import Any, Final

import msgspec
from msgspec import NODEFAULT, Struct

from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import Rpc

COLLECTIONS: Final[dict[Any, tuple[Any, Any]]] = {list: (Sequence, ()), set: (Set, frozenset())}
"""Type and default of the parameter for a field that is empty by default, by type of the field."""


def method_name(request: str) -> str:
    """Return the name of the method of a request: add_ap_using_robot for AddApUsingRobot."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", request).lower()


def parameters(rpc: Rpc) -> list[Parameter]:
    """Return the parameters of the method of a request, without `self`. Required ones come first.

    A single required field of the arguments may be passed by position.
    """
    found: list[Parameter] = []
    if (struct := struct_of(rpc)) is not None:
        found = sorted(_fields(struct), key=lambda parameter: parameter.default is not Parameter.empty)
        if [parameter.default for parameter in found].count(Parameter.empty) == 1:
            found[0] = found[0].replace(kind=Parameter.POSITIONAL_OR_KEYWORD)
    elif rpc.args is not None:
        default = None if rpc.args_optional else Parameter.empty
        hint = rpc.args | None if rpc.args_optional else rpc.args
        found = [Parameter("items", Parameter.POSITIONAL_OR_KEYWORD, default=default, annotation=hint)]
    if rpc.dry_run:
        found.append(Parameter("dry_run", Parameter.KEYWORD_ONLY, default=False, annotation=bool))
    return [*found, Parameter("timeout", Parameter.KEYWORD_ONLY, default=None, annotation=float | None)]


def struct_of(rpc: Rpc) -> type[Struct] | None:
    """Return the Struct of the arguments of a request, or None if they are something else."""
    return rpc.args if isinstance(rpc.args, type) and issubclass(rpc.args, Struct) else None


def _fields(struct: type[Struct]) -> list[Parameter]:
    hints = typing.get_type_hints(struct)
    found = []
    for field in msgspec.structs.fields(struct):
        default, hint = field.default, hints[field.name]
        if field.default_factory is not NODEFAULT:
            if field.default_factory not in COLLECTIONS:
                raise TypeError(f"{struct.__name__}.{field.name}: the default {field.default_factory} is not supported")
            collection, default = COLLECTIONS[field.default_factory]
            hint = collection[typing.get_args(hint)]
        elif default is NODEFAULT:
            default = Parameter.empty
        found.append(Parameter(field.name, Parameter.KEYWORD_ONLY, default=default, annotation=hint))
    return found


def description(rpc: Rpc) -> str:
    """Return the text of the docstring of a method: that of the arguments, and the role."""
    text = ""
    if (struct := struct_of(rpc)) is not None:
        first = (struct.__doc__ or "").split("\n\n")[0]
        _, colon, more = " ".join(first.split()).partition(": ")
        text = f": {more.rstrip('.')}" if colon else ""
    role = Role(rpc.role).name.lower().replace("_", " ")
    return f"{rpc.name}{text}. Needs the role {role}."
