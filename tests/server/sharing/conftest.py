"""A server for each test, and helpers that wait for events."""

import asyncio
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest

from tests.server.session.session_server import Person, SessionServer, open_server

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


@pytest.fixture
async def server(tmp_path: Path) -> AsyncIterator[SessionServer]:
    """Start a server without a socket."""
    async with open_server(tmp_path) as opened:
        yield opened


@pytest.fixture
async def alice(server: SessionServer) -> Person:
    """Connect a registered user."""
    return await server.person("alice")


@pytest.fixture
async def bob(server: SessionServer) -> Person:
    """Connect another registered user."""
    return await server.person("bob")


@pytest.fixture
async def stranger(server: SessionServer) -> Person:
    """Connect a client without a registered user."""
    return await server.person()
