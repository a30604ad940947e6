"""A desk for each test."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tests.server.session.desk import Desk, Person, open_desk


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
async def crowd(desk: Desk) -> list[Person]:
    """Eight more people who are logged in."""
    return [await desk.person(f"user{number}") for number in range(8)]


@pytest.fixture
async def stranger(desk: Desk) -> Person:
    """Somebody who is not logged in."""
    return await desk.person()
