"""Field names on REST: camelCase for the snake_case of Structs and websocket."""

import functools
import re
from typing import Any, Final

_HUMP: Final = re.compile(r"(?<=[a-z0-9])([A-Z])")

_NAMES: Final = re.compile(r"`(?:\$[^`]*|\w+)`")


@functools.lru_cache(maxsize=4096)
def camel(name: str) -> str:
    """Return a name as REST writes it: size_x as sizeX."""
    first, *others = name.split("_")
    return first + "".join(other[:1].upper() + other[1:] for other in others)


@functools.lru_cache(maxsize=4096)
def snake(name: str) -> str:
    """Return a name as the Structs have it; both spellings are taken: sizeX and size_x as size_x."""
    return _HUMP.sub(r"_\1", name).lower()


def camelized(value: Any) -> Any:
    """Return JSON data with its fields renamed for REST."""
    if isinstance(value, dict):
        return {camel(key): camelized(item) for key, item in value.items()}
    if isinstance(value, list):
        return [camelized(item) for item in value]
    return value


def snaked(value: Any) -> Any:
    """Return JSON data with its fields renamed for the Structs."""
    if isinstance(value, dict):
        return {snake(key): snaked(item) for key, item in value.items()}
    if isinstance(value, list):
        return [snaked(item) for item in value]
    return value


def camelized_names(text: str) -> str:
    """Return a message of msgspec with the fields that it names as REST has them."""
    return _NAMES.sub(lambda name: camel(name[0]), text)
