"""Actions: the decorator that marks a method as an action, and the types of its parameters."""

from arcor2_hw.actions.decorator import (
    DEFAULT_DEADLINE,
    IntEnum,
    StrEnum,
    action,
    deadline_of,
    metadata_of,
    observation,
)
from arcor2_hw.actions.parameter_types import PARAMETER_TYPES, ParameterType, ScriptNames, by_annotation, parameter_type

__all__ = [
    "DEFAULT_DEADLINE",
    "PARAMETER_TYPES",
    "IntEnum",
    "ParameterType",
    "ScriptNames",
    "StrEnum",
    "action",
    "by_annotation",
    "deadline_of",
    "metadata_of",
    "observation",
    "parameter_type",
]
