"""Documents in PostgreSQL: lost connections, a server that is down, the lock against other servers, the schema."""

import asyncio
import contextlib
import sqlite3
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from msgspec.structs import replace
from sqlalchemy import create_engine, inspect, make_url

from arcor2_hw.data.project import Project, ProjectParameter
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Conflict, DatabaseInUse, DatabaseUnreachable, NotFound, StorageError, TextTooLong
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.main import app
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage, postgresql as backend, schema
from arcor2_server.storage.copying import copy_to_postgresql
from arcor2_server.storage.models import Base
from arcor2_server.storage.project_tables import ProjectTables
from arcor2_server.storage.shared_data import SharedData
from tests.postgresql import VARIABLE, Databases, Relay, execute, server
from tests.server.core.serving import COMMAND

SCENE = Scene(name="Cell 1", id="scn_1")


def row_count(url: str, table: str) -> int:
    """Return the number of rows of a table."""
    engine = create_engine(backend.parse_url(url))
    with engine.connect() as connection:
        count: int = connection.exec_driver_sql(f"SELECT count(*) FROM {table}").scalar_one()
    engine.dispose()
    return count


@pytest.fixture
def settings(tmp_path: Path, databases: Databases) -> ServerSettings:
    return ServerSettings(data_dir=tmp_path, database_url=databases.url(tmp_path))


@pytest.fixture
async def storage(settings: ServerSettings) -> AsyncIterator[Storage]:
    opened = await Storage.open(settings)
    yield opened
    await opened.close()


# ------------------------------------------------------------------------------------------------ connections
async def test_a_restart_between_two_requests_is_not_noticed(
    storage: Storage, settings: ServerSettings, databases: Databases
) -> None:
    await storage.put_scene(SCENE)
    await asyncio.gather(*(storage.scene("scn_1") for _ in range(6)))
    databases.interrupt(settings.data_dir)
    await asyncio.gather(*(storage.scene("scn_1") for _ in range(6)))
    databases.interrupt(settings.data_dir)
    assert (await storage.put_scene(replace(SCENE, name="Cell 2"))).name == "Cell 2"


async def test_a_stopped_server_is_named_and_used_again(settings: ServerSettings) -> None:
    relay = Relay(settings.database_url)
    await relay.open()
    settings = replace(settings, database_url=relay.url)
    storage = await Storage.open(settings)
    await storage.put_scene(SCENE)
    await relay.close()
    name = make_url(relay.url).database
    for attempt in (storage.scene("scn_1"), storage.put_scene(SCENE), Storage.open(settings)):
        with pytest.raises(DatabaseUnreachable) as raised:
            await attempt
        assert f"The database {name} at 127.0.0.1:{relay.port} cannot be reached: Connection refused." in str(
            raised.value
        )
    await relay.open()
    assert (await storage.scene("scn_1")).name == "Cell 1"
    await storage.put_scene(replace(SCENE, name="Cell 2"))
    await storage.close()
    await relay.close()


@pytest.mark.parametrize(
    ("url", "reason"),
    [
        ("mysql://root:secret@db/a", "is not the address of a PostgreSQL database"),
        ("postgresql+asyncpg://root:secret@db/a", "is not the address of a PostgreSQL database"),
        ("postgresql+psycopg://root:secret@db", "is not the address of a PostgreSQL database"),
        ("postgresql+psycopg://root:secret@127.0.0.1:1/a", "The database a at 127.0.0.1:1 cannot be reached"),
    ],
)
async def test_a_wrong_address_is_reported_without_the_password(tmp_path: Path, url: str, reason: str) -> None:
    with pytest.raises(StorageError, match=reason) as raised:
        await Storage.open(ServerSettings(data_dir=tmp_path, database_url=url))
    assert "secret" not in str(raised.value)


async def test_another_collation_is_refused_with_the_command_that_helps(settings: ServerSettings) -> None:
    name = "arcor2_hw_test_c"
    execute(f"DROP DATABASE IF EXISTS {name} WITH (FORCE)")
    execute(f"CREATE DATABASE {name} TEMPLATE template0 LOCALE 'C'")
    url = server().set(database=name).render_as_string(False)
    with pytest.raises(StorageError, match=f"collation C; .*--locale=C.UTF-8 {name}$"):
        await Storage.open(replace(settings, database_url=url))
    execute(f"DROP DATABASE {name}")


# ------------------------------------------------------------------------------------------------ other servers
HOLDER = """
import asyncio, sys
from pathlib import Path
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage

async def main():
    await Storage.open(ServerSettings(data_dir=Path(sys.argv[1]), database_url=sys.argv[2]))
    print("open", flush=True)
    await asyncio.Event().wait()

asyncio.run(main())
"""


async def test_a_second_server_is_refused_until_the_first_is_killed(
    settings: ServerSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = [sys.executable, "-c", HOLDER, str(settings.data_dir), settings.database_url]
    process = await asyncio.create_subprocess_exec(*program, stdout=asyncio.subprocess.PIPE)
    assert process.stdout is not None
    assert await process.stdout.readline() == b"open\n"
    monkeypatch.setattr(backend, "LOCK_WAIT", 0.05)
    with pytest.raises(DatabaseInUse, match=rf"is in use by arcor2-hw on \S+, process {process.pid} .*since 20\d\d-"):
        await Storage.open(settings)
    await (await Storage.open(settings, exclusive=False)).close()
    process.kill()
    await process.wait()
    monkeypatch.setattr(backend, "LOCK_WAIT", 10)
    await (await Storage.open(settings)).close()


async def test_a_server_that_lost_the_lock_to_another_one_writes_nothing(
    storage: Storage, settings: ServerSettings, databases: Databases, monkeypatch: pytest.MonkeyPatch
) -> None:
    await storage.put_scene(SCENE)
    databases.interrupt(settings.data_dir)
    other = await Storage.open(settings)
    monkeypatch.setattr(backend, "LOCK_WAIT", 0.05)
    with pytest.raises(DatabaseInUse):
        await storage.put_scene(replace(SCENE, name="Cell 2"))
    assert (await other.scene("scn_1")).name == "Cell 1"
    await other.close()
    await storage.put_scene(replace(SCENE, name="Cell 2"))


async def test_serve_refuses_a_database_in_use_in_one_line(storage: Storage, settings: ServerSettings) -> None:
    arguments = (*COMMAND, "serve", "--port", "0", "--data-dir", str(settings.data_dir / "other"))
    environment = {VARIABLE: settings.database_url, "HOME": str(settings.data_dir)}
    process = await asyncio.create_subprocess_exec(*arguments, stderr=asyncio.subprocess.PIPE, env=environment)
    _, err = await process.communicate()
    (line,) = err.decode().splitlines()
    assert process.returncode == ExitStatus.DATA_IN_USE
    assert "is in use by arcor2-hw on" in line


# ------------------------------------------------------------------------------------------------ schema
async def test_two_starts_create_one_schema(settings: ServerSettings, monkeypatch: pytest.MonkeyPatch) -> None:
    engine = create_engine(backend.parse_url(settings.database_url))
    with engine.begin() as connection:
        Base.metadata.drop_all(connection)
        connection.exec_driver_sql("DROP TABLE alembic_version")
    monkeypatch.setattr(backend, "LOCK_WAIT", 0.05)
    starts = [Storage.open(settings), Storage.open(settings), Storage.open(settings, exclusive=False)]
    opened = await asyncio.gather(*starts, return_exceptions=True)
    assert sum(isinstance(each, DatabaseInUse) for each in opened) == 1
    for each in opened:
        if isinstance(each, Storage):
            await each.close()
    with engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []
    engine.dispose()


def test_migrations_lead_to_the_models_and_back(settings: ServerSettings) -> None:
    engine = create_engine(backend.parse_url(settings.database_url))  # a copy of a migrated database
    with engine.begin() as connection:
        context = MigrationContext.configure(connection)
        assert context.get_current_revision() == schema.REVISION
        assert compare_metadata(context, Base.metadata) == []
        config = schema.alembic_config()
        config.attributes["connection"] = connection
        command.downgrade(config, "base")
        assert inspect(connection).get_table_names() == ["alembic_version"]
        for revision in sorted(schema.KNOWN_REVISIONS):
            schema.migrate(connection, revision)
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []
    engine.dispose()


@pytest.mark.parametrize(
    ("statement", "reason"),
    [
        ("UPDATE alembic_version SET version_num = '9999'", "schema '9999', which this version does not support"),
        ("DROP TABLE alembic_version", "not a database of this program"),
    ],
)
async def test_a_database_of_another_version_or_program_is_refused(
    settings: ServerSettings, statement: str, reason: str
) -> None:
    execute(statement, backend.parse_url(settings.database_url))
    with pytest.raises(StorageError, match=reason):
        await Storage.open(settings)


# ------------------------------------------------------------------------------------------------ moving
@pytest.mark.sqlite
async def test_documents_are_copied_from_sqlite_once(settings: ServerSettings) -> None:
    with pytest.raises(NotFound):
        await copy_to_postgresql(settings)
    source = await Storage.open(replace(settings, database_url=""))
    scenes = [await source.put_scene(replace(SCENE, id=f"scn_{n}", name=f"Cell {n}")) for n in range(250)]
    project = await source.put_project(Project(name="Sorting", scene_id="scn_1", id="pro_1"))
    await source.put_project_source("pro_1", "pass")
    await ProjectTables(source).put_parameters("pro_1", [ProjectParameter("a", "integer", "1")])
    await SharedData(source).put_view("eva", "pro_1", {"camera": b"1"}, 7)
    await source.close()

    counts = await copy_to_postgresql(settings)
    assert {table: count for table, count in counts.items() if count} == {
        "scene": 250, "project": 1, "project_source": 1, "project_beside": 1, "view_value": 1
    }  # fmt: skip
    copied = await Storage.open(settings)
    assert await copied.scenes_with_ids([scene.id for scene in scenes[:3]]) == scenes[:3]
    assert await copied.project("pro_1") == project
    assert await copied.project_source("pro_1") == "pass"
    assert [each.name for each in await ProjectTables(copied).parameters("pro_1")] == ["a"]
    assert await SharedData(copied).view("eva", "pro_1") == {"camera": b"1"}
    with pytest.raises(DatabaseInUse):
        await copy_to_postgresql(settings)
    await copied.close()
    with pytest.raises(Conflict, match="contains data already: the table"):
        await copy_to_postgresql(settings)


@pytest.mark.sqlite
async def test_nothing_is_copied_if_a_text_does_not_fit(settings: ServerSettings) -> None:
    await (await Storage.open(replace(settings, database_url=""))).close()
    with contextlib.closing(sqlite3.connect(settings.documents_database)) as connection:
        for key in ("short", "i" * 300):
            connection.execute("INSERT INTO recipe VALUES (?, ?)", (key, b"{}"))
        connection.commit()
    with pytest.raises(TextTooLong, match=r"^id of recipe has 300 characters"):
        await copy_to_postgresql(settings)
    assert row_count(settings.database_url, "recipe") == 0


def test_the_command_copies_and_reports(
    settings: ServerSettings, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert app(["database", "copy", "--data-dir", str(settings.data_dir)]) == ExitStatus.USAGE
    monkeypatch.setenv(VARIABLE, settings.database_url)
    assert app(["database", "copy", "--data-dir", str(settings.data_dir)]) == ExitStatus.NOT_FOUND
    assert "contains no database" in capsys.readouterr().err
