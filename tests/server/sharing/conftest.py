"""A desk for each test, and waiting for what is told a moment later."""

import asyncio
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest

from tests.server.session.desk import Desk, Person, open_desk

PATIENCE = 40.0


async def came(person: Person, name: str, where: Callable[[Any], bool] = lambda _: True) -> Any:
    """Wait for an event; gives its data. What came before it is gone then, what came after it is kept."""
    async with asyncio.timeout(PATIENCE):
        while True:
            seen = person.take()
            for number, event in enumerate(seen, 1):
                if event.get("event") == name and where(event.get("data")):
                    person.put_back(seen[number:])
                    return event.get("data")
            await asyncio.sleep(0.005)


async def subscribed(person: Person, *names: str, **more: Any) -> Person:
    """Subscribe, and forget what is told at once."""
    await person.ask("SubscribeEvents", events=list(names), **more)
    person.take()
    return person


@pytest.fixture
async def desk(tmp_path: Path) -> AsyncIterator[Desk]:
    """A server without a socket."""
    async with open_desk(tmp_path) as opened:
        yield opened


@pytest.fixture
async def alice(desk: Desk) -> Person:
    """Somebody who is logged in."""
    return await desk.person("alice")


@pytest.fixture
async def bob(desk: Desk) -> Person:
    """Somebody else who is logged in."""
    return await desk.person("bob")


@pytest.fixture
async def stranger(desk: Desk) -> Person:
    """Somebody who is not logged in."""
    return await desk.person()
