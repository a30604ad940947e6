"""The Scene service: obstacles, free lines and object poses."""

from pathlib import Path
from typing import Any

import httpx
import pytest
import trimesh

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Box, ObjectModel, ObjectTypeSource
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_server.app import running_server
from arcor2_server.settings import ServerSettings
from tests.server.core.serving import until
from tests.server.rest.rest_client import granted, refused, rest_client

pytestmark = pytest.mark.asyncio(loop_scope="module")

ORIGIN = {"position": {"x": 0, "y": 0, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}


def at(x: float, y: float = 0.0, z: float = 0.0) -> dict[str, Any]:
    return ORIGIN | {"position": {"x": x, "y": y, "z": z}}


def line(*points: tuple[float, float, float]) -> dict[str, Any]:
    return {f"pt{n}": dict(zip("xyz", point, strict=True)) for n, point in enumerate(points, 1)}


def box_stl(x: float, y: float, z: float) -> bytes:
    """Return an STL file of a box around its origin."""
    made: bytes = trimesh.creation.box((x, y, z)).export(file_type="stl")
    return made


async def test_collision_models_are_added_and_removed(http: httpx.AsyncClient) -> None:
    chair = {"assetData": ("chair.stl", box_stl(0.5, 0.5, 0.5))}
    granted(await http.post("/assets", params={"id": "chair.stl", "upsert": True}, files=chair))
    assert granted(await http.get("/collisions")) == []
    box: dict[str, Any] = {"boxId": "crate", "sizeX": 1, "sizeY": 1, "sizeZ": 1}
    assert granted(await http.put("/collisions/box", params=box, json=at(2))) == "ok"
    granted(await http.put("/collisions/sphere", params={"sphereId": "ball", "radius": 0.5}, json=at(5)))
    tube: dict[str, Any] = {"cylinderId": "tube", "radius": 0.5, "height": 1}
    granted(await http.put("/collisions/cylinder", params=tube, json=at(8)))
    granted(await http.put("/collisions/mesh", params={"meshId": "chair", "meshFileId": "chair.stl"}, json=at(9)))
    assert granted(await http.get("/collisions")) == ["ball", "chair", "crate", "tube"]

    through_all = line((0, 0, 0), (10, 0, 0))
    assert granted(await http.put("/utils/line-safe", json=through_all)) == {"safe": False, "object_id": "crate"}
    back = line((10, 0, 0), (0, 0, 0))
    assert granted(await http.put("/utils/line-safe", json=back)) == {"safe": False, "object_id": "chair"}
    granted(await http.delete("/collisions/crate"))
    refused(await http.delete("/collisions/crate"), 404, "NotFound", "crate")
    assert granted(await http.put("/utils/line-safe", json=through_all))["object_id"] == "ball"
    # An obstacle that is added again is moved.
    granted(await http.put("/collisions/sphere", params={"sphereId": "ball", "radius": 0.5}, json=at(5, 3)))
    assert granted(await http.put("/utils/line-safe", json=through_all))["object_id"] == "tube"

    assert granted(await http.get("/system/running")) is False
    granted(await http.put("/system/start"))
    assert granted(await http.get("/system/running")) is True
    granted(await http.put("/system/stop"))
    assert granted(await http.get("/system/running")) is False
    assert granted(await http.get("/collisions")) == []
    assert granted(await http.put("/utils/line-safe", json=through_all)) == {"safe": True}


async def test_meshes_are_obstacles_with_their_exact_shape(http: httpx.AsyncClient) -> None:
    through, above = line((0, 0, 0), (10, 0, 0)), line((0, 0, 0.4), (10, 0, 0.4))
    table = {"assetData": ("table.stl", box_stl(1, 1, 0.5))}
    granted(await http.post("/assets", params={"id": "table.stl"}, files=table))
    mesh: dict[str, Any] = {"meshId": "table", "meshFileId": "table.stl"}
    granted(await http.put("/collisions/mesh", params=mesh, json=at(5)))
    assert granted(await http.put("/utils/line-safe", json=through)) == {"safe": False, "object_id": "table"}
    assert granted(await http.put("/utils/line-safe", json=above)) == {"safe": True}
    # The first obstacle on the line is returned, mesh or not.
    granted(await http.put("/collisions/sphere", params={"sphereId": "ball", "radius": 0.5}, json=at(3)))
    assert granted(await http.put("/utils/line-safe", json=through))["object_id"] == "ball"
    granted(await http.put("/collisions/sphere", params={"sphereId": "ball", "radius": 0.5}, json=at(8)))
    assert granted(await http.put("/utils/line-safe", json=through))["object_id"] == "table"
    # A mesh that is added again with a larger scale reaches the other line.
    granted(await http.put("/collisions/mesh", params=mesh | {"meshScaleZ": 2}, json=at(5)))
    assert granted(await http.put("/utils/line-safe", json=above)) == {"safe": False, "object_id": "table"}

    refused(await http.put("/collisions/mesh", params=mesh | {"meshScaleX": 0}, json=at(5)), 400, "Argument", "scale")
    refused(await http.put("/collisions/mesh", params=mesh | {"meshFileId": "none.stl"}, json=at(5)), 404, "NotFound")
    granted(await http.post("/assets", params={"id": "bad.stl"}, files={"assetData": ("bad.stl", b"no mesh at all")}))
    answer = await http.put("/collisions/mesh", params=mesh | {"meshFileId": "bad.stl"}, json=at(5))
    refused(answer, 400, "Argument", "bad.stl")
    # The refusal names a model whose asset was deleted.
    granted(await http.delete("/assets/table.stl"))
    granted(await http.put("/collisions/sphere", params={"sphereId": "ball", "radius": 0.5}, json=at(8)))
    refused(await http.put("/utils/line-safe", json=through), 400, "Argument", "table.stl")
    granted(await http.put("/system/stop"))


@pytest.mark.parametrize(
    ("path", "params", "body", "word"),
    [
        ("box", {"boxId": "x", "sizeX": 1, "sizeY": 1}, ORIGIN, "sizeZ"),
        ("box", {"sizeX": 1, "sizeY": 1, "sizeZ": 1}, ORIGIN, "boxId"),
        ("box", {"boxId": "x", "sizeX": 1, "sizeY": 1, "sizeZ": -1}, ORIGIN, "size_z"),
        ("box", {"boxId": "x", "sizeX": 0, "sizeY": 1, "sizeZ": 1}, ORIGIN, "size_x"),
        ("box", {"boxId": "x", "sizeX": "wide", "sizeY": 1, "sizeZ": 1}, ORIGIN, "sizeX"),
        ("sphere", {"sphereId": "x", "radius": "nan"}, ORIGIN, "radius"),
        ("sphere", {"sphereId": "x", "radius": "inf"}, ORIGIN, "radius"),
        ("sphere", {"sphereId": "", "radius": 1}, ORIGIN, "id"),
        ("cylinder", {"cylinderId": "x", "radius": 1, "height": 0}, ORIGIN, "height"),
        ("mesh", {"meshId": "x"}, ORIGIN, "meshFileId"),
        ("sphere", {"sphereId": "x", "radius": 1}, {"orientation": {"x": 0, "y": 0, "z": 0, "w": 0}}, "quaternion"),
        ("sphere", {"sphereId": "x", "radius": 1}, {"position": {"x": None}}, "position"),
    ],
)
async def test_invalid_models_are_refused(
    http: httpx.AsyncClient, path: str, params: Any, body: Any, word: str
) -> None:
    refused(await http.put(f"/collisions/{path}", params=params, json=body), 400, "Argument", word)
    assert granted(await http.get("/collisions")) == []


CRATE = """
from arcor2_hw.objects import CollisionObject


class Crate(CollisionObject):
    _ABSTRACT = False
"""


async def test_objects_of_the_online_scene_are_obstacles(http: httpx.AsyncClient, tmp_path: Path) -> None:
    async with running_server(ServerSettings(data_dir=tmp_path)) as services, rest_client(services) as own:
        await services.types.add(ObjectTypeSource("Crate", CRATE, model=ObjectModel.of(Box("Crate", 1, 1, 1))))
        placed = SceneObject("crate", "Crate", Pose(Position(3.0)), id="obj_crate")
        await services.session.show(Scene("scene", objects=[placed], id="scn_1"))
        assert granted(await own.get("/collisions")) == []
        assert granted(await own.get("/system/running")) is False
        await services.online.begin_start("ann")
        await until(lambda: services.online.online)
        assert granted(await own.get("/collisions")) == ["obj_crate"]
        assert granted(await own.get("/system/running")) is True
        answer = granted(await own.put("/utils/line-safe", json=line((0, 0, 0), (10, 0, 0))))
        assert answer == {"safe": False, "object_id": "obj_crate"}
        granted(await own.put("/system/stop"))
        assert granted(await own.get("/collisions")) == ["obj_crate"], "the obstacle still exists"
        await services.online.begin_stop("ann")
        await until(lambda: services.online.state.value == "stopped")
        assert granted(await own.get("/collisions")) == []


async def test_the_pose_of_an_object_is_returned(http: httpx.AsyncClient) -> None:
    real = Pose(Position(0.4, -0.2, 0.1), Orientation.from_rotation_vector(0.3, -1.2, 2.0))
    on_mesh = [Position(0, 0, 0), Position(0.2, 0, 0), Position(0, 0.3, 0), Position(0.1, 0.1, 0.2)]
    touched = [real.position + point.rotated(real.orientation) for point in on_mesh]

    def points(of: list[Position]) -> list[dict[str, float]]:
        return [{"x": p.x, "y": p.y, "z": p.z} for p in of]

    body = {"meshFocusPoints": points(on_mesh), "robotSpacePoints": points(touched)}
    found = granted(await http.put("/utils/focus", json=body))
    position, turned = Position(**found["position"]), Orientation(**found["orientation"])
    assert position.distance_to(real.position) < 1e-9
    assert turned.angle_to(real.orientation) < 1e-7
    for few in (body | {"meshFocusPoints": points(on_mesh[:3])}, {name: part[:2] for name, part in body.items()}):
        refused(await http.put("/utils/focus", json=few), 400, "Argument", "points")
    in_a_line = [{"x": x, "y": 0, "z": 0} for x in (0, 1, 2)]
    refused(
        await http.put("/utils/focus", json={"meshFocusPoints": in_a_line, "robotSpacePoints": in_a_line}),
        400,
        "Argument",
        "line",
    )
