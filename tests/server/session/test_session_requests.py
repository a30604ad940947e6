"""Editing requests as clients see them: answers, order of events, locks of two users, dry runs."""

import asyncio
from typing import Any

import msgspec
import pytest

from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.object_type import ObjectTypeMeta
from tests.server.session.session_server import Person, Refused, SessionServer
from tests.server.session.work import NO_RESULTS, ORIGIN, POSE, SECONDS, UPRIGHT, Work


@pytest.fixture
def work(alice: Person) -> Work:
    return Work(alice)


# ------------------------------------------------------------------------------------------------ order of events
async def test_order_of_events_when_documents_open_and_close(server: SessionServer, alice: Person, bob: Person) -> None:
    server.types.pending = [ObjectTypeMeta("NewType"), ObjectTypeMeta("OtherType")]
    await alice.ask("NewScene", name="scene")
    bob_sees = bob.take()
    assert [e["event"] for e in bob_sees] == ["ChangedObjectTypes", "OpenScene", "SceneState"]
    assert {meta["type"] for meta in bob_sees[0]["data"]} == {"NewType", "OtherType"}
    await alice.ask("AddObjectToScene", name="time", type="TimeActions")
    scene = server.session.require_scene()
    alice.take()
    await alice.ask("NewProject", scene_id=scene.id, name="project")
    assert alice.names() == ["SceneSaved", "OpenProject", "SceneState"]
    assert [e.event for e in server.session.greeting(server.cell.state)] == ["OpenProject", "SceneState"]
    await alice.ask("SaveProject")
    assert alice.names() == ["ProjectSaved"]
    with pytest.raises(Refused, match="no changes"):
        await alice.ask("SaveProject")
    assert alice.names() == []
    await alice.ask("CloseProject")
    events = alice.events()
    assert [e["event"] for e in events] == ["ProjectClosed", "ShowMainScreen"]
    assert events[1]["data"]["what"] == "ProjectsList"
    assert server.services.hub.main_screen.data.what == "ProjectsList"
    await alice.ask("OpenScene", id=scene.id)
    assert alice.names() == ["OpenScene", "SceneState"]
    await alice.ask("CloseScene")
    assert alice.names() == ["SceneClosed", "ShowMainScreen"]


async def test_an_error_exit_survives_a_client_that_does_not_know_it(work: Work, alice: Person) -> None:
    await work.project("p")
    one = await work.add_action(work.point("p"), "one", error_output="problem")
    two = await work.add_action(work.point("p"), "two")
    await alice.ask("AddLogicItem", start=one, end="END")
    alice.take()
    await alice.ask("AddLogicItem", start=one, end=two, error_kinds=["refused"])
    [_, changed, *_] = alice.take()
    item = changed["data"]
    assert item["error_kinds"] == ["refused"]
    await alice.ask("UpdateLogicItem", logic_item_id=item["id"], start=one, end="END")
    assert work.session.document.logic_item(item["id"]).error_kinds == ["refused"]
    await alice.lock(one)
    await alice.ask("UpdateAction", action_id=one, flows=[{"type": "default", "outputs": []}])
    assert work.action("one").error_output == "problem"
    with pytest.raises(Refused, match="one names a result problem already"):
        await work.add_action(work.point("p"), "three", error_output="problem")
    with pytest.raises(Refused, match="cannot name an error"):
        await alice.ask("UpdateAction", action_id=one, error_output="no name")
    await alice.ask("UpdateAction", action_id=one, error_output="")
    assert "error_output" not in msgspec.to_builtins(work.action("one"))
    with pytest.raises(Refused, match="one leads to END already"):
        await alice.ask("UpdateLogicItem", logic_item_id=item["id"], start=one, end="END", error_kinds=[])


async def test_comparisons_survive_a_client_that_does_not_know_them(work: Work, alice: Person) -> None:
    await work.project("p")
    one = await work.add_action(work.point("p"), "one")
    two = await work.add_action(work.point("p"), "two")
    await alice.ask("AddProjectParameter", name="limit", type="integer", value="3")
    limit = next(one for one in work.session.project.parameters if one.name == "limit")
    await alice.ask("AddProjectParameter", name="other", type="integer", value="4")
    other = next(one for one in work.session.project.parameters if one.name == "other")
    ranged = {"what": limit.id, "operator": "[)", "value": "3", "upper": "7"}
    when = {
        "match": "any",
        "comparisons": [ranged, {"what": other.id, "operator": ">", "value": "", "other": limit.id}],
    }
    alice.take()
    await alice.ask("AddLogicItem", start=one, end=two, when=when)
    [_, changed, *_] = alice.take()
    item = changed["data"]
    assert item["when"] == when
    assert "condition" not in item
    await alice.ask("UpdateLogicItem", logic_item_id=item["id"], start=one, end="END")
    assert msgspec.to_builtins(work.session.document.logic_item(item["id"]).when) == when
    with pytest.raises(Refused, match="A condition uses the project parameter limit"):
        await alice.ask("RemoveProjectParameter", id=limit.id)
    less = {"comparisons": [{"what": limit.id, "operator": "<", "value": "true"}]}
    with pytest.raises(Refused, match="cannot be compared with True"):
        await alice.ask("UpdateLogicItem", logic_item_id=item["id"], start=one, end="END", when=less)
    await alice.ask("UpdateLogicItem", logic_item_id=item["id"], start=one, end="END", when={"comparisons": []})
    assert "when" not in msgspec.to_builtins(work.session.document.logic_item(item["id"]))
    await alice.ask("RemoveProjectParameter", id=limit.id)


async def test_actions_store_results_in_a_variable(work: Work, alice: Person, bob: Person) -> None:
    await work.project("p")
    await alice.ask("AddProjectParameter", name="last", type="double", value="0.0", variable=True)
    last = next(one for one in work.session.project.parameters if one.name == "last")
    assert last.variable is True
    stored = [{"type": "default", "outputs": ["last"]}]
    rnd = work.object("rnd")
    half = {"name": "probability", "type": "double", "value": "0.5"}
    one = await work.add_action(work.point("p"), "one", type=f"{rnd}/random_double", parameters=[], flows=stored)
    await work.add_action(work.point("p"), "two", type=f"{rnd}/random_double", parameters=[], flows=stored)
    with pytest.raises(Refused, match="three: the variable last is double, the result is boolean"):
        await work.add_action(work.point("p"), "three", type=f"{rnd}/random_bool", parameters=[half], flows=stored)
    await alice.ask("AddLogicItem", start="START", end=one)
    with pytest.raises(Refused, match="one stores its result in the variable last: use the variable"):
        await alice.ask("AddLogicItem", start=one, end="END", condition={"what": f"{one}/default/0", "value": "3"})
    with pytest.raises(Refused, match="The action one stores a result in the variable last"):
        await alice.ask("RemoveProjectParameter", id=last.id)
    await alice.lock(last.id)
    await bob.lock(work.action("two").id)
    with pytest.raises(Refused, match="bob"):
        await alice.ask("UpdateProjectParameter", id=last.id, name="newest")
    assert work.action("one").outputs() == ["last"]
    await bob.ask("WriteUnlock", object_id=work.action("two").id)
    await alice.ask("UpdateProjectParameter", id=last.id, name="newest")
    assert [work.action(name).outputs() for name in ("one", "two")] == [["newest"], ["newest"]]
    await alice.ask("Undo")
    assert [work.action(name).outputs() for name in ("one", "two")] == [["last"], ["last"]]
    await alice.lock(one)
    await alice.ask("UpdateAction", action_id=one, flows=[{"type": "default", "outputs": ["n"]}])
    with pytest.raises(Refused, match="one names a result n already"):
        await alice.ask("AddProjectParameter", name="n", type="integer", value="0", variable=True)
    when = {"comparisons": [{"what": f"{one}/default/0", "operator": ">", "value": "3"}]}
    await alice.ask("AddLogicItem", start=one, end="END", when=when)
    with pytest.raises(Refused, match="A condition of the logic uses a result of one"):
        await alice.ask("UpdateAction", action_id=one, flows=stored)


async def test_a_retry_needs_an_action_that_is_safe_to_repeat(work: Work, alice: Person) -> None:
    await work.project("p")
    with pytest.raises(Refused, match="one: sleep cannot be retried, because repeating it may do harm"):
        await work.add_action(work.point("p"), "one", retry={"count": 3})
    read = {"type": f"{work.object('rnd')}/random_double", "parameters": []}
    with pytest.raises(Refused, match="two: a retry has a count from 1 to 100"):
        await work.add_action(work.point("p"), "two", **read, retry={"count": -1, "pause": 0.5})
    two = await work.add_action(work.point("p"), "two", **read, retry={"count": 3, "pause": 0.5})
    await alice.lock(two)
    await alice.ask("UpdateAction", action_id=two, flows=[{"type": "default", "outputs": []}])
    assert msgspec.to_builtins(work.action("two").retry) == {"count": 3, "pause": 0.5}
    await alice.ask("UpdateAction", action_id=two, retry={"count": 0})
    assert "retry" not in msgspec.to_builtins(work.action("two"))


async def test_logic_items_always_announce_unlocking(work: Work, alice: Person, bob: Person) -> None:
    await work.project("p")
    one = await work.add_action(work.point("p"), "one")
    two = await work.add_action(work.point("p"), "two")
    bob.take()
    await alice.ask("AddLogicItem", start="START", end=one)
    events = bob.events()
    assert [e["event"] for e in events] == ["LogicItemChanged", "ObjectsUnlocked"]
    assert events[1]["data"] == {"object_ids": [], "owner": "alice"}
    await alice.lock(one)
    await alice.ask("AddLogicItem", start=one, end=two)
    events = alice.take()
    assert [e.get("event") for e in events] == [None, "LogicItemChanged", "ObjectsUnlocked"]
    assert events[2]["data"]["object_ids"] == [one]
    assert work.services.locks.announced() == {}
    item = events[1]["data"]["id"]
    with pytest.raises(Refused, match="part of the logic"):
        await alice.ask("RemoveAction", id=two)
    alice.take()
    await alice.ask("RemoveLogicItem", logic_item_id=item)
    assert alice.names() == ["LogicItemChanged/remove", "ObjectsUnlocked"]
    await alice.ask("UpdateProjectHasLogic", project_id=work.session.require_project().id, new_has_logic=False)
    assert alice.names() == ["ProjectChanged/update_base"]
    assert work.session.require_project().logic == []
    with pytest.raises(Refused, match="script instead of logic"):
        await alice.ask("AddLogicItem", start="START", end=one)


async def test_an_action_and_its_connections_are_removed_by_one_edit(
    server: SessionServer, work: Work, alice: Person, bob: Person
) -> None:
    await work.project("p")
    point = work.point("p")
    one, two, three = [await work.add_action(point, name) for name in ("one", "two", "three")]
    for start, end in (("START", one), (one, two), (two, three), (three, "END")):
        await alice.ask("AddLogicItem", start=start, end=end)
    steps = {(item.start, item.end): item.id for item in server.session.require_project().logic}
    bob.take()
    edits = len(server.session.history)
    await bob.lock(one)
    with pytest.raises(Refused, match="bob"):
        await alice.ask("RemoveAction", id=two, with_steps=True)
    await bob.ask("WriteUnlock", object_id=one)
    bob.take()
    await alice.ask("RemoveAction", id=two, with_steps=True, dry_run=True)
    assert len(server.session.history) == edits
    await alice.ask("RemoveAction", id=two, with_steps=True)
    # The connections that led to it lead to its successor; the connection after it is removed.
    assert bob.names() == ["LogicItemChanged/remove", "LogicItemChanged/update", "ActionChanged/remove"]
    logic = {item.id: (item.start, item.end) for item in server.session.require_project().logic}
    assert logic[steps[one, two]] == (one, three)
    assert steps[two, three] not in logic
    assert len(server.session.history) == edits + 1
    await alice.ask("Undo")
    assert {(item.start, item.end): item.id for item in server.session.require_project().logic} == steps
    await alice.ask("Redo")
    assert {item.id: (item.start, item.end) for item in server.session.require_project().logic} == logic
    # The last one: no connection may lead straight from START to END.
    await alice.ask("RemoveAction", id=one, with_steps=True)
    await alice.ask("RemoveAction", id=three, with_steps=True)
    assert server.session.require_project().logic == []


async def test_an_action_whose_result_is_used_is_not_removed(server: SessionServer, work: Work, alice: Person) -> None:
    await work.project("p")
    point = work.point("p")
    flows = [{"type": "default", "outputs": ["lucky"]}]
    half = {"name": "probability", "type": "double", "value": "0.5"}
    first = await work.add_action(point, "first", "rnd/random_bool", half, flows=flows)
    other = await work.add_action(point, "other")
    await alice.ask("AddLogicItem", start=first, end=other)
    await alice.ask("AddLogicItem", start=other, end="END", condition={"what": f"{first}/default/0", "value": "true"})
    before = server.session.require_project().logic
    with pytest.raises(Refused, match="condition of the logic"):
        await alice.ask("RemoveAction", id=first, with_steps=True)
    assert server.session.require_project().logic == before


async def test_a_second_change_to_the_same_parent_changes_nothing(work: Work, alice: Person) -> None:
    await work.project("a", "b")
    a, b = work.point("a"), work.point("b")
    await alice.lock(a)
    await alice.ask("UpdateActionPointParent", action_point_id=a, new_parent_id=b)
    assert alice.names() == ["ActionPointChanged/update", "ObjectsUnlocked"]
    await alice.ask("UpdateActionPointParent", action_point_id=a, new_parent_id=b)
    assert [m.get("result") for m in alice.take()] == [True]
    with pytest.raises(Refused, match="does not hold"):
        await alice.ask("UpdateActionPointParent", action_point_id=a, new_parent_id="")
    assert work.session.root_of(a) == b
    with pytest.raises(Refused, match="ancestor"):
        await alice.ask("UpdateActionPointParent", action_point_id=b, new_parent_id=a)


async def test_moving_a_point_needs_its_tree_and_makes_joints_invalid(
    server: SessionServer, work: Work, alice: Person
) -> None:
    await work.project()
    server.cell.state = SceneStateEnum.STARTED
    await alice.ask("AddApUsingRobot", robot_id=work.object("robot"), end_effector_id="default", name="taught")
    assert alice.names() == ["ActionPointChanged/add", "OrientationChanged/add", "JointsChanged/add"]
    point = work.point("taught")
    await alice.lock(point)
    move = {"action_point_id": point, "new_position": {"x": 1.0, "y": 0.0, "z": 0.0}}
    with pytest.raises(Refused):
        await alice.ask("UpdateActionPointPosition", **move)
    await alice.ask("UpdateActionPointPosition", dry_run=True, **move)
    await alice.ask("UpdateLock", object_id=point, new_type="TREE")
    alice.take()
    for expected in (["JointsChanged/update", "ActionPointChanged/update_base"], ["ActionPointChanged/update_base"]):
        await alice.ask("UpdateActionPointPosition", **move)
        events = alice.events()
        assert ["/".join((e["event"], e["change_type"])) for e in events] == expected
        assert [e.get("parent_id") for e in events] == [point if "Joints" in e["event"] else None for e in events]
    joints = work.session.require_project().action_points[0].robot_joints[0]
    assert not joints.is_valid
    await alice.ask("UpdateActionPointJointsUsingRobot", joints_id=joints.id)
    assert work.session.require_project().action_points[0].robot_joints[0].is_valid


# ------------------------------------------------------------------------------------------------ two users
async def test_a_locked_tree_is_protected_from_another_user(work: Work, alice: Person, bob: Person) -> None:
    await work.project("p", "q")
    p, q = work.point("p"), work.point("q")
    await alice.lock(p, tree=True)
    for request in (
        bob.ask("RenameActionPoint", action_point_id=p, new_name="mine"),
        Work(bob).add_action(p, "x"),
        bob.ask("RemoveActionPoint", id=p),
        bob.ask("CloseProject", force=True),
        alice.ask("SaveProject"),
    ):
        with pytest.raises(Refused):
            await request
    await Work(bob).add_action(q, "y")
    await alice.ask("WriteUnlock", object_id=p)
    await Work(bob).add_action(p, "x")
    await alice.ask("SaveProject")
    await bob.lock(work.action("x").id)
    with pytest.raises(Refused, match="locked"):
        await alice.ask("RemoveActionPoint", id=p)
    await bob.ask("RemoveActionPoint", id=p)
    assert work.services.locks.announced() == {}


async def test_edits_of_many_users_at_once_keep_their_order(
    server: SessionServer, work: Work, alice: Person, crowd: list[Person]
) -> None:
    await work.project()
    batches = []
    write = server.session._journal._write_batch
    server.session._journal._write_batch = lambda *args: (batches.append(len(args[1])), write(*args))[1]  # type: ignore[method-assign]
    alice.take()

    async def edit(n: int) -> None:
        # Each user renames their own parameter: without a common lock, the edits really overlap.
        for count in range(20):
            await crowd[n].ask("UpdateProjectParameter", id=parameters[n], name=f"p{n}_{count}")
            await crowd[n].lock(parameters[n])

    for n, person in enumerate(crowd):
        await person.ask("AddProjectParameter", name=f"p{n}", type="integer", value=str(n))
    parameters = [p.id for p in work.session.project.parameters[2:]]
    for n, person in enumerate(crowd):
        await person.lock(parameters[n])
    alice.take()
    batches.clear()
    await asyncio.gather(*map(edit, range(8)))
    changed = [e["data"] for e in alice.events() if e["event"] == "ProjectParameterChanged"]
    edits = [edit.changes[0].after for edit in list(server.session.history)[-160:]]
    assert [(c["id"], c["name"]) for c in changed] == [(e.id, e.name) for e in edits]
    assert sum(batches) == 160
    assert len(batches) < 160, "no two edits shared a commit"


# ------------------------------------------------------------------------------------------------ actions
async def test_actions_keep_flows_defaults_and_unique_results(work: Work, alice: Person) -> None:
    await work.project("p")
    p = work.point("p")
    orientation = await work.add_orientation(p)
    pose = {"name": "pose", "type": "pose", "value": f'"{orientation}"'}
    await work.add_action(p, "move", "robot/move", pose)
    filled = {parameter.name: parameter.value for parameter in work.action("move").parameters}
    assert filled["velocity"] == "50.0"
    assert filled["pose"] == f'"{orientation}"'
    half = {"name": "probability", "type": "double", "value": "0.5"}
    flows = [{"type": "default", "outputs": ["r"]}]
    dice = await work.add_action(p, "dice", "rnd/random_bool", half, flows=flows)
    with pytest.raises(Refused, match="names a result r already"):
        await work.add_action(p, "dice2", "rnd/random_bool", half, flows=flows)
    with pytest.raises(Refused, match="not within"):
        await work.add_action(p, "fast", "robot/move", pose, {"name": "velocity", "type": "double", "value": "101.0"})
    await alice.ask("AddLogicItem", start="START", end=dice)
    await alice.ask("AddLogicItem", start=dice, end="END", condition={"what": f"{dice}/default/0", "value": "true"})
    await alice.lock(dice)
    with pytest.raises(Refused, match="uses a result"):
        await alice.ask("UpdateAction", action_id=dice, flows=NO_RESULTS)
    await alice.ask("UpdateAction", action_id=dice, flows=[{"type": "default", "outputs": ["renamed"]}])
    assert work.action("dice").outputs() == ["renamed"]
    with pytest.raises(Refused, match="move uses the orientation"):
        await alice.ask("RemoveActionPointOrientation", orientation_id=orientation)


async def test_a_copy_refers_to_its_own_items(work: Work, alice: Person) -> None:
    await work.project("p")
    p = work.point("p")
    below = await work.add_point("below", p)
    orientation = await work.add_orientation(below)
    half = {"name": "probability", "type": "double", "value": "0.5"}
    flows = [{"type": "default", "outputs": ["r"]}]
    source = await work.add_action(p, "source", "rnd/random_double", flows=flows)
    link = {"name": "probability", "type": "link", "value": f'"{source}/default/0"'}
    await work.add_action(below, "linked", "rnd/random_bool", link)
    await work.add_action(p, "move", "robot/move", {"name": "pose", "type": "pose", "value": f'"{orientation}"'})
    await work.add_action(p, "dice", "rnd/random_bool", half)
    await alice.ask("CopyActionPoint", id=p, position={"x": 3.0, "y": 0.0, "z": 0.0})
    await alice.ask("CopyActionPoint", id=p)
    names = [point.name for point in work.session.require_project().action_points]
    assert names == ["p", "below", "p_copy", "below_copy", "p_copy_1", "below_copy_1"]
    document = work.session.document
    copy = document.action_point(work.point("p_copy"))
    assert copy.position.x == 3.0
    assert document.action_point(work.point("below_copy")).parent == copy.id
    new_source = work.action("source_copy")
    assert new_source.outputs() == ["r_copy"]
    assert work.action("linked_copy").parameters[0].value == f'"{new_source.id}/default/0"'
    new_orientation = document.named("orientation", "o", work.point("below_copy"))
    assert work.action("move_copy").parameters[0].value == f'"{new_orientation}"'
    # The copy uses nothing of the original, and the original nothing of the copy.
    assert {getattr(user, "name", "") for user in document.users_of(orientation)} == {"move"}
    assert {getattr(user, "name", "") for user in document.users_of(new_source.id)} == {"linked_copy"}


async def test_read_locks_end_with_their_items(server: SessionServer, work: Work, alice: Person, bob: Person) -> None:
    project = await work.project("p")
    await bob.ask("ReadLock", object_id=work.point("p"))
    with pytest.raises(Refused, match="locked"):
        await alice.ask("WriteLock", object_id=work.point("p"))
    await alice.ask("SaveProject")
    await alice.ask("CloseProject")
    assert server.services.locks.locked_roots() == []
    await alice.ask("OpenProject", id=project)
    await alice.lock(work.point("p"))


async def test_overrides_are_added_changed_and_removed(work: Work, alice: Person) -> None:
    await work.project()
    robot = work.object("robot")
    await alice.lock(robot)

    def setting(value: str, name: str = "url", kind: str = "string") -> dict[str, Any]:
        return {"id": robot, "override": {"name": name, "type": kind, "value": value}}

    with pytest.raises(Refused, match="not overridden"):
        await alice.ask("UpdateOverride", **setting('"x"'))
    with pytest.raises(Refused, match="no setting"):
        await alice.ask("AddOverride", **setting('"x"', "nothing"))
    with pytest.raises(Refused, match="type string"):
        await alice.ask("AddOverride", **setting("1", kind="integer"))
    alice.take()
    await alice.ask("AddOverride", **setting('"a"'))
    with pytest.raises(Refused, match="already"):
        await alice.ask("AddOverride", **setting('"b"'))
    await alice.ask("UpdateOverride", **setting('"c"'))
    assert work.session.require_project().object_overrides[0].parameters[0].value == '"c"'
    await alice.ask("DeleteOverride", **setting('"c"'))
    events = alice.events()
    assert [e["change_type"] for e in events] == ["add", "update", "remove"]
    assert {e["parent_id"] for e in events} == {robot}
    assert work.session.require_project().object_overrides == []


# ------------------------------------------------------------------------------------------------ effects of saving
async def test_saving_a_moved_object_makes_joints_invalid_in_its_projects(
    server: SessionServer, work: Work, alice: Person
) -> None:
    project = await work.project()
    scene = work.session.require_scene().id
    on_scale = await work.add_point("on_scale", work.object("scale"))
    above = await work.add_point("above", on_scale)
    free = await work.add_point("free")
    server.cell.state = SceneStateEnum.STARTED
    for point in (on_scale, above, free):
        await alice.lock(point)
        await alice.ask("AddActionPointJointsUsingRobot", action_point_id=point, robot_id=work.object("robot"))
        await alice.ask("WriteUnlock", object_id=point)
    server.cell.state = SceneStateEnum.STOPPED
    await alice.ask("SaveProject")
    await alice.ask("CloseProject")
    await alice.ask("OpenScene", id=scene)
    scale = work.object("scale")
    await alice.lock(scale)
    await alice.ask("UpdateObjectPose", object_id=scale, pose=POSE | {"position": {"x": 9.0, "y": 0.0, "z": 0.0}})
    await alice.ask("WriteUnlock", object_id=scale)
    await alice.ask("SaveScene")
    saved = await server.services.storage.project(project)
    valid = {point.name: point.robot_joints[0].is_valid for point in saved.action_points}
    assert valid == {"on_scale": False, "above": False, "free": True}


async def test_an_object_used_by_projects_is_not_removed(server: SessionServer, work: Work, alice: Person) -> None:
    project = await work.project()
    scene = work.session.require_scene().id
    await work.add_point("on_scale", work.object("scale"))
    await alice.ask("SaveProject")
    assert await alice.ask("SceneObjectUsage", id=work.object("scale")) == [project]
    assert await alice.ask("SceneObjectUsage", id=work.object("rnd")) == []
    with pytest.raises(Refused, match="close the project"):
        await alice.ask("RemoveFromScene", id=work.object("scale"))
    await alice.ask("CloseProject")
    await alice.ask("OpenScene", id=scene)
    with pytest.raises(Refused, match="used in project"):
        await alice.ask("RemoveFromScene", id=work.object("scale"))
    await alice.ask("RemoveFromScene", id=work.object("scale"), force=True)
    # The project is unchanged until the scene is saved.
    assert (await server.services.storage.project(project)).action_points[0].parent
    await alice.ask("SaveScene")
    await alice.ask("CloseScene")
    await alice.ask("OpenProject", id=project)
    assert work.session.require_project().action_points[0].position.x == 0.5


async def test_a_collision_object_is_removed_with_its_type(server: SessionServer, work: Work, alice: Person) -> None:
    await work.scene()
    box = {"type": "Box", "box": {"id": "crate", "size_x": 0.1, "size_y": 0.1, "size_z": 0.1}}
    add = {"name": "crate", "pose": POSE, "model": box}
    await alice.ask("AddVirtualCollisionObjectToScene", **add)
    assert alice.names() == ["ChangedObjectTypes/add", "SceneObjectChanged/add"]
    with pytest.raises(Refused, match="object type called crate"):
        await alice.ask("AddVirtualCollisionObjectToScene", **add)
    await alice.ask("RemoveFromScene", id=work.object("crate"))
    assert alice.names() == ["SceneObjectChanged/remove"]
    assert server.types.known("crate")
    await alice.ask("SaveScene")
    assert alice.names() == ["SceneSaved", "ChangedObjectTypes/remove"]
    assert not server.types.known("crate")


async def test_a_live_object_moves_with_its_pose(server: SessionServer, work: Work, alice: Person) -> None:
    await work.scene()
    server.cell.state = SceneStateEnum.STARTED
    for name in ("scale", "robot"):
        await alice.lock(work.object(name))
    await alice.ask("UpdateObjectPose", object_id=work.object("scale"), pose=POSE)
    assert [moved for moved, _ in server.cell.moved] == [work.object("scale")]
    with pytest.raises(Refused, match="is a robot"):
        await alice.ask("UpdateObjectPose", object_id=work.object("robot"), pose=POSE)
    with pytest.raises(Refused, match="online"):
        await alice.ask("AddObjectToScene", name="late", type="TimeActions")


async def test_names_of_scenes_and_projects_are_unique(server: SessionServer, work: Work, alice: Person) -> None:
    await work.project()
    scene, project = work.session.require_scene().id, work.session.require_project().id
    with pytest.raises(Refused, match="already"):
        await alice.ask("RenameProject", project_id=project, new_name="scene")
    await alice.ask("SaveProject")
    await alice.ask("CloseProject")
    for request in (
        alice.ask("NewScene", name="project"),
        alice.ask("NewScene", name=""),
        alice.ask("NewProject", scene_id=scene, name="scene"),
        alice.ask("CopyScene", source_id=scene, target_name="project"),
        alice.ask("CopyProject", source_id=project, target_name="project"),
    ):
        with pytest.raises(Refused, match="name"):
            await request
    await alice.ask("CopyProject", source_id=project, target_name="copy")
    copies = [p for p in await server.services.storage.projects() if p.name == "copy"]
    own = {p.name: p.value for p in (await server.services.storage.project(copies[0].id)).parameters}
    assert own == {"scene_id": f'"{scene}"', "project_id": f'"{copies[0].id}"'}


async def test_a_project_with_problems_is_not_opened(server: SessionServer, work: Work, alice: Person) -> None:
    project = await work.project("p")
    await work.add_action(work.point("p"), "act")
    await alice.ask("SaveProject")
    await alice.ask("CloseProject")
    meta = server.types._metas.pop("TimeActions")
    server.types.revision += 1
    with pytest.raises(Refused, match="TimeActions does not exist"):
        await alice.ask("OpenProject", id=project)
    listed = await alice.ask("ListProjects")
    assert any("TimeActions" in problem for problem in listed[0]["problems"])
    server.types._metas["TimeActions"] = meta
    await alice.ask("OpenProject", id=project)


# ------------------------------------------------------------------------------------------------ dry runs
async def test_a_dry_run_checks_and_changes_nothing(
    server: SessionServer, work: Work, alice: Person, bob: Person
) -> None:
    await work.project("p", "q")
    p, q = work.point("p"), work.point("q")
    action = await work.add_action(p, "act")
    orientation = await work.add_orientation(q)
    await alice.ask("AddProjectParameter", name="n", type="integer", value="1")
    parameter = work.session.project.parameters[-1].id
    await alice.lock(p)
    await alice.lock(parameter)
    await alice.lock(action)
    sleep = {"type": f"{work.object('time')}/sleep", "parameters": [SECONDS], "flows": NO_RESULTS}
    good: list[tuple[str, dict[str, Any]]] = [
        ("AddActionPoint", {"name": "new", "position": ORIGIN}),
        ("RenameActionPoint", {"action_point_id": p, "new_name": "new"}),
        ("UpdateActionPointParent", {"action_point_id": p, "new_parent_id": q}),
        ("RemoveActionPoint", {"id": q}),
        ("CopyActionPoint", {"id": q}),
        ("AddActionPointOrientation", {"action_point_id": p, "orientation": UPRIGHT, "name": "x"}),
        ("RemoveActionPointOrientation", {"orientation_id": orientation}),
        ("AddAction", {"action_point_id": q, "name": "new", **sleep}),
        ("UpdateAction", {"action_id": action, "parameters": [SECONDS | {"value": "0.7"}]}),
        ("RenameAction", {"action_id": action, "new_name": "new"}),
        ("AddLogicItem", {"start": "START", "end": action}),
        ("AddProjectParameter", {"name": "new", "type": "string", "value": '"x"'}),
        ("UpdateProjectParameter", {"id": parameter, "value": "2"}),
        ("RemoveProjectParameter", {"id": parameter}),
    ]
    bad: list[tuple[str, dict[str, Any]]] = [
        ("AddActionPoint", {"name": "p", "position": ORIGIN}),
        ("RenameActionPoint", {"action_point_id": q, "new_name": "new"}),
        ("AddAction", {"action_point_id": q, "name": "act", **sleep}),
        ("AddLogicItem", {"start": "START", "end": "END"}),
        ("UpdateProjectParameter", {"id": parameter, "value": "{}"}),
        ("RemoveAction", {"id": "act_none"}),
    ]
    document, project = server.session.document, server.session.project
    before, edits, locks = document.items(), len(server.session.history), server.services.locks.announced()
    for person in (alice, bob):
        person.take()
    for name, arguments in good:
        await alice.ask(name, dry_run=True, **arguments)
    for name, arguments in bad:
        with pytest.raises(Refused):
            await alice.ask(name, dry_run=True, **arguments)
    assert document.items() == before
    assert server.session.project is project
    assert len(server.session.history) == edits
    assert server.services.locks.announced() == locks
    assert server.services.locks.write_locked_roots() == list(dict.fromkeys((p, parameter)))
    assert bob.take() == []
    assert alice.events() == []
    for name, arguments in good[-3:-5:-1]:
        await alice.ask(name, **arguments)
    assert bob.events()


async def test_requests_without_user_or_document_are_refused(
    server: SessionServer, alice: Person, stranger: Person
) -> None:
    for name, arguments in (("RenameAction", {"action_id": "x", "new_name": "y"}), ("RemoveAction", {"id": "x"})):
        with pytest.raises(Refused, match="No scene"):
            await stranger.ask(name, **arguments)
    with pytest.raises(Refused, match="not logged in"):
        await stranger.ask("AddObjectToScene", name="x", type="TimeActions")
    await stranger.ask("NewScene", name="scene")
    with pytest.raises(Refused, match="No project"):
        await stranger.ask("AddActionPoint", name="x", position=ORIGIN)
    server.services.execution.busy = True  # type: ignore[misc]
    await alice.ask("CloseScene", force=True)
    with pytest.raises(Refused, match="program is running"):
        await alice.ask("NewScene", name="scene")


async def test_removing_a_locked_parent_unlocks_its_tree(alice: Person, bob: Person, work: Work) -> None:
    await work.project("root")
    root = work.point("root")
    below = await work.add_point("below", root)
    await alice.lock(below, tree=True)
    bob.take()
    await alice.ask("RemoveActionPoint", id=below)
    events = bob.events()
    assert [event["event"] for event in events] == ["ActionPointChanged", "ObjectsUnlocked"]
    assert events[1]["data"] == {"object_ids": [root], "owner": "alice"}
    await bob.lock(root)
