"""The event stream alone: order, filter, limit, and gaps at their position."""

import asyncio

import pytest

from arcor2_hw.client import EventsMissed, EventStream, NotAdmitted
from arcor2_hw.data.events import Event


def stream(*names: str, limit: int = 3) -> EventStream[Event]:
    return EventStream(frozenset(names), limit)


async def taken(from_stream: EventStream[Event]) -> list[str]:
    return [event.event async for event in from_stream]


async def test_events_arrive_in_order_before_the_end() -> None:
    told = stream()
    for name in "abc":
        told.put(Event(name))
    told.end()
    told.put(Event("late"))
    assert await taken(told) == ["a", "b", "c"]
    assert await taken(told) == []


async def test_only_followed_events_are_queued() -> None:
    told = stream("a", limit=2)
    for name in "bababb":
        told.put(Event(name))
    told.end()
    assert await taken(told) == ["a", "a"]


async def test_dropped_events_are_counted_before_the_remaining_ones() -> None:
    told = stream(limit=3)
    for number in range(8):
        told.put(Event(str(number)))
    told.end()
    with pytest.raises(EventsMissed) as missed:
        await anext(told)
    assert (missed.value.dropped, missed.value.rejoined) == (5, False)
    assert await taken(told) == ["5", "6", "7"]


async def test_consecutive_gaps_are_merged_at_their_position() -> None:
    told = stream(limit=5)
    told.put(Event("before"))
    told.put(EventsMissed(rejoined=True, seconds=1.0, not_resumed=("joints of r",)))
    told.put(EventsMissed(rejoined=True, seconds=2.0))
    told.put(Event("after"))
    assert (await anext(told)).event == "before"
    with pytest.raises(EventsMissed, match=r"lost for 3\.0 s") as missed:
        await anext(told)
    assert missed.value.not_resumed == ()
    assert (await anext(told)).event == "after"


async def test_a_dropped_gap_is_still_reported() -> None:
    told = stream(limit=2)
    told.put(Event("1"))
    told.put(EventsMissed(rejoined=True, seconds=1.5))
    for name in "23":
        told.put(Event(name))
    with pytest.raises(EventsMissed) as missed:
        await anext(told)
    assert (missed.value.dropped, missed.value.rejoined, missed.value.seconds) == (1, True, 1.5)
    assert (await anext(told)).event == "2"


async def test_a_reader_that_times_out_loses_no_event() -> None:
    told = stream()
    for _ in range(3):
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.01):
                await anext(told)
    told.put(Event("a"))
    assert (await anext(told)).event == "a"


async def test_the_final_error_is_raised_after_the_queued_events() -> None:
    told = stream()
    told.put(Event("a"))
    told.end(NotAdmitted("no"))
    assert (await anext(told)).event == "a"
    for _ in range(2):
        with pytest.raises(NotAdmitted):
            await anext(told)


def test_a_stream_needs_a_positive_limit() -> None:
    with pytest.raises(ValueError, match="limit of at least one"):
        stream(limit=0)
