"""Streams of events: bounded, ordered, with explicit gaps."""

import asyncio
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Any, Final, Generic, Protocol, Self, TypeVar

from arcor2_hw.client.errors import EventsMissed
from arcor2_hw.data.base import Unset
from arcor2_hw.data.events import ChangeType, Event

LIMIT: Final = 10_000
"""Maximum number of events waiting in a stream; above it, the oldest are dropped and reported."""

D_co = TypeVar("D_co", covariant=True)
E = TypeVar("E")


class TypedEvent(Protocol[D_co]):
    """An event with data of a known type."""

    @property
    def event(self) -> str:
        """Name of the event."""

    @property
    def change_type(self) -> ChangeType | Unset:
        """Kind of change of the item."""

    @property
    def parent_id(self) -> str | Unset:
        """Id of the parent of the item."""

    @property
    def data(self) -> D_co:
        """Data of the event; UNSET for an event without data."""


class EventStream(Generic[E]):
    """A stream of events: `async for event in stream`, until it, or the client, is closed. One reader at a time.

    It raises EventsMissed where events are missing, because they were not read in time or the connection was lost; the
    stream can be read further. It raises NotAdmitted when the server no longer admits the client. It ends when the
    client is closed, or has lost its connection and does not reconnect.
    """

    def __init__(
        self, names: frozenset[str] = frozenset(), limit: int = LIMIT, forget: Callable[[Any], None] | None = None
    ) -> None:
        if limit < 1:
            raise ValueError(f"a stream needs a limit of at least one event, not {limit}")
        self._names = names
        self._limit = limit
        self._forget = forget
        self._waiting: deque[Event | EventsMissed] = deque()
        self._gap: EventsMissed | None = None
        """Gap before the first waiting event."""
        self._news = asyncio.Event()
        self._ended = False
        self._error: BaseException | None = None

    def put(self, item: Event | EventsMissed) -> None:
        """Add an event or gap. Called by the client."""
        if self._ended or (isinstance(item, Event) and self._names and item.event not in self._names):
            return
        waiting = self._waiting
        if isinstance(item, EventsMissed) and waiting and isinstance(waiting[-1], EventsMissed):
            item = waiting.pop().joined_with(item)  # type: ignore[union-attr]
        waiting.append(item)
        if len(waiting) > self._limit:
            first = waiting.popleft()
            missing = EventsMissed(1) if isinstance(first, Event) else first
            self._gap = missing if self._gap is None else self._gap.joined_with(missing)
        self._news.set()

    def end(self, error: BaseException | None = None) -> None:
        """End the stream; waiting events can still be read. Called by the client."""
        self._ended = True
        self._error = error
        self._news.set()

    def close(self) -> None:
        """Close the stream. It does nothing when the stream is closed."""
        self.end()
        self._waiting.clear()
        self._gap = None
        if self._forget is not None:
            self._forget(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> E:
        while self._gap is None and not self._waiting:
            if self._ended:
                if self._error is not None:
                    raise self._error
                raise StopAsyncIteration
            self._news.clear()
            await self._news.wait()
        if self._gap is not None:
            gap, self._gap = self._gap, None
            raise gap
        item = self._waiting.popleft()
        if isinstance(item, EventsMissed):
            raise item
        return item  # type: ignore[return-value]
