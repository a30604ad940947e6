"""The context of a request: its client and the events that it sends."""

import time
from collections.abc import Awaitable, Callable, Iterable
from typing import Any, TypeVar

from msgspec import Raw

from arcor2_hw.data.base import UNSET, TranslatableData
from arcor2_hw.data.events import ChangeType, Event
from arcor2_server.errors import NotRegistered
from arcor2_server.events import make_event
from arcor2_server.websocket.client import Client

T = TypeVar("T", bound=TranslatableData)


class Context:
    """The context of a request, which its handler receives besides the arguments.

    `emit` sends an event to all clients after the response, `emit_first` before it (protocol, section 2). Events are
    sent if the request succeeds or is refused with data. Any other error discards them.
    """

    __slots__ = (
        "client",
        "codes",
        "dry_run",
        "events_after",
        "events_before",
        "events_to_caller",
        "received_at",
        "request",
        "step",
    )

    def __init__(
        self, client: Client, dry_run: bool = False, request: str = "", codes: bool = False, step: str = ""
    ) -> None:
        self.client = client
        self.dry_run = dry_run
        self.request = request
        self.codes = codes
        """Whether the caller asked for what is needed to translate messages."""
        self.step = step
        """Name of the step of undo that the edits of this request belong to; empty if each is a step."""
        self.received_at = time.monotonic()
        """Time of receipt, s of the monotonic clock."""
        self.events_before: list[Event] = []
        self.events_after: list[Event] = []
        self.events_to_caller: list[Event] = []
        """Events for the caller only, sent after the response."""

    @property
    def user(self) -> str:
        """The registered name of the caller. Raise NotRegistered if there is none."""
        if self.client.user is None:
            raise NotRegistered("You are not logged in: send RegisterUser first.")
        return self.client.user

    def translatable(self, items: Iterable[T]) -> list[T]:
        """Return items of the answer, with `key` and `values` only if the caller asked for them."""
        return [*items] if self.codes else [item.untranslated() for item in items]

    def emit(self, name: str, data: Any = UNSET, change: ChangeType | None = None, parent: str | None = None) -> None:
        """Send an event to all clients after the response."""
        self.events_after.append(make_event(name, data, change, parent))

    def emit_first(
        self, name: str, data: Any = UNSET, change: ChangeType | None = None, parent: str | None = None
    ) -> None:
        """Send an event to all clients before the response."""
        self.events_before.append(make_event(name, data, change, parent))


Handler = Callable[[Context, Any], Awaitable[Any]]
"""Takes the context and the decoded arguments (None if the request has none); returns the data of the answer."""
CachedAnswer = Callable[[bool], Raw | None]
"""Takes whether the caller asked for codes; returns the encoded data of an answer if it is cached, else None."""
