"""Length limits of the texts in requests, and the check that enforces them. Only bytes may contain NUL."""

from collections.abc import Mapping
from typing import Any, Final

import msgspec

from arcor2_hw.exceptions import InvalidData, TextTooLong

NAME: Final = 200
"""Limit of the names of users, scenes, projects, objects, points, actions, parameters and packages, in characters."""
DESCRIPTION: Final = 10_000
"""Limit of descriptions and remarks, in characters."""
VALUE: Final = 1_000_000
"""Limit of values and other JSON in a text, in characters."""
OTHER: Final = 1000
"""Limit of every text whose field has no limit of its own, such as identifiers, in characters."""
LIMITS: Final[Mapping[str, int | None]] = (
    dict.fromkeys(
        ("name", "new_name", "target_name", "package_name", "object_name", "user_name", "user", "users"), NAME
    )
    | dict.fromkeys(("description", "new_description", "remark", "problem"), DESCRIPTION)
    | dict.fromkeys(("value", "default_value", "extra"), VALUE)
    | dict.fromkeys(("data", "image", "source", "script", "client", "values"), None)
)
"""Limit by field name; None for content whose size is limited elsewhere."""
BINARY: Final = frozenset({"image"})
"""Fields with bytes as text, one character each, which may be NUL. They are not stored."""
SHORTEST: Final = NAME
"""A message of at most this size, in bytes, cannot contain a text that is too long."""
NUL: Final = b"\\u0000"
"""The character NUL in JSON; also a part of an escaped backslash with `u0000`, which is allowed."""


def needs_check(message: bytes) -> bool:
    """Return whether a request in JSON may contain a text that `check_texts` refuses."""
    return len(message) > SHORTEST or NUL in message


def check_texts(value: Any, field: str = "") -> None:
    """Check the length of every text in a decoded request, and that it does not contain NUL.

    Args:
        value: The request, or a part of it.
        field: Name of the field of `value`.

    Raises:
        TextTooLong: A text is longer than the limit of its field.
        InvalidData: A text contains NUL, which not every database can store.
    """
    if isinstance(value, str):
        limit = LIMITS.get(field, OTHER)
        if limit is not None and len(value) > limit:
            raise TextTooLong(
                "{field} has {count} characters; at most {limit} are allowed. Shorten it.",
                field=field or "A text",
                count=len(value),
                limit=limit,
            )
        if "\0" in value and field not in BINARY:
            raise InvalidData("{field} contains the character NUL. Remove it.", field=field or "A text")
    elif isinstance(value, msgspec.Struct):
        for name in value.__struct_fields__:
            check_texts(getattr(value, name), name)
    elif isinstance(value, list | tuple | set | frozenset):
        for item in value:
            check_texts(item, field)
    elif isinstance(value, dict):
        for key, item in value.items():
            check_texts(key, field)
            check_texts(item, field)
