"""Edits while the database server is down: they continue, saving is refused with a reason, and nothing is lost."""

from pathlib import Path

import pytest

from tests.postgresql import Databases, Relay
from tests.server.session.session_server import Refused, open_server
from tests.server.session.work import Work


async def test_edits_are_kept_and_saved_later(tmp_path: Path, databases: Databases) -> None:
    relay = Relay(databases.url(tmp_path))
    await relay.open()
    async with open_server(tmp_path, database_url=relay.url) as server:
        alice = await server.person("alice")
        await Work(alice).project("first")
        await alice.ask("SaveProject")
        await relay.close()
        await Work(alice).add_point("second")
        with pytest.raises(Refused, match=rf"at 127\.0\.0\.1:{relay.port} cannot be reached: Connection refused"):
            await alice.ask("SaveProject")

    # A server that is restarted with the database restores the edit.
    await relay.open()
    async with open_server(tmp_path, database_url=relay.url) as server:
        assert [point.name for point in server.session.require_project().action_points] == ["first", "second"]
        alice = await server.person("alice")
        await alice.ask("SaveProject")
        saved = await server.services.storage.project(server.session.require_project().id)
        assert [point.name for point in saved.action_points] == ["first", "second"]
    await relay.close()
