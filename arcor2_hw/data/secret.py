"""Secret settings: documents contain a reference; the value is stored by the server and sent only to the cell host."""

import re
import secrets
from typing import Any, Final

from msgspec import field

from arcor2_hw.data.base import Data
from arcor2_hw.messages import Message

HIDDEN: Final = "***"
"""Shown instead of a secret; as the value of a setting it means the stored one."""

_REFERENCE: Final = re.compile(r"\*\*\*[0-9a-f]{16}")
_NAMES: Final = re.compile(
    r"(?i)password|passwd|passphrase|secret|token|credential|api_?key|private_?key|(^|_)(pass|pin)($|_)"
)
_FILE: Final = re.compile(r"(?i)_(file|path)$")


def new_reference() -> str:
    """Return a reference for a new secret."""
    return HIDDEN + secrets.token_hex(8)


def is_reference(value: Any) -> bool:
    """Return whether the value of a setting is a reference to a stored secret."""
    return isinstance(value, str) and _REFERENCE.fullmatch(value) is not None


def is_secret_name(name: str) -> bool:
    """Return whether a setting of this name holds a secret. The name of a file is not secret."""
    return _NAMES.search(name) is not None and _FILE.search(name) is None


class ObjectSecrets(Data, frozen=True):
    """Secrets of one object for the cell host.

    values: values by the name of the setting. problem: why other secrets are withheld; None when none are withheld.
    """

    values: dict[str, str] = field(default_factory=dict)
    problem: Message | None = None
