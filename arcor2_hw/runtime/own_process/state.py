"""State of an instance. The child process sends it on every change, so that the cell host reads it without waiting."""

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
    "shown_values",
    "move_in_progress",
    "parts",
)
"""Properties and attributes of the base classes that do no I/O."""

State = Mapping[str, tuple[bool, Any]]
"""By name: whether reading succeeded, and the value or the error."""


def names_of(cls: type[Generic], attributes: frozenset[str]) -> list[str]:
    """Return the names in NAMES that the instances of an object type have, given their public attributes."""
    return [name for name in NAMES if name in attributes or hasattr(cls, name)]


def value_of(state: State, name: str) -> Any:
    """Return a value of a state, or raise the error that occurred when it was read."""
    read, value = state[name]
    if not read:
        raise value
    return value
