"""Secret settings: documents hold a reference, the value is stored by the server and goes to the cell host alone."""

import re
import secrets
from typing import Any, Final

HIDDEN: Final = "***"
"""Shown in place of a secret; as the value of a setting it stands for the stored one."""

_REFERENCE: Final = re.compile(r"\*\*\*[0-9a-f]{16}")
_NAMES: Final = re.compile(
    r"(?i)password|passwd|passphrase|secret|token|credential|api_?key|private_?key|(^|_)(pass|pin)($|_)"
)
_FILE: Final = re.compile(r"(?i)_(file|path)$")


def new_reference() -> str:
    """Return a reference to a secret that is about to be stored."""
    return HIDDEN + secrets.token_hex(8)


def is_reference(value: Any) -> bool:
    """Tell whether a value of a setting is a reference to a stored secret."""
    return isinstance(value, str) and _REFERENCE.fullmatch(value) is not None


def references_in(document: bytes) -> set[str]:
    """Return the references in an encoded document."""
    return set(_REFERENCE.findall(document.decode(errors="replace")))


def is_secret_name(name: str) -> bool:
    """Tell whether a setting of this name holds a secret; one that names a file only says where it is."""
    return _NAMES.search(name) is not None and _FILE.search(name) is None
