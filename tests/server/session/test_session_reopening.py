"""Undo history of a document that is closed and reopened, or changed while closed."""

import sqlite3
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from arcor2_hw.data.geometry import Position
from arcor2_server.documents import Session, closed_history
from tests.server.crash_copy import copy_at_one_moment
from tests.server.session.edits import refused, server_content
from tests.server.session.session_server import Person, SessionServer, open_server
from tests.server.session.work import ORIGIN, POSE, Work

OLD_DATA = Path(__file__).parent / "data_before_closed_histories"


@pytest.fixture
def work(alice: Person) -> Work:
    return Work(alice)


async def reopen(person: Person, *, force: bool = False) -> None:
    """Close the open project and open it again."""
    key = person.server.session.require_project().id
    await person.ask("CloseProject", force=force)
    await person.ask("OpenProject", id=key)
    person.take()


def points(server: SessionServer) -> list[str]:
    return [point.name for point in server.session.require_project().action_points]


async def test_each_user_can_undo_and_redo_after_close_and_open(
    server: SessionServer, alice: Person, bob: Person, work: Work
) -> None:
    await work.project("a", "b")
    await Work(bob).add_point("bobs")
    await alice.ask("Undo")
    await alice.ask("SaveProject")
    stack = {person: await person.ask("History") for person in (alice, bob)}
    assert (points(server), stack[alice]["undo"], stack[alice]["redo"], stack[bob]["undo"]) == (["a", "bobs"], 1, 4, 3)
    await reopen(alice)
    assert {person: await person.ask("History") for person in (alice, bob)} == stack
    assert not server.session.has_changes
    await alice.ask("Redo")
    assert points(server) == ["a", "b", "bobs"], "a restored item is at its old place"
    assert server.session.has_changes
    await bob.ask("Undo")
    assert points(server) == ["a", "b"]
    await alice.ask("RestoreRevision", revision=0)
    assert points(server) == []


async def test_discarded_changes_are_not_in_the_history(server: SessionServer, alice: Person, work: Work) -> None:
    await work.project("a", "b")
    await alice.ask("SaveProject")
    await alice.ask("Undo")
    await work.add_point("lost")
    await reopen(alice, force=True)
    assert (points(server), server.session.has_changes, server.session.revision) == (["a", "b"], False, 2)
    await alice.ask("Undo")
    assert points(server) == ["a"]
    await reopen(alice, force=True)
    await alice.ask("RestoreRevision", revision=1)
    assert points(server) == ["a"]


async def test_a_project_that_was_never_saved_leaves_no_history(
    server: SessionServer, alice: Person, work: Work
) -> None:
    await work.project("a")
    await alice.ask("CloseProject", force=True)
    assert len(list(server.services.settings.history_dir.iterdir())) == 1, "the history of the scene"


@pytest.mark.sqlite
@pytest.mark.parametrize("killed", [False, True])
async def test_history_of_a_closed_project_survives_a_restart(tmp_path: Path, killed: bool) -> None:
    (tmp_path / "before").mkdir()
    async with open_server(tmp_path / "before") as server:
        alice = await server.person("alice")
        await Work(alice).project("a", "b")
        await alice.ask("SaveProject")
        key = server.session.require_project().id
        await alice.ask("CloseProject")
        copy_at_one_moment(tmp_path / "before", tmp_path / "killed")
    async with open_server(tmp_path / ("killed" if killed else "before")) as server:
        alice = await server.person("alice")
        await alice.ask("OpenProject", id=key)
        await alice.ask("Undo")
        assert points(server) == ["a"]
        copy_at_one_moment(server.services.settings.data_dir, tmp_path / "open")
    async with open_server(tmp_path / "open") as server:
        assert (points(server), server.session.has_changes) == (["a"], True)
        alice = await server.person("alice")
        await alice.ask("Redo")
        assert not server.session.has_changes
        await alice.ask("Undo")
        await alice.ask("Undo")
        assert points(server) == []


@pytest.mark.parametrize("external", [False, True])
async def test_a_kill_right_after_opening_loses_no_history(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, external: bool
) -> None:
    """The history is written to the journal only after the answer to OpenProject."""
    (tmp_path / "before").mkdir()
    async with open_server(tmp_path / "before") as server:
        alice = await server.person("alice")
        key = await Work(alice).project("a", "b")
        await alice.ask("SaveProject")
        await alice.ask("CloseProject")
        if external:
            saved = await server.services.storage.project(key)
            await server.services.storage.put_project(replace(saved, description="changed"))
        with monkeypatch.context() as patch:
            patch.setattr(Session, "_journal_history", lambda *_: None)  # killed before it is written
            await alice.ask("OpenProject", id=key)
        copy_at_one_moment(tmp_path / "before", tmp_path / "killed")
    for _ in range(2):
        async with open_server(tmp_path / "killed") as server:
            assert (points(server), server.session.has_changes) == (["a", "b"], False)
            assert server.session.oldest_revision == 0
            assert len(server.session.history) == server.session.revision == 2 + external
        for file in (tmp_path / "killed" / "history").iterdir():
            file.unlink()  # the journal holds it now
    async with open_server(tmp_path / "killed") as server:
        alice = await server.person("alice")
        await alice.ask("Undo")
        assert points(server) == ["a"]


async def test_an_edit_right_after_opening_follows_the_stored_history(tmp_path: Path) -> None:
    (tmp_path / "before").mkdir()
    async with open_server(tmp_path / "before") as server:
        alice = await server.person("alice")
        key = await Work(alice).project("a", "b")
        await alice.ask("SaveProject")
        await alice.ask("CloseProject")
        await alice.ask("OpenProject", id=key)
        await alice.ask("AddActionPoint", name="c", position=ORIGIN)
        copy_at_one_moment(tmp_path / "before", tmp_path / "killed")
    async with open_server(tmp_path / "killed") as server:
        alice = await server.person("alice")
        assert [edit["number"] for edit in (await alice.ask("History"))["edits"]] == [3, 2, 1]
        for remaining in (["a", "b"], ["a"], []):
            await alice.ask("Undo")
            assert points(server) == remaining


async def test_undo_is_refused_for_items_changed_by_others(server: SessionServer, alice: Person, work: Work) -> None:
    project = await work.project("moved", "gone", "same")
    await alice.ask("SaveProject")
    await alice.ask("CloseProject")
    saved = await server.services.storage.project(project)
    moved, gone, same = saved.action_points
    moved = replace(moved, position=Position(1, 2, 3))
    added = replace(gone, id="acp_other", name="added")
    await server.services.storage.put_project(replace(saved, action_points=[moved, same, added]))
    await alice.ask("OpenProject", id=project)
    assert (points(server), server.session.has_changes) == (["moved", "same", "added"], False)
    newest = (await alice.ask("History"))["edits"][0]
    assert (newest["number"], newest["user"], newest["how"], newest["touched"]) == (4, "", "external", 3)
    for number, change in ((1, "moved (action point) was changed"), (2, "gone (action point) was removed")):
        text = await refused(alice, "Undo", number=number)
        assert text == f"{change} since outside the editor, while the document was closed (edit 4)."
    await alice.ask("Undo")  # nobody else has changed this one
    assert points(server) == ["moved", "added"]
    await alice.ask("RestoreRevision", revision=3)
    assert points(server) == ["moved", "gone", "same"]
    assert server.session.require_project().action_points[0].position == Position(0, 0, 0)


async def test_history_restarts_when_it_does_not_match_the_saved_document(
    server: SessionServer, alice: Person, work: Work
) -> None:
    project = await work.project("a", "b")
    await alice.ask("SaveProject")
    await alice.ask("CloseProject")
    saved = await server.services.storage.project(project)
    await server.services.storage.put_project(replace(saved, action_points=saved.action_points[::-1]))
    await alice.ask("OpenProject", id=project)
    assert (points(server), server.session.revision) == (["b", "a"], 0)
    assert "nothing" in await refused(alice)


async def test_a_scene_has_a_history_of_its_own(server: SessionServer, alice: Person, work: Work) -> None:
    project = await work.project("a")
    await alice.ask("SaveProject")
    scene = server.session.require_scene().id
    await alice.ask("CloseProject")
    await alice.ask("OpenScene", id=scene)
    scale = work.object("scale")
    before = server_content(server)
    await alice.lock(scale)
    elsewhere = POSE | {"position": {"x": 9.0, "y": 9.0, "z": 9.0}}
    await alice.ask("UpdateObjectPose", object_id=scale, pose=elsewhere)
    await alice.ask("WriteUnlock", object_id=scale)
    await alice.ask("SaveScene")
    await alice.ask("CloseScene")
    await alice.ask("OpenProject", id=project)
    assert [edit["request"] for edit in (await alice.ask("History"))["edits"]] == ["AddActionPoint"]
    assert server.session.document.scene_object(scale).pose.position == Position(9, 9, 9)
    await alice.ask("Undo")
    await alice.ask("CloseProject", force=True)
    await alice.ask("OpenScene", id=scene)
    await alice.ask("Undo")
    assert server_content(server) == before


async def test_deleting_a_project_deletes_its_history(server: SessionServer, alice: Person, work: Work) -> None:
    project = await work.project("a")
    await alice.ask("SaveProject")
    saved = await server.services.storage.project(project)
    await alice.ask("CloseProject")
    await alice.ask("DeleteProject", id=project)
    await server.services.storage.put_project(saved)
    await alice.ask("OpenProject", id=project)
    assert "nothing" in await refused(alice)


async def test_the_number_of_stored_histories_is_bounded(
    server: SessionServer, alice: Person, work: Work, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(closed_history, "CLOSED_LIMIT", 2)
    first = await work.project("a")
    await alice.ask("SaveProject")
    await alice.ask("CloseProject")
    for name in ("second", "third"):
        await alice.ask("NewProject", name=name, scene_id=(await alice.ask("ListScenes"))[0]["id"])
        await work.add_point("a")
        await alice.ask("SaveProject")
        await reopen(alice)
        assert "undo" in await alice.ask("History")
        await alice.ask("CloseProject")
    assert len(list(server.services.settings.history_dir.glob("*"))) == 2
    await alice.ask("OpenProject", id=first)
    assert "nothing" in await refused(alice)


@pytest.mark.parametrize("content", [b"", b"no history", "cut"])
async def test_a_project_with_a_damaged_history_opens(
    server: SessionServer, alice: Person, work: Work, content: Any
) -> None:
    project = await work.project("a")
    await alice.ask("SaveProject")
    await alice.ask("CloseProject")
    file = max(server.services.settings.history_dir.iterdir(), key=lambda each: each.stat().st_mtime_ns)
    assert file.stat().st_mode & 0o777 == 0o600
    await alice.ask("OpenScene", id=(await alice.ask("ListScenes"))[0]["id"])
    await alice.ask("CloseScene")  # the history of the document closed last is not read from the disk
    file.write_bytes(file.read_bytes()[:-5] if content == "cut" else content)
    await alice.ask("OpenProject", id=project)
    assert points(server) == ["a"]
    (notice,) = [event["data"]["message"] for event in alice.take() if event.get("event") == "Notification"]
    (stored,) = file.parent.glob("*.damaged-*")
    assert "Edits of 'project' from before it was opened cannot be undone." in notice
    assert notice.startswith(f"The file {file} is damaged: ")
    assert str(stored) in notice
    assert "nothing" in await refused(alice)


@pytest.mark.sqlite
async def test_data_of_an_earlier_version_is_migrated(tmp_path: Path) -> None:
    """The files were written by the version before histories of closed documents were stored."""
    for name in ("documents", "journal"):
        connection = sqlite3.connect(tmp_path / f"{name}.sqlite")
        connection.executescript((OLD_DATA / f"{name}.sql").read_text())
        connection.close()
    async with open_server(tmp_path) as server:
        assert (points(server), server.session.has_changes) == (["saved", "bobs"], True)
        alice = await server.person("alice")
        await alice.ask("Redo")
        await alice.ask("SaveProject")
        await reopen(alice)
        assert points(server) == ["saved", "unsaved", "bobs"]
        await alice.ask("Undo")
        await alice.ask("Undo")
        assert points(server) == ["bobs"]
