"""Secret settings: documents hold a reference, the value is stored by the server and goes to the cell host alone."""

import re
import secrets
from typing import Any, Final

from msgspec import field

from arcor2_hw.data.base import Data

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


def is_secret_name(name: str) -> bool:
    """Tell whether a setting of this name holds a secret; one that names a file only says where it is."""
    return _NAMES.search(name) is not None and _FILE.search(name) is None


class ObjectSecrets(Data, frozen=True):
    """Secrets of one object for the cell host.

    values: values by the name of the setting. problem: why other secrets are withheld; empty when they are not stored.
    """

    values: dict[str, str] = field(default_factory=dict)
    problem: str = ""
