"""The scene is edited while a project is open, with the requests that extend the protocol."""

import pytest

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.events import SceneStateEnum
from tests.server.session.session_server import Person, Refused, SessionServer
from tests.server.session.work import POSE, Work

pytestmark = pytest.mark.asyncio

ELSEWHERE = POSE | {"position": {"x": 9.0, "y": 0.0, "z": 0.0}}
BOX = {"type": "Box", "box": {"id": "crate", "size_x": 0.1, "size_y": 0.1, "size_z": 0.1}}


@pytest.fixture
def work(alice: Person) -> Work:
    return Work(alice)


async def test_objects_are_added_and_saved_with_the_project(server: SessionServer, work: Work, alice: Person) -> None:
    project = await work.project()
    scene = work.session.require_scene().id
    with pytest.raises(Refused, match="close the project"):
        await alice.ask("AddObjectToScene", name="clock", type="TimeActions")
    with pytest.raises(Refused, match="close the project"):
        await alice.ask("AddVirtualCollisionObjectToScene", name="crate", pose=POSE, model=BOX)
    alice.take()

    await alice.ask("AddSceneObject", name="clock", type="TimeActions")
    await alice.ask("AddSceneShape", name="crate", pose=POSE, model=BOX)
    assert alice.names() == ["SceneObjectChanged/add", "ChangedObjectTypes/add", "SceneObjectChanged/add"]
    assert work.session.scene_changed
    names = {each.name for each in (await server.services.storage.scene(scene)).objects}
    assert not names & {"clock", "crate"}, "nothing is stored before saving"

    await alice.ask("SaveProject")
    assert alice.names() == ["ProjectSaved"]
    assert not work.session.has_changes
    names = {each.name for each in (await server.services.storage.scene(scene)).objects}
    assert {"clock", "crate"} <= names
    await alice.ask("CloseProject")
    await alice.ask("OpenProject", id=project)
    assert {"clock", "crate"} <= {each.name for each in work.session.require_scene().objects}


async def test_undo_removes_an_added_object_and_its_type(server: SessionServer, work: Work, alice: Person) -> None:
    await work.project()
    await alice.ask("SaveProject")
    await alice.ask("AddSceneShape", name="crate", pose=POSE, model=BOX)
    await alice.ask("SaveProject")
    alice.take()
    await alice.ask("Undo")
    assert alice.names() == ["SceneObjectChanged/remove"]
    await alice.ask("SaveProject")
    assert alice.names() == ["ProjectSaved", "ChangedObjectTypes/remove"]
    assert not server.types.known("crate")


async def test_moving_an_object_makes_the_joints_on_it_invalid_in_all_projects(
    server: SessionServer, work: Work, alice: Person
) -> None:
    project = await work.project()
    scale = work.object("scale")
    on_scale, free = await work.add_point("on_scale", scale), await work.add_point("free")
    server.cell.state = SceneStateEnum.STARTED
    for point in (on_scale, free):
        await alice.lock(point)
        await alice.ask("AddActionPointJointsUsingRobot", action_point_id=point, robot_id=work.object("robot"))
        await alice.ask("WriteUnlock", object_id=point)
    server.cell.state = SceneStateEnum.STOPPED
    await alice.ask("SaveProject")
    await alice.ask("CopyProject", source_id=project, target_name="other")

    await alice.lock(scale, tree=True)
    with pytest.raises(Refused, match="close the project"):
        await alice.ask("UpdateObjectPose", object_id=scale, pose=ELSEWHERE)
    alice.take()
    await alice.ask("UpdateSceneObjectPose", object_id=scale, pose=ELSEWHERE)
    assert sorted(alice.names()) == ["JointsChanged/update", "SceneObjectChanged/update"]
    await alice.ask("WriteUnlock", object_id=scale)

    # Joints that are taught again after the move stay valid.
    joints = next(point for point in work.session.require_project().action_points if point.id == on_scale).robot_joints
    assert not joints[0].is_valid
    server.cell.state = SceneStateEnum.STARTED
    await alice.lock(on_scale)
    await alice.ask("UpdateActionPointJointsUsingRobot", joints_id=joints[0].id)
    await alice.ask("WriteUnlock", object_id=on_scale)
    server.cell.state = SceneStateEnum.STOPPED
    await alice.ask("SaveProject")
    valid = {
        each.name: {
            point.name: point.robot_joints[0].is_valid
            for point in (await server.services.storage.project(each.id)).action_points
        }
        for each in await server.services.storage.projects()
    }
    assert valid == {"project": {"on_scale": True, "free": True}, "other": {"on_scale": False, "free": True}}

    await alice.ask("Undo")  # the joints taught again
    await alice.ask("Undo")  # the move
    assert server.session.document.scene_object(scale).pose.position.x != 9.0


async def test_settings_and_shapes_change_only_offline(server: SessionServer, work: Work, alice: Person) -> None:
    await work.project()
    await alice.ask("AddSceneShape", name="crate", pose=POSE, model=BOX)
    await alice.lock("crate")
    larger = BOX | {"box": BOX["box"] | {"size_x": 1.2}}  # type: ignore[operator]
    with pytest.raises(Refused, match="close the project"):
        await alice.ask("UpdateObjectModel", object_type_id="crate", object_model=larger)
    server.cell.state = SceneStateEnum.STARTED
    with pytest.raises(Refused, match="online"):
        await alice.ask("AddSceneShape", name="crate2", pose=POSE, model=BOX)
    scale = work.object("scale")
    await alice.lock(scale)
    with pytest.raises(Refused, match="online"):
        await alice.ask("UpdateSceneObjectSettings", id=scale, parameters=[])
    server.cell.state = SceneStateEnum.STOPPED
    await alice.ask("UpdateSceneObjectSettings", id=scale, parameters=[])


async def test_the_node_of_an_object_is_stored_and_undone(server: SessionServer, work: Work, alice: Person) -> None:
    await work.project()
    scale = work.object("scale")
    await alice.ask("SetObjectNode", id=scale, node="press")
    assert server.session.document.scene_object(scale).node == "press"
    alice.take()
    await alice.ask("SaveProject")
    stored = await server.services.storage.scene(work.session.require_scene().id)
    assert {each.name: each.node for each in stored.objects if each.node} == {"scale": "press"}
    with pytest.raises(Refused, match="node"):
        await alice.ask("SetObjectNode", id=scale, node="press.>")
    await alice.ask("Undo")
    assert server.session.document.scene_object(scale).node is UNSET
    server.cell.state = SceneStateEnum.STARTED
    with pytest.raises(Refused, match="online"):
        await alice.ask("SetObjectNode", id=scale, node="oven")
