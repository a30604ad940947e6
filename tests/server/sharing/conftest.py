"""A server and its users for each test, and helpers that wait for events."""

import asyncio
from collections.abc import Callable
from typing import Any

from tests.server.session.conftest import alice, bob, server, stranger  # noqa: F401 - fixtures
from tests.server.session.session_server import Person

PATIENCE = 40.0


async def expect(person: Person, name: str, where: Callable[[Any], bool] = lambda _: True) -> Any:
    """Wait for an event and return its data. Earlier messages are dropped, later messages are kept."""
    async with asyncio.timeout(PATIENCE):
        while True:
            seen = person.take()
            for number, event in enumerate(seen, 1):
                if event.get("event") == name and where(event.get("data")):
                    person.put_back(seen[number:])
                    return event.get("data")
            await asyncio.sleep(0.005)


async def subscribed(person: Person, *names: str, **more: Any) -> Person:
    """Subscribe, and drop the events that are sent at once."""
    await person.ask("SubscribeEvents", events=list(names), **more)
    person.take()
    return person
