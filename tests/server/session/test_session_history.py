"""Undo, redo, history: what comes back, what is told of it, and who is refused."""

import asyncio
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.role import Role
from tests.server.machine.picture import Picture
from tests.server.session.desk import Desk, Person, Refused, open_desk
from tests.server.session.work import ORIGIN, URL, Work

TURNED = {"x": 0.0, "y": 0.0, "z": 1.0, "w": 0.0}
ELSEWHERE = {"position": {"x": 0.1, "y": 0.2, "z": 0.3}, "orientation": TURNED}


@pytest.fixture
def work(alice: Person) -> Work:
    return Work(alice)


def shown(desk: Desk) -> dict[str, Any]:
    return Picture.of(desk.session.scene, desk.session.project).shown()


class Watcher:
    """Somebody who sees nothing but the ordinary events, and must know what the server knows."""

    def __init__(self, desk: Desk, person: Person) -> None:
        self.desk, self.person = desk, person
        self.picture = Picture.of(desk.session.scene, desk.session.project)
        person.take()

    def look(self) -> list[str]:
        names = []
        for event in self.person.events():
            names.append("/".join(filter(None, (event["event"], event.get("change_type")))))
            self.picture.see(event)
        assert self.picture.shown() == shown(self.desk)
        return names


async def rich_project(work: Work) -> dict[str, str]:
    """Two objects with points, orientations, joints, actions, logic, a parameter and an override."""
    ask, desk = work.person.ask, work.person.desk
    await work.project()
    ids = {"robot": work.object("robot"), "base": await work.add_point("base", work.object("scale"))}
    ids["below"] = await work.add_point("below", ids["base"])
    ids["free"] = await work.add_point("free")
    ids["ori"] = await work.add_orientation(ids["below"])
    desk.cell.state = SceneStateEnum.STARTED
    await work.person.lock(ids["below"])
    await ask(
        "AddActionPointJointsUsingRobot",
        action_point_id=ids["below"],
        robot_id=ids["robot"],
        name="j",
        end_effector_id="default",
    )
    await ask("WriteUnlock", object_id=ids["below"])
    desk.cell.state = SceneStateEnum.STOPPED
    ids["joints"] = str(desk.session.document.named("joints", "j", ids["below"]))
    ids["one"] = await work.add_action(ids["free"], "one")
    ids["dice"] = await work.add_action(
        ids["free"], "dice", "rnd/random_bool", {"name": "probability", "type": "double", "value": "0.5"},
        flows=[{"type": "default", "outputs": ["face"]}],
    )  # fmt: skip
    await ask("AddLogicItem", start="START", end=ids["dice"])
    condition = {"what": f"{ids['dice']}/default/0", "value": "true"}
    await ask("AddLogicItem", start=ids["dice"], end=ids["one"], condition=condition)
    ids["step"] = desk.session.document.outgoing(ids["dice"])[0].id
    await ask("AddProjectParameter", name="speed", type="integer", value="1")
    ids["speed"] = str(desk.session.document.named("parameter", "speed"))
    await work.person.lock(ids["robot"])
    await ask("AddOverride", id=ids["robot"], override=URL)
    await ask("WriteUnlock", object_id=ids["robot"])
    work.person.take()
    return ids


Edit = tuple[str, dict[str, Any], str, bool]
"""A request, its arguments ("@x" stands for an id), what has to be locked for it, and whether as a tree."""

EDITS: dict[str, Edit] = {
    "AddActionPoint": ("AddActionPoint", {"name": "new", "position": ORIGIN, "parent": "@below"}, "", False),
    "RenameActionPoint": ("RenameActionPoint", {"action_point_id": "@base", "new_name": "other"}, "@base", False),
    "UpdateActionPointPosition": (
        "UpdateActionPointPosition",
        {"action_point_id": "@base", "new_position": {"x": 1.0, "y": 2.0, "z": 3.0}},
        "@base",
        True,
    ),
    "UpdateActionPointParent": (
        "UpdateActionPointParent",
        {"action_point_id": "@base", "new_parent_id": "@free"},
        "@base",
        False,
    ),
    "CopyActionPoint": ("CopyActionPoint", {"id": "@base"}, "", False),
    "RemoveActionPoint": ("RemoveActionPoint", {"id": "@below"}, "", False),
    "AddActionPointOrientation": (
        "AddActionPointOrientation",
        {"action_point_id": "@free", "orientation": TURNED, "name": "o"},
        "@free",
        False,
    ),
    "UpdateActionPointOrientation": (
        "UpdateActionPointOrientation",
        {"orientation_id": "@ori", "orientation": TURNED},
        "@ori",
        False,
    ),
    "RenameActionPointOrientation": (
        "RenameActionPointOrientation",
        {"orientation_id": "@ori", "new_name": "other"},
        "@ori",
        False,
    ),
    "RemoveActionPointOrientation": ("RemoveActionPointOrientation", {"orientation_id": "@ori"}, "", False),
    "UpdateActionPointJoints": (
        "UpdateActionPointJoints",
        {"joints_id": "@joints", "joints": [{"name": "j1", "value": 1.0}, {"name": "j2", "value": 2.0}]},
        "@below",
        False,
    ),
    "RenameActionPointJoints": (
        "RenameActionPointJoints",
        {"joints_id": "@joints", "new_name": "other"},
        "@below",
        False,
    ),
    "RemoveActionPointJoints": ("RemoveActionPointJoints", {"joints_id": "@joints"}, "@below", False),
    "UpdateAction": (
        "UpdateAction",
        {"action_id": "@one", "parameters": [{"name": "seconds", "type": "double", "value": "2.5"}]},
        "@one",
        False,
    ),
    "RenameAction": ("RenameAction", {"action_id": "@one", "new_name": "other"}, "@one", False),
    "AddLogicItem": ("AddLogicItem", {"start": "@one", "end": "END"}, "", False),
    "RemoveLogicItem": ("RemoveLogicItem", {"logic_item_id": "@step"}, "", False),
    "UpdateLogicItem": ("UpdateLogicItem", {"logic_item_id": "@step", "start": "@dice", "end": "END"}, "", False),
    "UpdateProjectHasLogic": ("UpdateProjectHasLogic", {"project_id": "@project", "new_has_logic": False}, "", False),
    "UpdateProjectDescription": (
        "UpdateProjectDescription",
        {"project_id": "@project", "new_description": "other"},
        "",
        False,
    ),
    "RenameProject": ("RenameProject", {"project_id": "@project", "new_name": "other"}, "@project", False),
    "AddProjectParameter": ("AddProjectParameter", {"name": "x", "type": "double", "value": "0.5"}, "", False),
    "UpdateProjectParameter": ("UpdateProjectParameter", {"id": "@speed", "name": "v", "value": "7"}, "@speed", False),
    "RemoveProjectParameter": ("RemoveProjectParameter", {"id": "@speed"}, "", False),
    "UpdateOverride": ("UpdateOverride", {"id": "@robot", "override": URL | {"value": '"x"'}}, "@robot", False),
    "DeleteOverride": ("DeleteOverride", {"id": "@robot", "override": URL}, "@robot", False),
}


def filled(value: Any, ids: dict[str, str]) -> Any:
    if isinstance(value, str) and value.startswith("@"):
        return ids[value[1:]]
    if isinstance(value, dict):
        return {key: filled(inner, ids) for key, inner in value.items()}
    return value


async def make(person: Person, edit: Edit, ids: dict[str, str]) -> None:
    request, args, lock, tree = edit
    if lock:
        await person.lock(filled(lock, ids), tree=tree)
    await person.ask(request, **filled(args, ids))
    if lock and person.desk.services.locks.written_by("alice"):
        await person.ask("WriteUnlock", object_id=filled(lock, ids))


async def test_every_edit_of_a_project_comes_back(desk: Desk, alice: Person, bob: Person, work: Work) -> None:
    ids = await rich_project(work)
    ids["project"] = desk.session.require_project().id
    await alice.ask("SaveProject")
    saved, watcher = shown(desk), Watcher(desk, bob)
    for name, edit in EDITS.items():
        await make(alice, edit, ids)
        after = shown(desk)
        assert after != saved, name
        watcher.look()
        assert desk.session.has_changes
        alice.take()
        answer = await alice.ask("Undo")
        assert answer["request"] == name
        assert answer["revision"] == desk.session.revision
        first, *events = alice.take()
        assert "response" in first  # the answer comes first
        assert events, name
        assert not [event for event in events if "Locked" in event["event"]]
        watcher.look()
        assert shown(desk) == saved, name
        assert not desk.session.has_changes, name
        assert (await alice.ask("Redo"))["request"] == name
        watcher.look()
        assert shown(desk) == after, name
        assert desk.session.has_changes
        await alice.ask("Undo")
        watcher.look()
        assert shown(desk) == saved, name
        assert desk.services.locks.locked_roots() == [], name


async def test_all_edits_go_and_come_in_one_row(desk: Desk, alice: Person, bob: Person, work: Work) -> None:
    await work.project()
    watcher, states = Watcher(desk, bob), [shown(desk)]
    numbered = desk.session.revision
    ids = {"a": await work.add_point("a")}
    states.append(shown(desk))
    ids["b"] = await work.add_point("b", ids["a"])
    states.append(shown(desk))
    await work.add_action(ids["b"], "act")
    states.append(shown(desk))
    await alice.ask("AddLogicItem", start="START", end=work.action("act").id)
    states.append(shown(desk))
    for state in reversed(states[:-1]):
        await alice.ask("Undo")
        watcher.look()
        assert shown(desk) == state
    with pytest.raises(Refused, match="nothing"):
        await alice.ask("Undo")
    for state in states[1:]:
        await alice.ask("Redo")
        watcher.look()
        assert shown(desk) == state
    with pytest.raises(Refused, match="nothing"):
        await alice.ask("Redo")
    await alice.ask("RestoreRevision", revision=numbered)
    watcher.look()
    assert shown(desk) == states[0]
    await alice.ask("Undo")
    watcher.look()
    assert shown(desk) == states[-1]


async def test_every_edit_of_a_scene_comes_back(desk: Desk, alice: Person, bob: Person, work: Work) -> None:
    scene = await work.scene()
    robot = work.object("robot")
    saved, watcher = shown(desk), Watcher(desk, bob)
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
        await make(alice, edit, ids)
        watcher.look()
        assert desk.session.has_changes
        assert (await alice.ask("Undo"))["request"] == edit[0]
        watcher.look()
        assert shown(desk) == saved, edit[0]
        assert not desk.session.has_changes
    await alice.ask("CloseScene")


async def test_undo_while_online_moves_the_live_object_but_no_robot(desk: Desk, alice: Person, work: Work) -> None:
    await work.scene()
    scale, robot = work.object("scale"), work.object("robot")
    for obj in (robot, scale):
        await alice.lock(obj)
        await alice.ask("UpdateObjectPose", object_id=obj, pose=ELSEWHERE)
    await alice.ask("AddObjectToScene", name="other", type="TimeActions")
    desk.cell.state = SceneStateEnum.STARTED
    with pytest.raises(Refused, match="online"):
        await alice.ask("Undo")
    number = desk.session.revision - 1
    await alice.ask("Undo", dry_run=True, number=number)
    assert desk.cell.moved == []
    await alice.ask("Undo", number=number)
    assert [obj for obj, _ in desk.cell.moved] == [scale]
    assert desk.session.scene_object(scale).pose == desk.cell.moved[0][1]
    with pytest.raises(Refused, match="robot"):
        await alice.ask("Undo", number=number - 1)
    desk.cell.state = SceneStateEnum.STOPPED
    await alice.ask("Undo")
    await alice.ask("Undo")
    assert not desk.session.has_changes


# ------------------------------------------------------------------------------------------------ two users
async def test_only_ones_own_edits_are_taken_back(desk: Desk, alice: Person, bob: Person, work: Work) -> None:
    await work.project("a", "b")
    a, b = work.point("a"), work.point("b")
    await make(alice, ("RenameActionPoint", {"action_point_id": a, "new_name": "a2"}, a, False), {})
    await bob.lock(b)
    await bob.ask("RenameActionPoint", action_point_id=b, new_name="b2")
    await alice.ask("Undo")
    assert {work.point("a"), work.point("b2")} == {a, b}
    await bob.ask("Undo")
    assert {work.point("a"), work.point("b")} == {a, b}
    # What others do meanwhile does not end what one can redo; what one does oneself ends it.
    await bob.ask("AddActionPoint", name="c", position=ORIGIN)
    await alice.ask("Redo")
    assert work.point("a2") == a
    await alice.ask("Undo")
    await alice.ask("AddActionPoint", name="d", position=ORIGIN)
    with pytest.raises(Refused, match="nothing"):
        await alice.ask("Redo")
    with pytest.raises(Refused, match="bob"):
        await alice.ask("Undo", number=desk.session.revision - 3)


async def refused(person: Person, request: str = "Undo", **args: Any) -> str:
    session = person.desk.session
    before, revision = session.project, session.revision
    person.take()
    with pytest.raises(Refused) as error:
        await person.ask(request, **args)
    assert person.events() == []
    assert (session.project, session.revision) == (before, revision)
    return str(error.value)


async def test_refused_naming_who_changed_it_since(alice: Person, bob: Person, work: Work) -> None:
    await work.project("p")
    p = work.point("p")
    await make(alice, ("RenameActionPoint", {"action_point_id": p, "new_name": "q"}, p, False), {})
    await bob.lock(p, tree=True)
    await bob.ask("UpdateActionPointPosition", action_point_id=p, new_position={"x": 9.0, "y": 0.0, "z": 0.0})
    await bob.ask("WriteUnlock", object_id=p)
    assert "bob" in (text := await refused(alice))
    assert "UpdateActionPointPosition" in text
    # Once that is taken back too, nothing stands against it.
    await bob.ask("Undo")
    await alice.ask("Undo")
    assert work.point("p") == p


async def test_refused_where_others_build_on_it(desk: Desk, alice: Person, bob: Person, work: Work) -> None:
    await work.project()
    builder = Work(bob)
    p = await work.add_point("p")
    below = await builder.add_point("below", p)
    assert "bob" in await refused(alice)
    await bob.ask("RemoveActionPoint", id=below)
    action = await builder.add_action(p, "act")
    assert "bob" in await refused(alice)
    await bob.ask("RemoveAction", id=action)
    await alice.ask("Undo")
    # A name that was taken meanwhile.
    await builder.add_point("p")
    assert "bob" in await refused(alice, "Redo")
    await bob.ask("Undo")
    await alice.ask("Redo")
    # A step to an action, a result that is used.
    one = await work.add_action(p, "one")
    await bob.ask("AddLogicItem", start="START", end=one)
    assert "bob" in await refused(alice)
    await alice.lock(one)
    await alice.ask("WriteUnlock", object_id=one)
    await bob.ask("Undo")
    await alice.ask("Undo")
    # The parent is gone.
    await bob.ask("RemoveActionPoint", id=p)
    assert "bob" in await refused(alice, "Redo")


async def test_refused_where_the_logic_would_not_hold(desk: Desk, alice: Person, bob: Person, work: Work) -> None:
    await work.project("p")
    p = work.point("p")
    a, b, c = [await work.add_action(p, name) for name in ("a", "b", "c")]
    await alice.ask("AddLogicItem", start=a, end=b)
    await alice.ask("RemoveLogicItem", logic_item_id=desk.session.document.outgoing(a)[0].id)
    await bob.ask("AddLogicItem", start=b, end=c)
    await bob.ask("AddLogicItem", start=c, end=a)
    text = await refused(alice)
    assert "loop" in text
    assert "bob" in text
    await bob.ask("Undo")
    await bob.ask("AddLogicItem", start=a, end=c)
    text = await refused(alice)
    assert "condition" in text
    assert "bob" in text
    await bob.ask("UpdateProjectHasLogic", project_id=desk.session.require_project().id, new_has_logic=False)
    assert "bob" in await refused(alice)


async def test_refused_while_others_hold_locks(desk: Desk, alice: Person, bob: Person, work: Work) -> None:
    await work.project("p")
    p = work.point("p")
    below = await work.add_point("below", p)
    await make(alice, ("RenameActionPoint", {"action_point_id": p, "new_name": "q"}, p, False), {})
    await bob.lock(p)
    assert "bob" in await refused(alice)
    await bob.ask("WriteUnlock", object_id=p)
    # A new name moves nothing: what hangs on the point may be locked. A move takes it along.
    await bob.lock(below)
    await alice.ask("Undo")
    await bob.ask("WriteUnlock", object_id=below)
    await alice.lock(p, tree=True)
    await alice.ask("UpdateActionPointPosition", action_point_id=p, new_position={"x": 1.0, "y": 0.0, "z": 0.0})
    await alice.ask("WriteUnlock", object_id=p)
    await bob.lock(below)
    assert "bob" in await refused(alice)
    assert "bob" in await refused(alice, "RestoreRevision", revision=desk.session.revision - 1)
    await bob.ask("WriteUnlock", object_id=below)
    await bob.ask("ReadLock", object_id=below)
    assert "bob" in await refused(alice)
    await bob.ask("ReadUnlock", object_id=below)
    # Ones own locks are no hindrance, and stay.
    await alice.lock(p, tree=True)
    await alice.ask("Undo")
    assert desk.services.locks.written_by("alice") == [p]
    await alice.ask("WriteUnlock", object_id=p)
    assert desk.services.locks.locked_roots() == []


async def test_locks_follow_what_goes_and_what_hangs_elsewhere(
    desk: Desk, alice: Person, bob: Person, work: Work
) -> None:
    await work.project("a", "b")
    a, b = work.point("a"), work.point("b")
    await make(
        alice, ("UpdateActionPointParent", {"action_point_id": a, "new_parent_id": b}, a, False), {}
    )  # fmt: skip
    await alice.lock(a)
    await alice.ask("Undo")
    await bob.lock(b, tree=True)  # what was below it is not any more
    with pytest.raises(Refused, match="alice"):
        await bob.ask("WriteLock", object_id=a)
    await bob.ask("WriteUnlock", object_id=b)
    p = await work.add_point("p")
    await alice.lock(p)
    await alice.ask("Undo")
    assert desk.services.locks.written_by("alice") == [a]
    await alice.ask("WriteUnlock", object_id=a)
    await alice.ask("SaveProject")


async def test_two_undos_at_once_take_back_two_edits(desk: Desk, alice: Person, work: Work) -> None:
    await work.project("p")
    p = work.point("p")
    for name in ("q", "r", "s"):
        await make(alice, ("RenameActionPoint", {"action_point_id": p, "new_name": name}, p, False), {})
    answers = await asyncio.gather(alice.ask("Undo"), alice.ask("Undo"))
    assert answers[0]["number"] == answers[1]["number"] + 1
    assert work.point("q") == p


async def test_who_is_not_logged_in_is_refused(alice: Person, stranger: Person, work: Work) -> None:
    with pytest.raises(Refused, match="open"):
        await alice.ask("Undo")
    await work.project("p")
    for request, args in (("Undo", {}), ("Redo", {}), ("RestoreRevision", {"revision": 0})):
        with pytest.raises(Refused, match="logged in"):
            await stranger.ask(request, **args)
    assert (await stranger.ask("History"))["revision"] == 1


async def test_taking_back_needs_the_role_of_the_edit(desk: Desk, alice: Person, bob: Person, work: Work) -> None:
    await work.project("p")
    await alice.ask("AddProjectParameter", name="x", type="double", value="0.5")
    (client,) = [client for client in desk.services.hub.clients if client.user == "alice"]
    client.role = Role.STANDARD_USER
    assert "advanced user" in (await refused(alice)).replace("_", " ")
    assert "advanced user" in (await refused(alice, "RestoreRevision", revision=0)).replace("_", " ")
    await alice.ask("Undo", number=desk.session.revision - 1)


# ------------------------------------------------------------------------------------------------ history
async def test_history_tells_who_did_what(desk: Desk, alice: Person, bob: Person, work: Work) -> None:
    await work.project("p")
    p = work.point("p")
    await bob.ask("AddActionPoint", name="b", position=ORIGIN)
    await make(alice, ("RenameActionPoint", {"action_point_id": p, "new_name": "q"}, p, False), {})
    await alice.ask("Undo")
    told = await alice.ask("History")
    assert (told["revision"], told["oldest"], told["undo"], told["redo"]) == (4, 0, 1, 4)
    rows = [(e["number"], e["user"], e["request"], e["how"], e.get("of"), e["in_force"]) for e in told["edits"]]
    assert rows == [
        (4, "alice", "RenameActionPoint", "undo", 3, True),
        (3, "alice", "RenameActionPoint", "edit", None, False),
        (2, "bob", "AddActionPoint", "edit", None, True),
        (1, "alice", "AddActionPoint", "edit", None, True),
    ]
    assert told["edits"][1]["items"] == [{"kind": "action_point", "id": p, "name": "q", "change": "update"}]
    assert told["edits"][3]["items"][0]["change"] == "add"
    told = await bob.ask("History", limit=1, before=3)
    assert ([e["number"] for e in told["edits"]], told["undo"]) == ([2], 2)
    assert "redo" not in told
    with pytest.raises(Refused, match="wrong"):
        await bob.ask("History", limit=1001)


async def test_a_revision_comes_back_whoever_changed_it(desk: Desk, alice: Person, bob: Person, work: Work) -> None:
    ids = await rich_project(work)
    ids["project"] = desk.session.require_project().id
    await alice.ask("SaveProject")
    saved, revision, watcher = shown(desk), desk.session.revision, Watcher(desk, bob)
    for name in ("AddActionPoint", "UpdateActionPointParent", "RemoveLogicItem", "DeleteOverride", "RenameAction"):
        await make(alice, EDITS[name], ids)
    await Work(bob).add_action(ids["base"], "bobs")
    after = shown(desk)
    watcher.look()
    assert await alice.ask("RestoreRevision", dry_run=True, revision=revision) == {"revision": desk.session.revision}
    assert shown(desk) == after
    answer = await alice.ask("RestoreRevision", revision=revision)
    assert answer == {"revision": desk.session.revision}
    watcher.look()
    assert shown(desk) == saved
    assert not desk.session.has_changes
    assert (await alice.ask("History", limit=1))["edits"][0]["of"] == revision
    assert "nothing" not in await refused(alice, "RestoreRevision", revision=revision)
    await alice.ask("Undo")
    watcher.look()
    assert shown(desk) == after
    for wrong in (-1, desk.session.revision + 1):
        assert "can be restored" in await refused(alice, "RestoreRevision", revision=wrong)


async def test_undo_goes_on_after_saving_and_after_a_restart(tmp_path: Path) -> None:
    async with open_desk(tmp_path) as desk:
        alice = await desk.person("alice")
        work = Work(alice)
        await work.project("a", "b")
        await alice.ask("SaveProject")
        await work.add_point("c")
        await alice.ask("Undo")
        assert not desk.session.has_changes
        history = list(desk.session.history)
    async with open_desk(tmp_path) as desk:
        alice, bob = await desk.person("alice"), await desk.person("bob")
        assert list(desk.session.history) == history
        assert not desk.session.has_changes
        told = await alice.ask("History")
        assert (told["undo"], told["redo"]) == (2, 4)
        assert "undo" not in await bob.ask("History")
        await alice.ask("Redo")
        assert desk.session.has_changes
        await alice.ask("Undo")
        await alice.ask("Undo")
        assert [point.name for point in desk.session.require_project().action_points] == ["a"]
        assert desk.session.has_changes
    async with open_desk(tmp_path) as desk:
        assert desk.session.has_changes
        alice = await desk.person("alice")
        await alice.ask("Redo")
        assert not desk.session.has_changes
        await alice.ask("CloseProject")


async def test_what_was_changed_and_changed_back_counts_as_saved_after_a_restart(tmp_path: Path) -> None:
    async with open_desk(tmp_path, history_limit=4) as desk:
        alice = await desk.person("alice")
        await Work(alice).project("p")
        await alice.ask("SaveProject")
        await Work(alice).add_point("q")
        for _ in range(4):  # the journal begins anew at a document that is not the saved one
            await alice.ask("Undo")
            await alice.ask("Redo")
    async with open_desk(tmp_path, history_limit=4) as desk:
        assert desk.session.has_changes
        alice = await desk.person("alice")
        await alice.ask("Undo")
        assert not desk.session.has_changes


async def test_the_limit_bounds_what_can_be_taken_back(tmp_path: Path) -> None:
    async with open_desk(tmp_path, history_limit=5) as desk:
        alice = await desk.person("alice")
        work = Work(alice)
        await work.project(*(f"p{number}" for number in range(8)))
        told = await alice.ask("History")
        assert (told["revision"], told["oldest"], len(told["edits"])) == (8, 3, 5)
        assert "can be restored" in await refused(alice, "RestoreRevision", revision=2)
        for _ in range(3):
            await alice.ask("Undo")
        # Each undo is an edit too: two of the five that are kept are still to be undone, until they drop out.
        while "undo" in await alice.ask("History"):
            await alice.ask("Undo")
        assert len(desk.session.history) == 5
        assert "nothing" in await refused(alice)


async def test_a_journal_of_the_first_format_is_taken_over(tmp_path: Path) -> None:
    async with open_desk(tmp_path) as desk:
        await Work(await desk.person("alice")).project("p")
    connection = sqlite3.connect(tmp_path / "journal.sqlite")
    for column in ("request", "how", "target"):
        connection.execute(f"alter table edit drop column {column}")
    connection.execute("pragma user_version = 1")
    connection.commit()
    connection.close()
    async with open_desk(tmp_path) as desk:
        alice = await desk.person("alice")
        assert [point.name for point in desk.session.require_project().action_points] == ["p"]
        await alice.ask("Undo")
        assert not desk.session.require_project().action_points


async def test_an_undo_that_cannot_be_kept_is_taken_back(
    desk: Desk, alice: Person, work: Work, monkeypatch: pytest.MonkeyPatch
) -> None:
    from arcor2_server.session import journal as journal_module

    await work.project("p")
    await alice.ask("SaveProject")
    before, told = shown(desk), await alice.ask("History")

    def full(connection: sqlite3.Connection, job: object) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(journal_module, "_write", full)
        assert "disk is full" in await refused(alice)
    assert shown(desk) == before
    assert not desk.session.has_changes
    assert await alice.ask("History") == told
    await alice.ask("Undo")
    assert desk.session.has_changes


async def test_a_save_that_fails_leaves_what_is_unsaved(
    desk: Desk, alice: Person, work: Work, monkeypatch: pytest.MonkeyPatch
) -> None:
    from arcor2_hw.exceptions import StorageError

    await work.project("p")
    await alice.ask("SaveProject")
    await work.add_point("q")

    async def failing(project: Any) -> Any:
        raise StorageError("no")

    with monkeypatch.context() as patch:
        patch.setattr(desk.services.storage, "put_project", failing)
        with pytest.raises(Refused):
            await alice.ask("SaveProject")
    assert desk.session.has_changes
    await alice.ask("Undo")
    assert not desk.session.has_changes


async def test_existing_clients_learn_of_the_requests(alice: Person) -> None:
    told = await alice.ask("SystemInfo")
    assert {"Undo", "Redo", "History", "RestoreRevision"} <= set(told["supported_rpc_requests"])
