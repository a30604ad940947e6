"""The event stream without a connection: order, filter, limit, and gaps at their position."""

import asyncio

import pytest

from arcor2_hw.client import EventsMissed, EventStream, NotAdmitted
from arcor2_hw.data.events import Event


def stream(*names: str, limit: int = 3) -> EventStream[Event]:
    return EventStream(frozenset(names), limit)


async def event_names(from_stream: EventStream[Event]) -> list[str]:
    return [event.event async for event in from_stream]


async def test_events_arrive_in_order_before_the_end() -> None:
    events = stream()
    for name in "abc":
        events.put(Event(name))
    events.end()
    events.put(Event("late"))
    assert await event_names(events) == ["a", "b", "c"]
    assert await event_names(events) == []


async def test_only_followed_events_are_queued() -> None:
    events = stream("a", limit=2)
    for name in "bababb":
        events.put(Event(name))
    events.end()
    assert await event_names(events) == ["a", "a"]


async def test_dropped_events_are_counted_before_the_remaining_ones() -> None:
    events = stream(limit=3)
    for number in range(8):
        events.put(Event(str(number)))
    events.end()
    with pytest.raises(EventsMissed) as missed:
        await anext(events)
    assert (missed.value.dropped, missed.value.rejoined) == (5, False)
    assert await event_names(events) == ["5", "6", "7"]


async def test_consecutive_gaps_are_merged_at_their_position() -> None:
    events = stream(limit=5)
    events.put(Event("before"))
    events.put(EventsMissed(rejoined=True, seconds=1.0, not_resumed=("joints of r",)))
    events.put(EventsMissed(rejoined=True, seconds=2.0))
    events.put(Event("after"))
    assert (await anext(events)).event == "before"
    with pytest.raises(EventsMissed, match=r"lost for 3\.0 s") as missed:
        await anext(events)
    assert missed.value.not_resumed == ()
    assert (await anext(events)).event == "after"


async def test_a_dropped_gap_is_still_reported() -> None:
    events = stream(limit=2)
    events.put(Event("1"))
    events.put(EventsMissed(rejoined=True, seconds=1.5))
    for name in "23":
        events.put(Event(name))
    with pytest.raises(EventsMissed) as missed:
        await anext(events)
    assert (missed.value.dropped, missed.value.rejoined, missed.value.seconds) == (1, True, 1.5)
    assert (await anext(events)).event == "2"


async def test_a_reader_that_times_out_loses_no_event() -> None:
    events = stream()
    for _ in range(3):
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.01):
                await anext(events)
    events.put(Event("a"))
    assert (await anext(events)).event == "a"


async def test_the_final_error_is_raised_after_the_queued_events() -> None:
    events = stream()
    events.put(Event("a"))
    events.end(NotAdmitted("no"))
    assert (await anext(events)).event == "a"
    for _ in range(2):
        with pytest.raises(NotAdmitted):
            await anext(events)


def test_a_stream_needs_a_positive_limit() -> None:
    with pytest.raises(ValueError, match="limit of at least one"):
        stream(limit=0)
