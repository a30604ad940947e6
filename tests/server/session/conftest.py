"""A server for each test."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tests.server.session.session_server import Person, SessionServer, open_server


@pytest.fixture
async def server(tmp_path: Path) -> AsyncIterator[SessionServer]:
    """A server without a socket."""
    async with open_server(tmp_path) as opened:
        yield opened


@pytest.fixture
async def alice(server: SessionServer) -> Person:
    """Somebody who is logged in."""
    return await server.person("alice")


@pytest.fixture
async def bob(server: SessionServer) -> Person:
    """Somebody else who is logged in."""
    return await server.person("bob")


@pytest.fixture
async def crowd(server: SessionServer) -> list[Person]:
    """Eight more people who are logged in."""
    return [await server.person(f"user{number}") for number in range(8)]


@pytest.fixture
async def stranger(server: SessionServer) -> Person:
    """Somebody who is not logged in."""
    return await server.person()
