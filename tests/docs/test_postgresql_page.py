"""The page about PostgreSQL: its commands create a database that the server uses, and move documents into it."""

import asyncio
import os
import re
import shlex
import subprocess
from pathlib import Path

import pytest
from sqlalchemy import make_url

from arcor2_hw.data.scene import Scene
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.main import app
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from tests.postgresql import VARIABLE, Databases, execute, programs, server

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "postgresql.md").read_text()
COMMANDS = [shlex.split(line) for line in re.findall(r"^\$ (.*)$", PAGE, re.MULTILINE)]


@pytest.mark.sqlite
async def test_the_commands_of_the_page_create_a_database_and_copy_documents(
    tmp_path: Path, databases: Databases, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    url = server()
    environment = os.environ | {"PGHOST": str(url.host or url.query["host"]), "PGUSER": str(url.username)}
    try:
        for command in COMMANDS[:2]:
            program = [programs() / command[0], *command[1:]]
            subprocess.run(program, env=environment, input=b"secret\nsecret\n", check=True, stdout=subprocess.DEVNULL)
        (documented,) = (word.partition("=")[2] for command in COMMANDS for word in command if VARIABLE in word)
        used = make_url(documented).set(host=url.host, query=url.query, port=url.port)
        settings = ServerSettings(data_dir=tmp_path, database_url=used.render_as_string(False))
        source = await Storage.open(ServerSettings(data_dir=tmp_path))
        saved = await source.put_scene(Scene(name="Cell 1", id="scn_1"))
        await source.close()
        monkeypatch.setenv(VARIABLE, settings.database_url)
        (copy,) = (command[1:] for command in COMMANDS if command[:2] == ["arcor2-hw", "database"])
        assert await asyncio.to_thread(app, [*copy, "--data-dir", str(tmp_path)]) == ExitStatus.OK
        assert capsys.readouterr().out == "scene: 1\n1 rows copied\n"
        storage = await Storage.open(settings)
        assert await storage.scene("scn_1") == saved
        await storage.close()
    finally:
        execute("DROP DATABASE IF EXISTS cell1")
        execute("DROP ROLE IF EXISTS arcor2")


def test_the_page_states_the_exit_statuses() -> None:
    assert f"exits with status {ExitStatus.DATABASE_UNUSABLE} and names host" in PAGE
    assert f"exits with status {ExitStatus.DATA_IN_USE} and names the machine" in PAGE
