"""Acknowledged edits survive a crash; edits that cannot be stored are refused and reverted."""

import asyncio
import os
import random
import signal
import sqlite3
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace

from arcor2_hw.exceptions import StorageError
from arcor2_server.documents import journal_file
from arcor2_server.documents.changes import Kind
from tests.postgresql import variables
from tests.server.session.session_server import Person, Refused, SessionServer, open_server

REPOSITORY = Path(__file__).resolve().parents[3]


async def open_project(alice: Person, points: int = 1) -> None:
    await alice.ask("NewScene", name="scene")
    await alice.ask("AddObjectToScene", name="time", type="TimeActions")
    await alice.ask("SaveScene")
    await alice.ask("NewProject", scene_id=alice.server.session.require_scene().id, name="project")
    for number in range(points):
        await add_point(alice, f"p{number}")
    alice.take()


async def add_point(person: Person, name: str) -> None:
    await person.ask("AddActionPoint", name=name, position={"x": 0, "y": 0, "z": 0})


def point_names(server: SessionServer) -> list[str]:
    return [point.name for point in server.session.require_project().action_points]


@pytest.mark.parametrize("moment", [0.1, 0.35])
async def test_acknowledged_edits_survive_a_kill(tmp_path: Path, moment: float) -> None:
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "tests.server.session.editing_server",
        str(tmp_path),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
        cwd=REPOSITORY,
        env=os.environ | variables(tmp_path) | {"PYTHONPATH": str(REPOSITORY)},
    )
    assert process.stdout is not None
    acknowledged = []
    try:
        async with asyncio.timeout(30):
            acknowledged += await _lines(process.stdout, 50)
        await asyncio.sleep(random.uniform(0, moment))
        process.send_signal(signal.SIGKILL)
        acknowledged += await _lines(process.stdout, 1_000_000)
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()
    async with open_server(tmp_path) as server:
        project = server.session.require_project()
        restored = [action.name for point in project.action_points for action in point.actions]
        missing = set(acknowledged) - set(restored)
        assert not missing
        assert len(acknowledged) >= 50
        # Each client waits for an answer before its next edit: at most one edit of each exists without acknowledgement.
        assert len(restored) <= len(acknowledged) + 8
        assert server.session.project_changed
        assert not server.session.scene_changed
        # It is a document like any other: it can be edited and saved.
        alice = await server.person("alice")
        await add_point(alice, "afterwards")
        await alice.ask("SaveProject")
        assert not server.session.has_changes


async def _lines(stream: asyncio.StreamReader, count: int) -> list[str]:
    found = []
    while len(found) < count and (line := await stream.readline()).endswith(b"\n"):
        kind, _, name = line.decode().strip().partition(" ")
        if kind == "acknowledged":
            found.append(name)
    return found


async def test_a_restart_restores_the_open_document(tmp_path: Path) -> None:
    async with open_server(tmp_path) as server:
        alice = await server.person("alice")
        await open_project(alice)
        await alice.ask("SaveProject")
        await add_point(alice, "unsaved")
        await alice.lock(server.session.require_project().action_points[0].id)
        scene, project = server.session.scene, server.session.project
        history = list(server.session.history)
    async with open_server(tmp_path) as server:
        assert (server.session.scene, server.session.project) == (scene, project)
        assert list(server.session.history) == history
        assert server.session.has_changes
        assert server.services.locks.announced() == {}
        names = [event.event for event in server.session.greeting(server.cell.state)]
        assert names == ["OpenProject", "SceneState"]
        saved = await server.services.storage.project(server.session.require_project().id)
        assert [point.name for point in saved.action_points] == ["p0"]
        alice = await server.person("alice")
        await alice.ask("CloseProject", force=True)
    async with open_server(tmp_path) as server:
        assert server.session.greeting(server.cell.state) == []
        assert server.session.scene is None


class Log:
    """Records the errors and warnings of the journal's file."""

    def __init__(self) -> None:
        self.reports: list[str] = []

    def error(self, event: str, **values: object) -> None:
        self.reports.append(f"{event} {values}")

    warning = error


@pytest.fixture
def log(monkeypatch: pytest.MonkeyPatch) -> Log:
    log = Log()
    monkeypatch.setattr(journal_file, "log", log)
    return log


async def test_a_table_left_by_a_killed_start_is_removed(tmp_path: Path, log: Log) -> None:
    async with open_server(tmp_path):
        pass
    connection = sqlite3.connect(tmp_path / "journal.sqlite")
    connection.execute("create table extent (content blob)")
    connection.close()
    async with open_server(tmp_path) as server:
        await open_project(await server.person("alice"))
    assert log.reports == []
    connection = sqlite3.connect(tmp_path / "journal.sqlite")
    assert connection.execute("select count(*) from sqlite_master where name = 'extent'").fetchone() == (0,)
    connection.close()


async def test_a_new_scene_survives_without_ever_being_saved(tmp_path: Path) -> None:
    async with open_server(tmp_path) as server:
        alice = await server.person("alice")
        await alice.ask("NewScene", name="scene")
        await alice.ask("AddObjectToScene", name="time", type="TimeActions")
    async with open_server(tmp_path) as server:
        assert [obj.name for obj in server.session.require_scene().objects] == ["time"]
        assert server.session.scene_changed
        assert await server.services.storage.scenes() == []


async def test_the_size_of_the_journal_is_bounded(tmp_path: Path) -> None:
    async with open_server(tmp_path, history_limit=10) as server:
        alice = await server.person("alice")
        await open_project(alice)
        for number in range(1, 45):
            await add_point(alice, f"p{number}")
        expected, project = [f"p{number}" for number in range(45)], server.session.project
        assert point_names(server) == expected
    with sqlite3.connect(tmp_path / "journal.sqlite") as connection:
        (rows,) = connection.execute("select count(*) from edit").fetchone()
        assert 10 <= rows <= 20
    connection.close()
    async with open_server(tmp_path, history_limit=10) as server:
        assert server.session.project == project
        assert server.session.has_changes
        assert len(server.session.history) == 10
        # The stored edits can be undone step by step.
        document = server.session.document
        for edit in reversed(server.session.history):
            document.apply([change.inverse() for change in reversed(edit.changes)])
        assert [item.value.name for item in document.of_kind(Kind.POINT)] == expected[:-10]


@pytest.mark.parametrize("damage", ["garbage", "truncated", "row", "gap", "newer", "strange"])
async def test_a_damaged_journal_is_renamed_and_reported(tmp_path: Path, damage: str, log: Log) -> None:
    async with open_server(tmp_path) as server:
        alice = await server.person("alice")
        await open_project(alice, points=30)
        await alice.ask("SaveProject")
        await add_point(alice, "one")
        await add_point(alice, "two")
        await add_point(alice, "three")
        key = server.session.require_project().id
    path = tmp_path / "journal.sqlite"
    statements = {
        "row": "update edit set changes = x'5b5b5d5d'",
        "gap": "delete from edit where number = (select max(number) - 1 from edit)",
        "newer": "pragma user_version = 99",
        "strange": "drop table base",
    }
    if damage == "garbage":
        path.write_bytes(b"no database at all" * 1000)
    elif damage == "truncated":
        path.write_bytes(path.read_bytes()[:5000])
    else:
        connection = sqlite3.connect(path)
        connection.execute(statements[damage])
        connection.commit()
        connection.close()
    remaining = ["one"] if damage == "gap" else []
    async with open_server(tmp_path) as server:
        (notice,) = server.services.damage.notices
        assert "journal.damaged-" in notice.text
        assert ("Changes 32 to 33" if damage == "gap" else "alice") in notice.text
        greeted = server.services.greeting()[-1].data
        assert greeted.as_message(greeted.message) == notice
        alice = await server.person("alice")
        if not remaining:
            assert server.session.greeting(server.cell.state) == []
            await alice.ask("OpenProject", id=key)
        assert point_names(server)[30:] == remaining
        await add_point(alice, "again")
    assert "journal.damaged-" in log.reports[0]
    assert len(list(tmp_path.glob("journal.damaged-*.sqlite"))) == 1
    async with open_server(tmp_path) as server:
        assert point_names(server)[-1] == "again"


async def test_a_second_server_on_the_same_data_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal_file, "BUSY_TIMEOUT", 0.05)
    async with open_server(tmp_path):
        with pytest.raises(StorageError, match=r"journal\.sqlite|is in use by"):
            async with open_server(tmp_path):
                pass


async def test_edits_that_cannot_be_stored_are_reverted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with open_server(tmp_path) as server:
        alice, bob = await server.person("alice"), await server.person("bob")
        await open_project(alice, points=2)
        await alice.ask("SaveProject")
        before, number = server.session.project, len(server.session.history)
        write, failing = journal_file.write_job, True

        def full(connection: sqlite3.Connection, job: object, serial: int) -> None:
            if failing:
                raise sqlite3.OperationalError("database or disk is full")
            write(connection, job, serial)  # type: ignore[arg-type]

        monkeypatch.setattr(journal_file, "write_job", full)
        bob.take()
        edits = [add_point(person, f"new{n}") for n, person in enumerate((alice, bob, alice, bob))]
        results = await asyncio.gather(*edits, return_exceptions=True)
        assert all(isinstance(result, Refused) for result in results)
        assert any("disk is full" in str(result) for result in results)
        assert bob.events() == []
        assert server.session.project == before
        assert not server.session.has_changes
        assert len(server.session.history) == number
        failing = False
        await add_point(alice, "kept")
        assert point_names(server) == ["p0", "p1", "kept"]
    async with open_server(tmp_path) as server:
        assert point_names(server) == ["p0", "p1", "kept"]


async def test_an_edit_during_a_save_counts_as_unsaved(
    server: SessionServer, alice: Person, monkeypatch: pytest.MonkeyPatch
) -> None:
    await open_project(alice)
    put = server.services.storage.put_project

    async def slow(project):  # type: ignore[no-untyped-def]
        item = server.session.document.of_kind(Kind.POINT)[0]
        change = server.session.document.update(Kind.POINT, item.id, replace(item.value, name="meanwhile"))
        await server.session.commit("bob", [change])
        return await put(project)

    monkeypatch.setattr(server.services.storage, "put_project", slow)
    await alice.ask("SaveProject")
    assert server.session.project_changed
    assert point_names(server) == ["meanwhile"]


async def test_the_edit_of_a_cancelled_request_is_kept(server: SessionServer, alice: Person) -> None:
    await open_project(alice)
    task = asyncio.create_task(add_point(alice, "last"))
    while point_names(server)[-1] != "last":
        await asyncio.sleep(0)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    await add_point(alice, "later")
    assert point_names(server) == ["p0", "last", "later"]
    assert not server.session._pending


async def test_a_crash_right_after_saving_keeps_the_saved_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with open_server(tmp_path) as server:
        alice = await server.person("alice")
        await open_project(alice)
        monkeypatch.setattr(server.session, "_shorten", lambda: None)  # the base in the journal stays the old one
        await alice.ask("SaveProject")
        saved = await server.services.storage.project(server.session.require_project().id)
    async with open_server(tmp_path) as server:
        assert not server.session.has_changes
        assert server.session.project == saved
        alice = await server.person("alice")
        await alice.ask("Undo")
        assert server.session.has_changes
        await alice.ask("CloseProject", force=True)
        assert (await alice.ask("GetProject", id=saved.id))["modified"] == saved.modified
