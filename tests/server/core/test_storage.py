"""Saved documents: their content, their state after a kill, and errors of unusable databases."""

import asyncio
import contextlib
import os
import signal
import sqlite3
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Box, ObjectModel, ObjectTypeSource, Sphere
from arcor2_hw.data.project import ActionPoint, Position, Project
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import InvalidData, NotFound, StorageError, TextTooLong
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import DocumentId, Storage, schema
from arcor2_server.storage.models import Base
from arcor2_server.storage.project_tables import ExecutionToken, ProjectTables
from arcor2_server.storage.shared_data import SharedData
from tests import postgresql


@pytest.fixture
def settings(tmp_path: Path) -> ServerSettings:
    return ServerSettings(data_dir=tmp_path)


@pytest.fixture
async def sqlite_storage(settings: ServerSettings) -> AsyncIterator[Storage]:
    opened = await Storage.open(settings)
    yield opened
    await opened.close()


@pytest.fixture(params=["postgresql"] if postgresql.CHOSEN in os.environ else ["sqlite", "postgresql"])
async def storage(settings: ServerSettings, request: pytest.FixtureRequest) -> AsyncIterator[Storage]:
    if request.param == "postgresql":
        settings = replace(settings, database_url=request.getfixturevalue("databases").url(settings.data_dir))
    opened = await Storage.open(settings)
    yield opened
    await opened.close()


SCENE = Scene(
    name="Cell 1",
    description="a table",
    id="scn_1",
    int_modified="2026-01-01T00:00:00+00:00",
    objects=[SceneObject("table", "Table", Pose(), id="obj_1")],
)
PROJECT = Project(
    name="Sorting",
    scene_id="scn_1",
    id="pro_1",
    action_points=[ActionPoint("ap", Position(1.0, 0.5, 0.25), id="acp_1")],
)


async def test_a_scene_is_stored_with_its_times(storage: Storage) -> None:
    saved = await storage.put_scene(SCENE)
    assert saved.int_modified is UNSET
    assert saved.created == saved.modified
    assert saved.objects == SCENE.objects
    assert await storage.scene("scn_1") == saved
    again = await storage.put_scene(replace(saved, name="Cell 2", int_modified=saved.modified))
    assert again.created == saved.created
    assert again.modified > saved.modified  # type: ignore[operator]
    (listed,) = await storage.scenes()
    assert (listed.id, listed.name, listed.description) == ("scn_1", "Cell 2", "a table")
    assert (listed.created, listed.modified) == (again.created, again.modified)
    await storage.delete_scene("scn_1")
    assert await storage.scenes() == []
    for gone in (storage.scene("scn_1"), storage.delete_scene("scn_1")):
        with pytest.raises(NotFound):
            await gone


async def test_a_project_requires_its_scene_and_is_stored_with_its_source(storage: Storage) -> None:
    with pytest.raises(NotFound):
        await storage.put_project(PROJECT)
    with pytest.raises(NotFound):
        await storage.put_project_source("pro_1", "pass")
    await storage.put_scene(SCENE)
    saved = await storage.put_project(PROJECT)
    assert await storage.project("pro_1") == saved
    assert saved.action_points == PROJECT.action_points
    (listed,) = await storage.projects()
    assert (listed.id, listed.scene_id, listed.has_logic) == ("pro_1", "scn_1", True)
    assert await storage.projects_with_scene("scn_1") == ["pro_1"]
    assert await storage.projects_with_scene("scn_2") == []
    await storage.put_project_source("pro_1", "pass")
    await storage.put_project_source("pro_1", "print()")
    await storage.put_project(saved)
    assert await storage.project_source("pro_1") == "print()"
    await storage.delete_project("pro_1")
    with pytest.raises(NotFound):
        await storage.project_source("pro_1")


async def test_names_are_looked_up_among_scenes_and_projects(storage: Storage) -> None:
    await storage.put_scene(SCENE)
    await storage.put_project(PROJECT)
    assert await storage.name_taken("Cell 1")
    assert await storage.name_taken("Sorting")
    assert not await storage.name_taken("cell 1")
    assert await storage.scene_named("Cell 1") == "scn_1"
    assert await storage.scene_named("Sorting") is None
    assert await storage.project_named("Sorting") == "pro_1"
    assert await storage.identify("pro_1") == DocumentId("pro_1", "project")
    assert await storage.identify("Table") is None


async def test_object_type_with_and_without_model(storage: Storage) -> None:
    box = Box("Crate", 0.1, 0.2, 0.3)
    before = storage.types_revision
    saved = await storage.put_object_type(ObjectTypeSource("Crate", "class Crate: ...", model=ObjectModel.of(box)))
    await storage.put_object_type(ObjectTypeSource("mixin", "x = 1", description="helper"))
    assert storage.types_revision > before
    assert await storage.object_type("Crate") == saved
    assert [kind.id for kind in await storage.object_types()] == ["Crate", "mixin"]
    assert (await storage.object_types())[1].description == "helper"
    assert (await storage.object_types())[1].model is UNSET
    # Each id has at most one model, of any kind. The type of the model counts as changed.
    await storage.put_model(Sphere("Crate", 0.5))
    changed = await storage.object_type("Crate")
    assert changed.model == ObjectModel.of(Sphere("Crate", 0.5))
    assert changed.modified > saved.modified  # type: ignore[operator]
    assert await storage.models() == [Sphere("Crate", 0.5)]
    await storage.delete_object_type("Crate")
    with pytest.raises(NotFound):
        await storage.model("Crate")


async def test_revision_grows_with_every_write_and_only_with_writes(storage: Storage) -> None:
    start = storage.revision
    await storage.put_scene(SCENE)
    await storage.scenes()
    await storage.scene("scn_1")
    assert storage.revision == start + 1
    with pytest.raises(NotFound):
        await storage.delete_scene("nothing")
    assert storage.revision == start + 1


async def test_concurrent_writes_all_arrive(storage: Storage) -> None:
    await asyncio.gather(*(storage.put_scene(replace(SCENE, id=f"scn_{n}", name=f"{n}")) for n in range(20)))
    assert len(await storage.scenes()) == 20


async def test_ten_first_saves_of_one_key_all_succeed(storage: Storage) -> None:
    tables, shared = ProjectTables(storage), SharedData(storage)
    await asyncio.gather(*(storage.scenes() for _ in range(10)))  # all connections are open
    saved = await asyncio.gather(*(storage.put_scene(SCENE) for _ in range(10)))
    assert {scene.created for scene in saved} == {(await storage.scene("scn_1")).created}
    await asyncio.gather(
        *(storage.put_object_type(ObjectTypeSource("New", "x = 1")) for _ in range(10)),
        *(storage.put_model(Box("box", 1, 1, 1)) for _ in range(10)),
        *(tables.put_token(ExecutionToken("t", "n")) for _ in range(10)),
        *(tables.put_breakpoints("pkg_1", [f"{n}"]) for n in range(10)),
        *(shared.put_view("u", "d", dict.fromkeys(("k", "l") if n % 2 else ("l", "k"), b"1"), n) for n in range(10)),
    )
    assert [model.id for model in await storage.models()] == ["box"]
    assert [token.id for token in await tables.tokens()] == ["t"]
    assert await shared.view("u", "d") == {"k": b"1", "l": b"1"}


async def test_a_write_is_visible_in_its_own_transaction(storage: Storage) -> None:
    async with storage.transaction():
        await storage.put_scene(SCENE)
        await storage.put_scene(replace(SCENE, name="Cell 2"))
        assert (await storage.scene("scn_1")).name == "Cell 2"


async def test_texts_that_do_not_fit_are_refused_by_field(storage: Storage) -> None:
    limit = 255
    await storage.put_scene(SCENE)
    with pytest.raises(InvalidData, match=r"^name of scene contains the character NUL"):
        await storage.put_scene(replace(SCENE, name="a\0b"))
    with pytest.raises(InvalidData, match=r"^source of object_type contains the character NUL"):
        await storage.put_object_type(ObjectTypeSource("Nul", "x = '\0'"))
    with pytest.raises(TextTooLong, match=rf"^id of scene has {limit + 1} characters; at most {limit} are allowed"):
        await storage.put_scene(replace(SCENE, id="i" * (limit + 1)))
    await storage.put_scene(replace(SCENE, id="č" * limit))
    for missing in ("a\0b", "i" * 1000):
        with pytest.raises((NotFound, InvalidData)):
            await storage.scene(missing)
    assert [scene.name for scene in await storage.scenes()] == ["Cell 1", "Cell 1"]


async def test_names_are_sorted_by_code_point(storage: Storage) -> None:
    for name in ("b", "A", "č", "a", "B", "z"):
        await storage.put_scene(replace(SCENE, id=f"scn_{name}", name=name))
    assert [scene.name for scene in await storage.scenes()] == ["A", "B", "a", "b", "z", "č"]


WRITER = """
import asyncio, sys
from pathlib import Path
from arcor2_hw.data.scene import Scene
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage

async def main():
    storage = await Storage.open(ServerSettings(data_dir=Path(sys.argv[1])))
    n = 0
    while True:
        await storage.put_scene(Scene(name=f"scene {n}", id=f"scn_{n}"))
        sys.stdout.write(f"{n}\\n")
        sys.stdout.flush()
        n += 1

asyncio.run(main())
"""


@pytest.mark.sqlite
async def test_acknowledged_edits_survive_a_kill(settings: ServerSettings) -> None:
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", WRITER, str(settings.data_dir), stdout=asyncio.subprocess.PIPE
    )
    assert process.stdout is not None
    for _ in range(10):
        assert await process.stdout.readline()
    process.send_signal(signal.SIGKILL)
    acknowledged = 9 + len((await process.stdout.read()).splitlines())
    await process.wait()
    storage = await Storage.open(settings)
    with contextlib.closing(sqlite3.connect(settings.documents_database)) as connection:
        assert connection.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    kept = {scene.id for scene in await storage.scenes()}
    await storage.close()
    assert kept >= {f"scn_{n}" for n in range(acknowledged + 1)}


@pytest.mark.sqlite
async def test_every_commit_is_flushed(sqlite_storage: Storage) -> None:
    async with sqlite_storage.reading() as session:
        connection = await session.connection()
        synchronous = (await connection.exec_driver_sql("PRAGMA synchronous")).scalar()
        journal = (await connection.exec_driver_sql("PRAGMA journal_mode")).scalar()
    assert (synchronous, journal) == (2, "wal")


# ------------------------------------------------------------------------------------------------ schema
@pytest.mark.sqlite
async def test_created_schema_is_the_migrated_one(tmp_path: Path) -> None:
    from sqlalchemy import create_engine

    migrated = create_engine(f"sqlite:///{tmp_path / 'migrated.sqlite'}")
    with migrated.begin() as connection:
        schema.migrate(connection)
    created = ServerSettings(data_dir=tmp_path)
    await (await Storage.open(created)).close()
    direct = create_engine(f"sqlite:///{created.documents_database}")
    for engine in (migrated, direct):
        with engine.connect() as connection:
            context = MigrationContext.configure(connection)
            assert compare_metadata(context, Base.metadata) == []
            assert context.get_current_revision() == schema.REVISION
        engine.dispose()


def test_revision_is_the_newest_migration() -> None:
    script = ScriptDirectory.from_config(schema.alembic_config())
    assert script.get_current_head() == schema.REVISION
    assert {revision.revision for revision in script.walk_revisions()} == schema.KNOWN_REVISIONS


async def test_migrations_run_only_on_an_older_schema(
    settings: ServerSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    storage = await Storage.open(settings)
    await storage.put_scene(SCENE)
    await storage.close()
    migrated: list[str] = []
    monkeypatch.setattr(schema, "migrate", lambda _: migrated.append("migrated"))
    await (await Storage.open(settings)).close()
    assert migrated == []
    monkeypatch.setattr(schema, "REVISION", "9998")
    await (await Storage.open(settings)).close()
    assert migrated == ["migrated"]


# ------------------------------------------------------------------------------------------------ faults
@pytest.mark.sqlite
async def test_a_file_that_is_not_a_database_is_named(settings: ServerSettings) -> None:
    settings.documents_database.write_bytes(b"this is no database " * 500)
    with pytest.raises(StorageError, match=str(settings.documents_database)):
        await Storage.open(settings)
    assert settings.documents_database.read_bytes().startswith(b"this is no database"), "nothing is overwritten"


@pytest.mark.sqlite
async def test_damaged_pages_are_found_at_start(settings: ServerSettings) -> None:
    storage = await Storage.open(settings)
    for n in range(50):
        await storage.put_scene(replace(SCENE, id=f"scn_{n}", description="x" * 500))
    await storage.close()
    content = bytearray(settings.documents_database.read_bytes())
    content[8192:-4096] = b"\xa5" * (len(content) - 8192 - 4096)
    settings.documents_database.write_bytes(content)
    with pytest.raises(StorageError, match=str(settings.documents_database)):
        await Storage.open(settings)


@pytest.mark.sqlite
async def test_a_newer_schema_is_refused_and_unchanged(settings: ServerSettings) -> None:
    await (await Storage.open(settings)).close()
    with contextlib.closing(sqlite3.connect(settings.documents_database)) as connection:
        connection.execute("UPDATE alembic_version SET version_num = '9999'")
        connection.commit()
    with pytest.raises(StorageError, match="9999"):
        await Storage.open(settings)


@pytest.mark.sqlite
async def test_another_programs_database_is_refused(settings: ServerSettings) -> None:
    with contextlib.closing(sqlite3.connect(settings.documents_database)) as connection:
        connection.execute("CREATE TABLE pictures (id)")
    with pytest.raises(StorageError, match=str(settings.documents_database)):
        await Storage.open(settings)


@pytest.mark.sqlite
async def test_missing_directory_is_named(tmp_path: Path) -> None:
    settings = ServerSettings(data_dir=tmp_path / "nowhere")
    with pytest.raises(StorageError, match=str(settings.documents_database)):
        await Storage.open(settings)


@pytest.mark.sqlite
async def test_damaged_document_is_named(sqlite_storage: Storage, settings: ServerSettings) -> None:
    await sqlite_storage.put_scene(SCENE)
    with contextlib.closing(sqlite3.connect(settings.documents_database)) as connection:
        connection.execute("UPDATE scene SET document = '{'")
        connection.commit()
    with pytest.raises(StorageError, match="scn_1"):
        await sqlite_storage.scene("scn_1")
