"""A server and its users for each test."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tests.server.session.session_server import Person, SessionServer, open_server


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
async def crowd(server: SessionServer) -> list[Person]:
    """Connect eight more registered users."""
    return [await server.person(f"user{number}") for number in range(8)]


@pytest.fixture
async def stranger(server: SessionServer) -> Person:
    """Connect a client without a registered user."""
    return await server.person()
