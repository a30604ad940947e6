"""The common ground of all data: omission of unset fields, identifiers and time stamps."""

import builtins
import keyword
import uuid
from datetime import UTC, datetime
from typing import Annotated

from msgspec import UNSET, Meta, Struct, UnsetType

__all__ = ["UNSET", "Data", "MutableData", "Timestamp", "Unset", "is_valid_name", "new_id", "now"]


class Data(Struct, frozen=True):
    """Base of everything that travels: immutable, an unset optional field is left out, a null is refused."""


class MutableData(Struct, dict=True):
    """Base of the few types that existing scripts change in place (Pose, Joint and their like).

    Other attributes may be set on an instance; they stay off the wire.
    """


# A field of type `X | Unset` is omitted on the wire while it is UNSET.
Unset = UnsetType

Timestamp = Annotated[str, Meta(pattern=r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?([+-]\d\d:\d\d|Z)$")]
"""RFC 3339 with offset. Kept as text: the wire wants `+00:00`, and text of one zone sorts by time."""


def now() -> str:
    """Give the present as a time stamp in UTC, with microseconds."""
    return datetime.now(UTC).isoformat(timespec="microseconds")


def new_id(prefix: str) -> str:
    """Make an id of the form `<prefix>_<32 hex digits>` (protocol, section 4)."""
    return f"{prefix}_{uuid.uuid4().hex}"


_RESERVED = frozenset(keyword.kwlist) | frozenset(dir(builtins))


def is_valid_name(name: str) -> bool:
    """Tell whether `name` may name an object, point, orientation, joints, flow output or parameter (section 4)."""
    return name.isidentifier() and name.isascii() and name not in _RESERVED
