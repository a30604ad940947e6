"""State of an instance that the cell host reads without waiting: the child process sends it whenever it changes."""

from collections.abc import Mapping
from typing import Any, Final

from arcor2_hw.objects import Generic

NAMES: Final = (
    "id",
    "name",
    "pose",
    "collision_model",
    "enabled",
    "connection",
    "connection_reason",
    "health",
    "move_in_progress",
    "parts",
)
"""Properties and attributes of the base classes that are memory by contract."""

State = Mapping[str, tuple[bool, Any]]
"""By name: whether it could be read, and the value or the error."""


def names_of(cls: type[Generic], attributes: frozenset[str]) -> list[str]:
    """Return the names that instances of an object type have, given their public attributes."""
    return [name for name in NAMES if name in attributes or hasattr(cls, name)]


def value_of(state: State, name: str) -> Any:
    """Return a value of a state, or raise the error that reading it raised."""
    read, value = state[name]
    if not read:
        raise value
    return value
