"""Names in generated code: valid, unique identifiers that are the same for the same project."""

import keyword
import re
from collections.abc import Iterable
from typing import Final

import humps

_INVALID: Final = re.compile(r"\W", re.ASCII)


def identifier(text: str) -> str:
    """Convert text to a Python identifier.

    It never starts with two underscores, since Python mangles such names in classes.
    """
    name = _INVALID.sub("_", text)
    if name.startswith("__"):
        name = f"_{name.lstrip('_')}"
    if not name or name[0].isdigit():
        name = f"_{name}"
    return f"{name}_" if keyword.iskeyword(name) else name


def class_name(text: str) -> str:
    """Convert text to a class name: `pick_up2` becomes `PickUp2`."""
    name = str(humps.pascalize(identifier(text).strip("_"))).replace("_", "")
    return identifier(name[:1].upper() + name[1:]) if name else "Nameless"


class Names:
    """The names of one scope."""

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._taken = set(taken)
        self._next: dict[str, int] = {}

    def claim(self, text: str, *others: str) -> str:
        """Reserve and return a name: `text`, else the first free one of `others`, else `text` with a number."""
        wanted = identifier(text)
        for name in (wanted, *map(identifier, others)):
            if name not in self._taken:
                self._taken.add(name)
                return name
        stem = wanted if wanted.endswith("_") else f"{wanted}_"
        number = self._next.get(wanted, 2)
        while f"{stem}{number}" in self._taken:
            number += 1
        self._next[wanted] = number + 1
        self._taken.add(name := f"{stem}{number}")
        return name
