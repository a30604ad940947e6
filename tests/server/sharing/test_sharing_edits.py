"""Effects of edits on others: shared breakpoints, and the texts for undo and redo."""

import asyncio
from pathlib import Path

import pytest

from arcor2_server.documents.edit_notifications import label
from arcor2_server.execution import breakpoints
from tests.server.session.edits import EDITS, apply_edit, rich_project
from tests.server.session.session_server import Person, Refused, SessionServer, open_server
from tests.server.session.work import POSE, Work
from tests.server.sharing.conftest import expect, subscribed


@pytest.fixture
def work(alice: Person) -> Work:
    return Work(alice)


# ---------------------------------------------------------------------------------------------- shared breakpoints
async def test_breakpoints_are_shared_and_announced(alice: Person, bob: Person, stranger: Person, work: Work) -> None:
    project = await work.project("p")
    action = await work.add_action(work.point("p"), "wait")
    await subscribed(bob, "BreakpointsChanged")
    revision = work.session.revision
    both = {action, work.point("p")}
    answer = await alice.ask("SetBreakpoints", add=sorted(both))
    assert (set(answer["ids"]), answer["user"], answer["project_id"]) == (both, "alice", project)
    event = await expect(bob, "BreakpointsChanged")
    assert (set(event["ids"]), event["user"]) == (both, "alice")
    assert set((await stranger.ask("GetBreakpoints"))["ids"]) == both
    await alice.ask("SetBreakpoints", add=[action])  # it is already set
    await bob.ask("SetBreakpoints", remove=[action, "act_none"])
    event = await expect(bob, "BreakpointsChanged")
    assert (event["ids"], event["user"]) == ([work.point("p")], "bob")
    assert work.session.revision == revision
    with pytest.raises(Refused, match="act_none"):
        await alice.ask("SetBreakpoints", add=["act_none"])
    with pytest.raises(Refused, match="by one request"):
        await alice.ask("SetBreakpoints", add=[action], remove=[action])
    with pytest.raises(Refused, match="RegisterUser"):
        await stranger.ask("SetBreakpoints", remove=[action])
    with pytest.raises(Refused, match="pro_none"):
        await alice.ask("GetBreakpoints", project_id="pro_none")


async def test_the_number_of_breakpoints_is_limited(monkeypatch: pytest.MonkeyPatch, alice: Person, work: Work) -> None:
    monkeypatch.setattr(breakpoints, "MAX_BREAKPOINTS", 2)
    await work.project("p", "q", "r")
    points = [work.point(name) for name in "pqr"]
    await alice.ask("SetBreakpoints", add=points[:2])
    with pytest.raises(Refused, match="at most 2"):
        await alice.ask("SetBreakpoints", add=points[2:])
    await alice.ask("SetBreakpoints", add=points[2:], remove=points[:1])


async def test_a_breakpoint_is_removed_and_restored_with_its_action(alice: Person, bob: Person, work: Work) -> None:
    await work.project("p")
    action = await work.add_action(work.point("p"), "wait")
    await alice.ask("SetBreakpoints", add=[action])
    await subscribed(bob, "BreakpointsChanged")
    await alice.ask("RemoveAction", id=action)
    assert (await expect(bob, "BreakpointsChanged"))["ids"] == []
    assert (await bob.ask("GetBreakpoints"))["ids"] == []
    await alice.ask("Undo")
    assert (await expect(bob, "BreakpointsChanged"))["ids"] == [action]
    await work.add_action(work.point("p"), "other")
    await asyncio.sleep(0.02)
    assert "BreakpointsChanged" not in bob.names()


async def test_breakpoints_belong_to_the_project(tmp_path: Path) -> None:
    async with open_server(tmp_path) as server:
        alice = await server.person("alice")
        work = Work(alice)
        project = await work.project("p")
        point = work.point("p")
        await alice.ask("SaveProject")
        await alice.ask("SetBreakpoints", add=[point])
        await alice.ask("CloseProject")
        with pytest.raises(Refused, match="No scene is open"):
            await alice.ask("GetBreakpoints")
        assert (await alice.ask("GetBreakpoints", project_id=project))["ids"] == [point]
    async with open_server(tmp_path) as server:
        alice = await server.person("alice")
        assert await alice.ask("GetBreakpoints", project_id=project) == {
            "project_id": project,
            "ids": [point],
            "user": "alice",
        }
        await alice.ask("DeleteProject", id=project)
        assert await server.services.breakpoints.ids(project) == set()
    async with open_server(tmp_path) as server:
        assert await server.services.breakpoints.ids(project) == set()


# ---------------------------------------------------------------------------------------------- undo and redo
async def test_each_user_is_notified_of_possible_undo(alice: Person, bob: Person, stranger: Person, work: Work) -> None:
    await stranger.ask("SubscribeEvents", events=["HistoryChanged"])
    assert await expect(stranger, "HistoryChanged") == {"revision": 0}
    await work.project()
    await subscribed(bob, "HistoryChanged")
    await alice.ask("SubscribeEvents", events=["HistoryChanged"])
    assert (await expect(alice, "HistoryChanged")) == {"revision": 0}
    await work.add_point("p")
    point = work.point("p")
    event = await expect(alice, "HistoryChanged", lambda data: data["revision"] == 1)
    assert event == {
        "revision": 1,
        "undo": {
            "number": 1,
            "request": "AddActionPoint",
            "text": "adding the action point p",
            "key": "adding {item}",
            "values": {
                "item": {
                    "text": "the action point p",
                    "key": "the action point {name}",
                    "values": {"name": "p"},
                },
            },
        },
    }
    assert await expect(bob, "HistoryChanged", lambda data: data["revision"] == 1) == {"revision": 1}
    await alice.lock(point, tree=True)
    await alice.ask("RenameActionPoint", action_point_id=point, new_name="q")
    event = await expect(alice, "HistoryChanged", lambda data: data["revision"] == 2)
    assert event["undo"]["text"] == "renaming the action point p to q"
    await alice.ask("Undo")
    event = await expect(alice, "HistoryChanged", lambda data: data["revision"] == 3)
    assert event["undo"]["text"] == "adding the action point p"
    assert event["redo"]["text"] == "renaming the action point p to q"
    await alice.ask("Redo")
    event = await expect(alice, "HistoryChanged", lambda data: data["revision"] == 4)
    assert event["undo"]["text"] == "renaming the action point p to q"
    assert "redo" not in event
    await alice.lock(point, tree=True)
    await alice.ask("UpdateActionPointPosition", action_point_id=point, new_position={"x": 1.0, "y": 0.0, "z": 0.0})
    event = await expect(alice, "HistoryChanged", lambda data: data["revision"] == 5)
    assert event["undo"]["text"] == "moving the action point q"
    await work.add_action(point, "wait")
    event = await expect(alice, "HistoryChanged", lambda data: data["revision"] == 6)
    assert event["undo"]["text"] == "adding the action wait"
    await alice.ask("RestoreRevision", revision=1)
    event = await expect(alice, "HistoryChanged", lambda data: data["revision"] == 7)
    assert event["undo"]["text"] == "going back to revision 1"
    await alice.ask("Undo")
    event = await expect(alice, "HistoryChanged", lambda data: data["revision"] == 8)
    assert event["redo"]["text"] == "going back to revision 1"
    bob.take()
    await bob.ask("RegisterUser", user_name="bobby")
    assert (await expect(bob, "HistoryChanged"))["revision"] == 8
    await alice.ask("WriteUnlock", object_id=point)
    await alice.ask("CloseProject", force=True)
    assert await expect(alice, "HistoryChanged") == {"revision": 0}


UNDO_TEXTS = {
    "AddActionPoint": "adding the action point new",
    "RenameActionPoint": "renaming the action point base to other",
    "UpdateActionPointPosition": "moving the action point base",
    "UpdateActionPointParent": "changing the parent of the action point base",
    "CopyActionPoint": "adding the action point base_copy",
    "RemoveActionPoint": "removing the action point below",
    "AddActionPointOrientation": "adding the orientation o",
    "UpdateActionPointOrientation": "changing the orientation o",
    "RenameActionPointOrientation": "renaming the orientation o to other",
    "RemoveActionPointOrientation": "removing the orientation o",
    "UpdateActionPointJoints": "changing the joints j",
    "RenameActionPointJoints": "renaming the joints j to other",
    "RemoveActionPointJoints": "removing the joints j",
    "UpdateAction": "changing the action one",
    "RenameAction": "renaming the action one to other",
    "AddLogicItem": "adding a connection",
    "RemoveLogicItem": "removing a connection",
    "UpdateLogicItem": "changing a connection",
    "UpdateProjectHasLogic": "changing the project project",
    "UpdateProjectDescription": "changing the project project",
    "RenameProject": "renaming the project project to other",
    "AddProjectParameter": "adding the parameter x",
    "UpdateProjectParameter": "renaming the parameter speed to v",
    "RemoveProjectParameter": "removing the parameter speed",
    "UpdateOverride": "changing an override",
    "DeleteOverride": "removing an override",
}


async def test_every_edit_has_a_text_for_undo(server: SessionServer, alice: Person, work: Work) -> None:
    ids = await rich_project(work)
    ids["project"] = server.session.require_project().id
    found = {}
    for name, edit in EDITS.items():
        await apply_edit(alice, edit, ids)
        undo = server.session.history.undoable("alice")
        assert undo is not None
        found[name] = str(label(undo, server.session.history))
        await alice.ask("Undo")
    assert found == UNDO_TEXTS
    await alice.ask("CloseProject", force=True)
    await alice.ask("OpenScene", id=(await alice.ask("ListScenes"))[0]["id"])
    await alice.lock(ids["robot"])
    await alice.ask(
        "UpdateObjectPose", object_id=ids["robot"], pose=POSE | {"position": {"x": 9.0, "y": 9.0, "z": 9.0}}
    )
    undo = server.session.history.undoable("alice")
    assert undo is not None
    assert str(label(undo, server.session.history)) == "moving the object robot"


async def test_consecutive_edits_are_announced_together_after_the_answers(
    server: SessionServer, alice: Person, work: Work
) -> None:
    await work.project()
    await subscribed(alice, "HistoryChanged")
    for number in range(50):
        await alice.ask("AddActionPoint", name=f"p{number}", position={"x": 0.0, "y": 0.0, "z": 0.0})
    taken = alice.take()
    while not any(m.get("event") == "HistoryChanged" and m["data"]["revision"] == 50 for m in taken):
        await asyncio.sleep(0.005)
        taken += alice.take()
    order = [m.get("event") or m["response"] for m in taken if (m.get("data") or {}).get("revision") != 0]
    assert order.index("HistoryChanged") > order.index("AddActionPoint")
    assert order[-1] == "HistoryChanged"
    assert order.count("HistoryChanged") <= 50
