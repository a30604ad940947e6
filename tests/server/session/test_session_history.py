"""Undo, redo and history: effects, events and refusals."""

import sqlite3
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.data.events import SceneStateEnum
from arcor2_server.documents.edit_notifications import label
from tests.server.session.edits import EDITS, TURNED, Edit, Watcher, apply_edit, refused, rich_project, server_content
from tests.server.session.session_server import Person, Refused, SessionServer, open_server
from tests.server.session.work import ORIGIN, URL, Work

ELSEWHERE = {"position": {"x": 0.1, "y": 0.2, "z": 0.3}, "orientation": TURNED}


@pytest.fixture
def work(alice: Person) -> Work:
    return Work(alice)


async def test_every_edit_of_a_project_can_be_undone(
    server: SessionServer, alice: Person, bob: Person, work: Work
) -> None:
    ids = await rich_project(work)
    ids["project"] = server.session.require_project().id
    await alice.ask("SaveProject")
    saved, watcher = server_content(server), Watcher(server, bob)
    for name, edit in EDITS.items():
        await apply_edit(alice, edit, ids)
        after = server_content(server)
        assert after != saved, name
        watcher.apply_events()
        assert server.session.has_changes
        alice.take()
        answer = await alice.ask("Undo")
        assert answer["request"] == name
        assert answer["revision"] == server.session.revision
        first, *events = alice.take()
        assert "response" in first  # the answer comes first
        assert events, name
        assert not [event for event in events if "Locked" in event["event"]]
        watcher.apply_events()
        assert server_content(server) == saved, name
        assert not server.session.has_changes, name
        assert (await alice.ask("Redo"))["request"] == name
        watcher.apply_events()
        assert server_content(server) == after, name
        assert server.session.has_changes
        await alice.ask("Undo")
        watcher.apply_events()
        assert server_content(server) == saved, name
        assert server.services.locks.locked_roots() == [], name


async def test_all_edits_can_be_undone_and_redone_in_a_row(
    server: SessionServer, alice: Person, bob: Person, work: Work
) -> None:
    await work.project()
    watcher, states = Watcher(server, bob), [server_content(server)]
    numbered = server.session.revision
    ids = {"a": await work.add_point("a")}
    states.append(server_content(server))
    ids["b"] = await work.add_point("b", ids["a"])
    states.append(server_content(server))
    await work.add_action(ids["b"], "act")
    states.append(server_content(server))
    await alice.ask("AddLogicItem", start="START", end=work.action("act").id)
    states.append(server_content(server))
    for state in reversed(states[:-1]):
        await alice.ask("Undo")
        watcher.apply_events()
        assert server_content(server) == state
    with pytest.raises(Refused, match="nothing"):
        await alice.ask("Undo")
    for state in states[1:]:
        await alice.ask("Redo")
        watcher.apply_events()
        assert server_content(server) == state
    with pytest.raises(Refused, match="nothing"):
        await alice.ask("Redo")
    await alice.ask("RestoreRevision", revision=numbered)
    watcher.apply_events()
    assert server_content(server) == states[0]
    await alice.ask("Undo")
    watcher.apply_events()
    assert server_content(server) == states[-1]


async def test_edits_of_one_step_are_undone_and_redone_together(
    server: SessionServer, alice: Person, bob: Person, work: Work
) -> None:
    await work.project()
    before, revision = server_content(server), server.session.revision
    for name in ("wait", "stop"):
        await alice.ask("AddSceneObject", name=name, type="TimeActions", undo_step=name)
        await alice.ask("AddActionPoint", name=name, position=ORIGIN, undo_step=name)
        point = work.point(name)
        kind = f"{next(o.id for o in server.session.document.scene.objects if o.name == name)}/sleep"
        parameters = [{"name": "seconds", "type": "double", "value": "1.0"}]
        added = {"action_point_id": point, "name": f"do_{name}", "type": kind, "parameters": parameters}
        await alice.ask("AddAction", **added, flows=[{"type": "default", "outputs": []}], undo_step=name)
        await alice.ask("AddLogicItem", start="START", end=work.action(f"do_{name}").id, undo_step=name)
        if name == "wait":
            between = server_content(server)
            await alice.ask("RemoveLogicItem", logic_item_id=server.session.document.project.logic[0].id)
            unconnected = server_content(server)
    after = server_content(server)
    undoable = server.session.history.undoable("alice")
    assert str(label(undoable, server.session.history)) == "adding the action do_stop"
    edits = (await alice.ask("History"))["edits"]
    assert [edit.get("of") for edit in edits] == [revision + 6] * 3 + [None] + [None] + [revision + 1] * 3 + [None]
    for wanted in (unconnected, between, before):
        await alice.ask("Undo")
        assert server_content(server) == wanted
    with pytest.raises(Refused, match="nothing"):
        await alice.ask("Undo")
    for wanted in (between, unconnected, after):
        await alice.ask("Redo")
        assert server_content(server) == wanted


async def test_a_step_does_not_continue_after_an_undo_or_an_edit_of_another_user(
    server: SessionServer, alice: Person, bob: Person, work: Work
) -> None:
    await work.project()
    point = await work.add_point("a")
    history = server.session.history

    async def rename(user: Person, name: str, step: str = "") -> None:
        await user.ask("WriteLock", object_id=point)
        await user.ask("RenameActionPoint", action_point_id=point, new_name=name, undo_step=step)

    await rename(alice, "b", "s")
    await rename(bob, "c")
    await rename(alice, "d", "s")
    assert [edit.target for edit in history][-3:] == [0, 0, 0]
    await alice.ask("Undo")
    await rename(alice, "e", "s")
    assert [edit.target for edit in history][-1] == 0


async def test_every_edit_of_a_scene_can_be_undone(
    server: SessionServer, alice: Person, bob: Person, work: Work
) -> None:
    scene = await work.scene()
    robot = work.object("robot")
    saved, watcher = server_content(server), Watcher(server, bob)
    ids = {"robot": robot, "scene": scene}
    edits: list[Edit] = [
        ("AddObjectToScene", {"name": "other", "type": "TimeActions"}, "", False),
        ("RemoveFromScene", {"id": "@robot"}, "", False),
        ("UpdateObjectPose", {"object_id": "@robot", "pose": ELSEWHERE}, "@robot", False),
        ("RenameObject", {"id": "@robot", "new_name": "other"}, "@robot", False),
        ("UpdateObjectParameters", {"id": "@robot", "parameters": [URL | {"value": '"y"'}]}, "@robot", False),
        ("UpdateSceneDescription", {"scene_id": "@scene", "new_description": "other"}, "", False),
        ("RenameScene", {"id": "@scene", "new_name": "other"}, "@scene", False),
    ]
    for edit in edits:
        await apply_edit(alice, edit, ids)
        watcher.apply_events()
        assert server.session.has_changes
        assert (await alice.ask("Undo"))["request"] == edit[0]
        watcher.apply_events()
        assert server_content(server) == saved, edit[0]
        assert not server.session.has_changes
    await alice.ask("CloseScene")


async def test_undo_while_online_moves_the_live_object_but_no_robot(
    server: SessionServer, alice: Person, work: Work
) -> None:
    await work.scene()
    scale, robot = work.object("scale"), work.object("robot")
    for obj in (robot, scale):
        await alice.lock(obj)
        await alice.ask("UpdateObjectPose", object_id=obj, pose=ELSEWHERE)
    await alice.ask("AddObjectToScene", name="other", type="TimeActions")
    server.cell.state = SceneStateEnum.STARTED
    with pytest.raises(Refused, match="online"):
        await alice.ask("Undo")
    number = server.session.revision - 1
    await alice.ask("Undo", dry_run=True, number=number)
    assert server.cell.moved == []
    await alice.ask("Undo", number=number)
    assert [obj for obj, _ in server.cell.moved] == [scale]
    assert server.session.document.scene_object(scale).pose == server.cell.moved[0][1]
    with pytest.raises(Refused, match="robot"):
        await alice.ask("Undo", number=number - 1)
    server.cell.state = SceneStateEnum.STOPPED
    await alice.ask("Undo")
    await alice.ask("Undo")
    assert not server.session.has_changes


# ------------------------------------------------------------------------------------------------ history
async def test_the_history_lists_users_and_edits(server: SessionServer, alice: Person, bob: Person, work: Work) -> None:
    await work.project("p")
    p = work.point("p")
    await bob.ask("AddActionPoint", name="b", position=ORIGIN)
    await apply_edit(alice, ("RenameActionPoint", {"action_point_id": p, "new_name": "q"}, p, False), {})
    await alice.ask("Undo")
    answer = await alice.ask("History")
    assert (answer["revision"], answer["oldest"], answer["undo"], answer["redo"]) == (4, 0, 1, 4)
    rows = [(e["number"], e["user"], e["request"], e["how"], e.get("of"), e["in_force"]) for e in answer["edits"]]
    assert rows == [
        (4, "alice", "RenameActionPoint", "undo", 3, True),
        (3, "alice", "RenameActionPoint", "edit", None, False),
        (2, "bob", "AddActionPoint", "edit", None, True),
        (1, "alice", "AddActionPoint", "edit", None, True),
    ]
    assert answer["edits"][1]["items"] == [{"kind": "action_point", "id": p, "name": "q", "change": "update"}]
    assert answer["edits"][3]["items"][0]["change"] == "add"
    answer = await bob.ask("History", limit=1, before=3)
    assert ([e["number"] for e in answer["edits"]], answer["undo"]) == ([2], 2)
    assert "redo" not in answer
    with pytest.raises(Refused, match="wrong"):
        await bob.ask("History", limit=1001)


async def test_a_revision_can_be_restored_across_users(
    server: SessionServer, alice: Person, bob: Person, work: Work
) -> None:
    ids = await rich_project(work)
    ids["project"] = server.session.require_project().id
    await alice.ask("SaveProject")
    saved, revision, watcher = server_content(server), server.session.revision, Watcher(server, bob)
    for name in ("AddActionPoint", "UpdateActionPointParent", "RemoveLogicItem", "DeleteOverride", "RenameAction"):
        await apply_edit(alice, EDITS[name], ids)
    await Work(bob).add_action(ids["base"], "bobs")
    after = server_content(server)
    watcher.apply_events()
    assert await alice.ask("RestoreRevision", dry_run=True, revision=revision) == {"revision": server.session.revision}
    assert server_content(server) == after
    answer = await alice.ask("RestoreRevision", revision=revision)
    assert answer == {"revision": server.session.revision}
    watcher.apply_events()
    assert server_content(server) == saved
    assert not server.session.has_changes
    assert (await alice.ask("History", limit=1))["edits"][0]["of"] == revision
    assert "nothing" not in await refused(alice, "RestoreRevision", revision=revision)
    await alice.ask("Undo")
    watcher.apply_events()
    assert server_content(server) == after
    for wrong in (-1, server.session.revision + 1):
        assert "can be restored" in await refused(alice, "RestoreRevision", revision=wrong)


async def test_undo_works_after_saving_and_after_a_restart(tmp_path: Path) -> None:
    async with open_server(tmp_path) as server:
        alice = await server.person("alice")
        work = Work(alice)
        await work.project("a", "b")
        await alice.ask("SaveProject")
        for name in ("c", "d"):
            await alice.ask("AddActionPoint", name=name, position=ORIGIN, undo_step="two points")
        await alice.ask("Undo")
        assert not server.session.has_changes
        history = list(server.session.history)
    async with open_server(tmp_path) as server:
        alice, bob = await server.person("alice"), await server.person("bob")
        assert list(server.session.history) == history
        assert not server.session.has_changes
        answer = await alice.ask("History")
        assert (answer["undo"], answer["redo"]) == (2, 5)
        assert "undo" not in await bob.ask("History")
        await alice.ask("Redo")
        assert server.session.has_changes
        await alice.ask("Undo")
        await alice.ask("Undo")
        assert [point.name for point in server.session.require_project().action_points] == ["a"]
        assert server.session.has_changes
    async with open_server(tmp_path) as server:
        assert server.session.has_changes
        alice = await server.person("alice")
        await alice.ask("Redo")
        assert not server.session.has_changes
        await alice.ask("CloseProject")


async def test_a_reverted_change_counts_as_saved_after_a_restart(tmp_path: Path) -> None:
    async with open_server(tmp_path, history_limit=4) as server:
        alice = await server.person("alice")
        await Work(alice).project("p")
        await alice.ask("SaveProject")
        await Work(alice).add_point("q")
        for _ in range(4):  # the journal starts with a new base, which is not the saved document
            await alice.ask("Undo")
            await alice.ask("Redo")
    async with open_server(tmp_path, history_limit=4) as server:
        assert server.session.has_changes
        alice = await server.person("alice")
        await alice.ask("Undo")
        assert not server.session.has_changes


async def test_the_history_limit_bounds_undo(tmp_path: Path) -> None:
    async with open_server(tmp_path, history_limit=5) as server:
        alice = await server.person("alice")
        work = Work(alice)
        await work.project(*(f"p{number}" for number in range(8)))
        answer = await alice.ask("History")
        assert (answer["revision"], answer["oldest"], len(answer["edits"])) == (8, 3, 5)
        assert "can be restored" in await refused(alice, "RestoreRevision", revision=2)
        for _ in range(3):
            await alice.ask("Undo")
        # Each undo is an edit too: two of the five stored edits can still be undone, until they are dropped.
        while "undo" in await alice.ask("History"):
            await alice.ask("Undo")
        assert len(server.session.history) == 5
        assert "nothing" in await refused(alice)


@pytest.mark.parametrize("version", [1, 2])
async def test_a_journal_of_an_earlier_format_is_converted(tmp_path: Path, version: int) -> None:
    async with open_server(tmp_path) as server:
        await Work(await server.person("alice")).project("p")
    connection = sqlite3.connect(tmp_path / "journal.sqlite")
    columns = ["edit.sum", "base.sum"] + (["edit.request", "edit.how", "edit.target"] if version == 1 else [])
    for table, column in (name.split(".") for name in columns):
        connection.execute(f"alter table {table} drop column {column}")
    connection.execute("drop table opening")
    connection.execute(f"pragma user_version = {version}")
    connection.commit()
    connection.close()
    (tmp_path / "journal.position").unlink()
    async with open_server(tmp_path) as server:
        assert server.services.damage.notices == []
        alice = await server.person("alice")
        assert [point.name for point in server.session.require_project().action_points] == ["p"]
        await alice.ask("Undo")
        assert not server.session.require_project().action_points
    async with open_server(tmp_path) as server:
        assert not server.session.require_project().action_points
        assert server.services.damage.notices == []


async def test_an_undo_that_cannot_be_stored_is_reverted(
    server: SessionServer, alice: Person, work: Work, monkeypatch: pytest.MonkeyPatch
) -> None:
    from arcor2_server.documents import journal_file

    await work.project("p")
    await alice.ask("SaveProject")
    before, history = server_content(server), await alice.ask("History")

    def full(connection: sqlite3.Connection, job: object, serial: int) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(journal_file, "write_job", full)
        assert "disk is full" in await refused(alice)
    assert server_content(server) == before
    assert not server.session.has_changes
    assert await alice.ask("History") == history
    await alice.ask("Undo")
    assert server.session.has_changes


async def test_a_failed_save_keeps_unsaved_changes(
    server: SessionServer, alice: Person, work: Work, monkeypatch: pytest.MonkeyPatch
) -> None:
    from arcor2_hw.exceptions import StorageError

    await work.project("p")
    await alice.ask("SaveProject")
    await work.add_point("q")

    async def failing(project: Any) -> Any:
        raise StorageError("no")

    with monkeypatch.context() as patch:
        patch.setattr(server.services.storage, "put_project", failing)
        with pytest.raises(Refused):
            await alice.ask("SaveProject")
    assert server.session.has_changes
    await alice.ask("Undo")
    assert not server.session.has_changes


async def test_system_info_lists_the_requests_for_undo(alice: Person) -> None:
    answer = await alice.ask("SystemInfo")
    assert {"Undo", "Redo", "History", "RestoreRevision"} <= set(answer["supported_rpc_requests"])
