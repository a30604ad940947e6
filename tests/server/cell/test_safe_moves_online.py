"""Safe moves requested by a client: uploaded meshes and robot models reach the planner."""

from collections.abc import AsyncIterator
from typing import Any

import msgspec
import pytest
import trimesh
from msgspec.structs import replace

from arcor2_hw.collision.description import Attachment, Obstacle
from arcor2_hw.data import object_type
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import ObjectTypeMeta
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from tests.runtime.conftest import Package
from tests.runtime.test_host_safe_moves import (
    ACROSS,
    ARM,
    READY,
    TIP,
    UPSIDE_DOWN,
    URDF,
    WALL,
    calibration,
    joints,
    placed,
)

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
async def test_a_safe_move_avoids_a_mesh_or_is_refused(server: Server) -> None:
    assert (await move(server, ACROSS))["move_event_type"] == "end"
    assert int(await server.services.online.call("obj_arm", "waypoints")) > 2
    inside = (1.57, *READY[1:])
    failed = await move(server, inside)
    assert failed["move_event_type"] == "failed"
    assert "wall" in str(failed["message"])
    assert (await move(server, inside, safe=False))["move_event_type"] == "end"
    stuck = await move(server, READY)
    assert stuck["move_event_type"] == "failed"
    assert "at the start" in str(stuck["message"])


# ------------------------------------------------------------------------------------------ obstacles, calibrations
OBJ = "obj_arm"
LONGER = 0.004
CALIBRATED_ARM = f"""
import msgspec
from arcor2_hw.data.robot import KinematicCalibration
{ARM}
    def kinematic_calibration(self) -> KinematicCalibration:
        return msgspec.json.decode({msgspec.json.encode(calibration(LONGER)).decode()!r}, type=KinematicCalibration)
"""


async def with_arm_alone(server: Server) -> None:
    meta = robot_meta("Arm", move_to_pose=True, move_to_joints=True, kinematic_calibration=True)
    server.types.add("Arm", CALIBRATED_ARM, [], replace(meta, urdf_package_filename="arm.urdf"))
    await server.services.assets.put(_pieces(URDF.read_bytes()), "arm.urdf")
    await server.open(Scene("scene", id="scn_1", objects=[placed("arm", "Arm", Pose())]))


def box(key: str, at: Position, x: float, y: float, z: float, attachment: Attachment | None = None) -> Obstacle:
    return Obstacle.of(object_type.Box(key, x, y, z), Pose(at), attachment=attachment)


async def line(server: Server, to: Position) -> str:
    """Move the tip to its pose in READY, and from there in a line; return the reason of a refusal, or an empty text."""
    assert (await move(server, READY, safe=False))["move_event_type"] == "end"
    target = {"position": msgspec.to_builtins(to), "orientation": msgspec.to_builtins(UPSIDE_DOWN)}
    args = {"robot_id": OBJ, "end_effector_id": "tcp", "speed": 0.5, "safe": True, "linear": True} | target
    await server.ask("MoveToPose", args)
    event = await server.client.event("RobotMoveToPose", lambda data: data["move_event_type"] != "start")
    return str(event.get("message", ""))


async def height(server: Server) -> float:
    return (await server.services.online.end_effector_pose(OBJ, "tcp")).position.z


@serving(with_arm_alone)
async def test_added_and_gripped_bodies_are_obstacles_online_and_in_programs(server: Server) -> None:
    world, aside = server.services.collisions, TIP + Position(0.0, 0.25, 0.0)
    try:
        world.put(box("table", aside + Position(0.0, 0.0, -0.2), 0.1, 0.1, 0.02))  # it was in the scene before
        await server.start()
        assert await line(server, aside) == ""
        world.put(box("crate", aside, 0.1, 0.1, 0.1))
        assert "crate" in await line(server, aside)
        world.remove("crate")
        assert await line(server, aside) == ""
        world.put(box("rod", Position(0.0, 0.0, 0.16), 0.03, 0.03, 0.3, Attachment(OBJ, "tcp")))
        message = await line(server, aside)
        assert "rod" in message
        assert "table" in message
        world.stop()
        assert await line(server, aside) == ""
        await server.ask("StopScene")
        await server.client.state("stopped")

        # A program avoids objects that existed before its start, and objects added while it runs.
        world.put(box("table", aside + Position(0.0, 0.0, -0.2), 0.1, 0.1, 0.02))
        world.put(box("rod", Position(0.0, 0.0, 0.16), 0.03, 0.03, 0.3, Attachment(OBJ, "tcp")))
        write(server)
        await server.ask("RunPackage", {"id": "pkg_1"})
        message = (await server.client.event("ProjectException"))["message"]
        assert "rod" in message
        assert "table" in message
        await server.client.state("stopped", "PackageState")
        world.remove("rod")
        await server.ask("RunPackage", {"id": "pkg_1"})
        (tip,) = (await server.client.event("RobotEef", lambda data: _at(data).distance_to(aside) < 1e-3))[
            "end_effectors"
        ]
        assert tip["end_effector_id"] == "tcp"
        world.put(box("crate", aside, 0.1, 0.1, 0.1))
        assert "crate" in (await server.client.event("ProjectException"))["message"]
        await server.client.state("stopped", "PackageState")
    finally:
        await server.services.compute.close()


def _at(data: dict[str, Any]) -> Position:
    (tip,) = data["end_effectors"]
    return msgspec.convert(tip["pose"]["position"], Position)


def write(server: Server) -> None:
    """Write a package that repeatedly moves the tip sideways in a line."""
    target = msgspec.json.encode(Pose(TIP + Position(0.0, 0.25, 0.0), UPSIDE_DOWN)).decode()
    ready = [(joint.name, joint.value) for joint in joints(READY)]
    body = f"""
        import msgspec
        from arcor2_hw.data.geometry import Pose
        from arcor2_hw.data.robot import Joint
        arm = res.objects["{OBJ}"]
        while True:
            arm.move_to_joints([Joint(*one) for one in {ready}], 0.5, safe=False)
            arm.move_to_pose("tcp", msgspec.json.decode({target!r}, type=Pose), 0.5)
            time.sleep(0.05)
    """
    objects = [placed("arm", "Arm", Pose())]
    directory = server.services.settings.packages_dir / "pkg_1"
    Package(directory).write({"Arm": CALIBRATED_ARM}, objects, Project("project", "scn_1", id="pro_1"), body)


@serving(with_arm_alone)
async def test_the_controllers_calibration_is_used_online_and_in_programs(server: Server) -> None:
    calibrations = server.services.robot_calibrations
    try:
        await server.start()
        await calibrations.settled()
        assert await height(server) == pytest.approx(TIP.z + LONGER, abs=1e-4)
        await server.ask("StopScene")
        await server.client.state("stopped")
        await server.start()  # the calibration also applies from the next start
        assert await height(server) == pytest.approx(TIP.z + LONGER, abs=1e-4)
        await server.ask("StopScene")
        await server.client.state("stopped")
        write(server)
        server.client.got.clear()
        await server.ask("RunPackage", {"id": "pkg_1"})
        await server.client.state("running", "PackageState")
        # At the taught pose the tip is where it should be; in READY it deviates by the calibration.
        ready = await server.client.event("RobotEef", lambda data: abs(_at(data).y - TIP.y) < 0.01)
        assert _at(ready).z == pytest.approx(TIP.z + LONGER, abs=1e-4)
        await server.ask("StopPackage")
        await server.client.state("stopped", "PackageState")
    finally:
        await calibrations.close()
        await server.services.compute.close()
