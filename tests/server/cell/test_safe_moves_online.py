"""A safe move as a client asks for it: an uploaded mesh and robot model get to where ways are planned."""

from collections.abc import AsyncIterator

import msgspec
import trimesh

from arcor2_hw.data import object_type
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import ObjectTypeMeta
from arcor2_hw.data.scene import Scene
from tests.runtime.test_host_safe_moves import ACROSS, ARM, READY, URDF, WALL, joints, placed

from .conftest import Server, robot_meta, serving

META = robot_meta("Arm", move_to_joints=True, inverse_kinematics=True)
MESH = object_type.ObjectModel.of(object_type.Mesh("Wall", "wall.stl"))


async def with_uploads(server: Server) -> None:
    server.types.add("Arm", ARM, [], META)
    server.types.add("Wall", WALL)
    plain = server.types.meta
    server.types.meta = lambda name: (  # type: ignore[method-assign]
        ObjectTypeMeta(name, object_model=MESH) if name == "Wall" else plain(name)
    )
    wall = trimesh.creation.box((0.04, 0.5, 1.0)).export(file_type="stl")
    for key, content in {"wall.stl": wall, "arm.urdf": URDF.read_bytes(), "notes.txt": b"nothing"}.items():
        await server.services.assets.put(_pieces(content), key)
    objects = [placed("arm", "Arm", Pose()), placed("wall", "Wall", Pose(Position(0.0, 0.55, 0.5)))]
    await server.open(Scene("scene", id="scn_1", objects=objects))
    await server.start()


async def _pieces(content: bytes) -> AsyncIterator[bytes]:
    yield content


async def move(server: Server, values: tuple[float, ...], safe: bool = True) -> dict[str, object]:
    wanted = [msgspec.to_builtins(joint) for joint in joints(values)]
    await server.ask("MoveToJoints", {"robot_id": "obj_arm", "speed": 0.5, "joints": wanted, "safe": safe})
    return await server.client.event("RobotMoveToJoints", lambda data: data["move_event_type"] != "start")


@serving(with_uploads)
async def test_around_a_mesh_or_refused(server: Server) -> None:
    assert (await move(server, ACROSS))["move_event_type"] == "end"
    assert int(await server.services.cell.call("obj_arm", "waypoints")) > 2
    inside = (1.57, *READY[1:])
    failed = await move(server, inside)
    assert failed["move_event_type"] == "failed"
    assert "wall" in str(failed["message"])
    assert (await move(server, inside, safe=False))["move_event_type"] == "end"
    stuck = await move(server, READY)
    assert stuck["move_event_type"] == "failed"
    assert "where it stands" in str(stuck["message"])
