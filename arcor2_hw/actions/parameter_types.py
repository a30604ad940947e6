"""All parameter types of actions by name and by type hint (protocol, section 9.4)."""

from typing import Final

from arcor2_hw.actions.parameter_type import Extra, ParameterType, ScriptNames, read_json, read_reference
from arcor2_hw.actions.reference_types import ImageType, JointsType, PoseType, PositionType
from arcor2_hw.actions.scalar_types import (
    BooleanType,
    DoubleType,
    IntegerEnumType,
    IntegerType,
    StringEnumType,
    StringType,
)
from arcor2_hw.exceptions import InvalidData

__all__ = [
    "PARAMETER_TYPES",
    "Extra",
    "ParameterType",
    "ScriptNames",
    "by_annotation",
    "parameter_type",
    "read_json",
    "read_reference",
]

PARAMETER_TYPES: Final[dict[str, ParameterType]] = {
    kind.name: kind
    for kind in (
        BooleanType(),
        IntegerType(),
        DoubleType(),
        StringType(),
        StringEnumType(),
        IntegerEnumType(),
        PoseType(),
        PositionType(),
        JointsType(),
        ImageType(),
    )
}
"""Every parameter type by its name in the protocol."""

_BY_ANNOTATION: Final = {hint: kind for kind in PARAMETER_TYPES.values() for hint in kind.annotations}


def by_annotation(name: str) -> ParameterType | None:
    """Return the parameter type of a type hint, or None if there is none.

    A dotted hint is matched by its end (`common.Pose`). For an enumeration pass its base class (StrEnum, IntEnum).
    """
    parts = name.split(".")
    return _BY_ANNOTATION.get(".".join(parts[-2:])) or _BY_ANNOTATION.get(parts[-1])


def parameter_type(name: str) -> ParameterType:
    """Return the parameter type of a name.

    Raises:
        InvalidData: The type does not exist.
    """
    try:
        return PARAMETER_TYPES[name]
    except KeyError:
        raise InvalidData("Parameter type {name!r:.80} does not exist.", name=name) from None
