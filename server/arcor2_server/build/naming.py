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
    """The names of one scope. Names differ from those of the scopes around and inside it.

    Args:
        taken: names that are reserved from the beginning.
        outer: the scope around this one.
    """

    def __init__(self, taken: Iterable[str] = (), outer: "Names | None" = None) -> None:
        self._taken = set(taken)
        self._inside: set[str] = set()
        """The names of the scopes inside this one."""
        self._outer = outer
        self._next: dict[str, int] = {}

    def _is_free(self, name: str) -> bool:
        if name in self._taken or name in self._inside:
            return False
        return self._outer is None or name not in self._outer._taken

    def _take(self, name: str) -> str:
        self._taken.add(name)
        if self._outer is not None:
            self._outer._inside.add(name)
        return name

    def shadow(self, text: str) -> str:
        """Reserve and return a name, even if the enclosing scope has it. That scope must not use it inside this one."""
        name = identifier(text)
        return self.claim(text) if name in self._taken else self._take(name)

    def claim(self, text: str, *others: str) -> str:
        """Reserve and return a name: `text`, else the first free one of `others`, else `text` with a number."""
        wanted = identifier(text)
        for name in (wanted, *map(identifier, others)):
            if self._is_free(name):
                return self._take(name)
        stem = wanted if wanted.endswith("_") else f"{wanted}_"
        number = self._next.get(wanted, 2)
        while not self._is_free(f"{stem}{number}"):
            number += 1
        self._next[wanted] = number + 1
        return self._take(f"{stem}{number}")
