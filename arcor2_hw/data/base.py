"""Base classes of all data, identifiers and time stamps."""

import builtins
import keyword
import uuid
from datetime import UTC, datetime
from typing import Annotated, Self

from msgspec import UNSET, Meta, Struct, UnsetType
from msgspec.structs import replace

from arcor2_hw.messages import Message

__all__ = ["UNSET", "Data", "MutableData", "Timestamp", "TranslatableData", "Unset", "is_valid_name", "new_id", "now"]


class Data(Struct, frozen=True):
    """Base of all protocol data: immutable; unset optional fields are omitted, null is rejected."""


class TranslatableData(Data, frozen=True, kw_only=True):
    """Base of data with a text for users, which clients translate by `key` and `values` (see Message).

    Both are omitted when the text is the key itself.
    """

    key: str | UnsetType = UNSET
    values: dict[str, str | Message] | UnsetType = UNSET

    def as_message(self, text: str) -> Message:
        """Return the text of this data as a message."""
        if isinstance(self.key, UnsetType):
            return Message.of(text)
        return Message(text, self.key, {} if isinstance(self.values, UnsetType) else self.values)

    def untranslated(self) -> Self:
        """Return this data without `key` and `values`."""
        return self if self.key is UNSET and self.values is UNSET else replace(self, key=UNSET, values=UNSET)


class MutableData(Struct, dict=True):
    """Base of the few types that existing scripts modify in place (Pose, Joint and similar).

    Other attributes may be set on an instance; they are not sent.
    """


# A field of type `X | Unset` is omitted on the wire while it is UNSET.
Unset = UnsetType

Timestamp = Annotated[str, Meta(pattern=r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?([+-]\d\d:\d\d|Z)$")]
"""RFC 3339 with offset.

It is stored as text, because the wire needs `+00:00`, and text in one time zone sorts by time.
"""


def now() -> str:
    """Return the present time stamp in UTC, with microseconds."""
    return datetime.now(UTC).isoformat(timespec="microseconds")


def new_id(prefix: str) -> str:
    """Return a new id of the form `<prefix>_<32 hex digits>` (protocol, section 4)."""
    return f"{prefix}_{uuid.uuid4().hex}"


_RESERVED = frozenset(keyword.kwlist) | frozenset(dir(builtins))


def is_valid_name(name: str) -> bool:
    """Return whether `name` is valid for an object, point, joints, flow output, parameter or the like (section 4)."""
    return name.isidentifier() and name.isascii() and name not in _RESERVED
