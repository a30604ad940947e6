"""A stream of events: bounded, in order, and never silent about what is missing."""

import asyncio
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Any, Final, Generic, Protocol, Self, TypeVar

from arcor2_hw.client.errors import EventsMissed
from arcor2_hw.data.base import Unset
from arcor2_hw.data.events import ChangeType, Event

LIMIT: Final = 10_000
"""Events that wait in a stream at most; then the oldest go, and the stream says so."""

D_co = TypeVar("D_co", covariant=True)
E = TypeVar("E")


class Told(Protocol[D_co]):
    """An event whose data are known to be of one type."""

    @property
    def event(self) -> str:
        """The event's name."""

    @property
    def change_type(self) -> ChangeType | Unset:
        """What happened to the item that it carries."""

    @property
    def parent_id(self) -> str | Unset:
        """To what the item belongs."""

    @property
    def data(self) -> D_co:
        """What it carries; UNSET for an event without data."""


class EventStream(Generic[E]):
    """Events as they come: `async for event in stream`, from its making until it, or the client, is closed.

    Raises EventsMissed where events are missing, because they were not taken in time or the connection was lost;
    the stream can be read on behind that. Raises NotAdmitted when the server lets the client in no more. Ends when the
    client is closed, or has lost its connection and does not reconnect. One reader at a time.
    """

    def __init__(
        self, names: frozenset[str] = frozenset(), limit: int = LIMIT, forget: Callable[[Any], None] | None = None
    ) -> None:
        if limit < 1:
            raise ValueError(f"a stream needs room for at least one event, not {limit}")
        self._names = names
        self._limit = limit
        self._forget = forget
        self._waiting: deque[Event | EventsMissed] = deque()
        self._gap: EventsMissed | None = None
        """What is missing before the first that waits."""
        self._news = asyncio.Event()
        self._ended = False
        self._error: BaseException | None = None

    def put(self, item: Event | EventsMissed) -> None:
        """Add what came. For the client."""
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
        """Let no more come; what waits can still be taken. For the client."""
        self._ended = True
        self._error = error
        self._news.set()

    def close(self) -> None:
        """Stop following; harmless when it is closed."""
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
