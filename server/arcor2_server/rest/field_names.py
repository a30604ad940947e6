"""Converts field names between camelCase on REST and snake_case in Structs."""

import functools
import re
from typing import Any, Final

_HUMP: Final = re.compile(r"(?<=[a-z0-9])([A-Z])")
"""Matches an upper-case letter inside a name."""
_NAMES: Final = re.compile(r"`(?:\$[^`]*|\w+)`")
"""Matches a field or a path in a message of msgspec."""


@functools.lru_cache(maxsize=4096)
def camel(name: str) -> str:
    """Return a name in camelCase: sizeX for size_x."""
    first, *others = name.split("_")
    return first + "".join(other[:1].upper() + other[1:] for other in others)


@functools.lru_cache(maxsize=4096)
def snake(name: str) -> str:
    """Return a name in snake_case: size_x for sizeX and for size_x."""
    return _HUMP.sub(r"_\1", name).lower()


def camelized(value: Any) -> Any:
    """Return JSON data with its field names in camelCase."""
    if isinstance(value, dict):
        return {camel(key): camelized(item) for key, item in value.items()}
    if isinstance(value, list):
        return [camelized(item) for item in value]
    return value


def snaked(value: Any) -> Any:
    """Return JSON data with its field names in snake_case."""
    if isinstance(value, dict):
        return {snake(key): snaked(item) for key, item in value.items()}
    if isinstance(value, list):
        return [snaked(item) for item in value]
    return value


def camelized_names(text: str) -> str:
    """Return a message of msgspec with its field names in camelCase."""
    return _NAMES.sub(lambda name: camel(name[0]), text)
