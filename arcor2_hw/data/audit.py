"""Entries of the audit trail."""

import enum
from typing import Annotated, Any

from msgspec import Meta, field

from arcor2_hw.data.base import Data, Timestamp


class AuditOutcome(enum.StrEnum):
    """Outcome of a request."""

    DONE = "done"
    REFUSED = "refused"
    """Refused for a reason that `reason` states, or failed."""
    FORBIDDEN = "forbidden"
    """Refused because the role of the sender is too low."""


class AuditChange(Data, frozen=True):
    """A changed item of a scene or project.

    Args:
        kind: kind of the item, such as `action_point`.
        id: id of the item.
        before: the item before, None if it was added.
        after: the item afterwards, None if it was removed.
    """

    kind: str
    id: str
    before: Any = None
    after: Any = None


class AuditEntry(Data, frozen=True):
    """An entry of the audit trail.

    Args:
        number: counts the entries from 1.
        time: time of the end of the request.
        outcome: outcome of the request.
        request: name of the request, or method and path of a REST operation.
        target: id or name of the affected item; empty if unknown.
        user: name of the user or of the token; empty if unknown.
        role: role of the sender, `none` if it has none.
        address: address of the sender; empty for the server itself.
        reason: reason of a refusal.
        changes: the changed items with their values before and afterwards. Empty if they would take more than
            256 KiB; then `reason` says so.
    """

    number: int
    time: Timestamp
    outcome: AuditOutcome
    request: str
    target: str = ""
    user: str = ""
    role: str = ""
    address: str = ""
    reason: str = ""
    changes: list[AuditChange] = field(default_factory=list)


class AuditQuery(Data, frozen=True):
    """Selects entries of the audit trail, newest first.

    Args:
        limit: maximum number of entries.
        before: only entries with a smaller number; 0 for the newest.
        outcome: only entries with this outcome; empty for all.
        text: only entries whose user, request, target, address or reason contains this text.
    """

    limit: Annotated[int, Meta(ge=1, le=1000)] = 100
    before: Annotated[int, Meta(ge=0)] = 0
    outcome: str = ""
    text: str = ""


class AuditCheck(Data, frozen=True):
    """Result of checking the audit trail.

    Args:
        problem: the first problem; empty if nothing was edited or removed.
        first: number of the oldest entry, 0 if there is none.
        last: number of the newest entry, 0 if there is none.
        digest: digest of the newest entry, hexadecimal. Every earlier entry contributes to it.
    """

    problem: str
    first: int
    last: int
    digest: str
