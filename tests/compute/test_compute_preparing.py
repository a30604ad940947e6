"""Tests of prepared meshes and robots: fewer triangles, same appearance, read back from the generated file."""

import io
import json
import re
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from arcor2_hw.collision.description import StoredFile
from arcor2_hw.compute import mesh_functions, simplification
from arcor2_hw.compute.mesh_functions import prepared
from arcor2_hw.compute.mesh_tasks import PrepareAsset, PreparedAsset
from arcor2_hw.compute.worker_state import WorkerState
from arcor2_hw.kinematics.errors import BadMesh, ModelError, UnsafeDescription
from arcor2_hw.kinematics.meshes import Surface, linear_of

_TYPES = {5120: "i1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_SIZES = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
BALL = trimesh.creation.icosphere(subdivisions=5, radius=0.05)
TRIANGLES_OF_BALL = 20_480
MAX_OF_BALL = 13_856
"""Largest number of triangles of the ball, whose bounding box has a diagonal of 0.173 m."""


class Glb:
    """The file as a client reads it (glTF 2.0, 4.4 and 5): `json`, and the arrays of its meshes by name."""

    def __init__(self, content: bytes) -> None:
        magic, version, size = struct.unpack_from("<4sII", content)
        assert (magic, version, size) == (b"glTF", 2, len(content))
        length, kind = struct.unpack_from("<I4s", content, 12)
        assert kind == b"JSON"
        assert length % 4 == 0
        self.json: dict[str, Any] = json.loads(content[20 : 20 + length])
        self.binary = content[28 + length :]
        self.meshes = {mesh["name"]: self._arrays(mesh["primitives"][0]) for mesh in self.json.get("meshes", [])}
        (self.extras,) = (scene["extras"] for scene in self.json["scenes"])

    def _arrays(self, primitive: dict[str, Any]) -> dict[str, Any]:
        numbers = {**primitive["attributes"], "indices": primitive["indices"]}
        return {name: self._array(number) for name, number in numbers.items()}

    def _array(self, number: int) -> Any:
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        kind = np.dtype(_TYPES[accessor["componentType"]])
        stride = view.get("byteStride", _SIZES[accessor["type"]] * kind.itemsize)
        assert stride * accessor["count"] <= view["byteLength"]
        rows = np.frombuffer(self.binary, kind, stride // kind.itemsize * accessor["count"], view["byteOffset"])
        values = rows.reshape(accessor["count"], -1)[:, : _SIZES[accessor["type"]]]
        return values / np.iinfo(kind).max if accessor.get("normalized") else values


def prepare(tmp_path: Path, content: bytes | str, name: str) -> tuple[PreparedAsset, list[str]]:
    steps: list[str] = []
    (tmp_path / "content").write_bytes(content if isinstance(content, bytes) else content.encode())
    task = PrepareAsset(StoredFile(str(tmp_path / "content"), name))
    return prepared(task, WorkerState(lambda share, text: steps.append(f"{share:.1f} {text}"))), steps


def exported(mesh: trimesh.Trimesh, kind: str) -> bytes:
    content = mesh.export(file_type=kind)
    return content if isinstance(content, bytes) else str(content).encode()


# ------------------------------------------------------------------------------------------------ one mesh
@pytest.mark.parametrize("kind", ["stl", "obj", "ply", "off", "dae", "glb"])
def test_a_fine_sphere_is_simplified_in_every_file_format(kind: str, tmp_path: Path) -> None:
    asset, steps = prepare(tmp_path, exported(BALL, kind), f"ball.{kind}")
    assert (asset.before, asset.triangles) == (TRIANGLES_OF_BALL, MAX_OF_BALL)
    ball = Glb(asset.content).meshes["mesh"]
    assert len(ball["indices"]) == 3 * asset.triangles
    radii = np.linalg.norm(ball["POSITION"], axis=1)
    assert np.abs(radii - 0.05).max() < 0.1e-3
    assert len(ball["POSITION"]) < 0.6 * asset.triangles, "its vertices are shared"
    lengths = radii * np.linalg.norm(ball["NORMAL"], axis=1)
    off = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", ball["NORMAL"], ball["POSITION"]) / lengths, -1, 1)))
    assert off.max() < 3.0
    assert "COLOR_0" not in ball
    assert len(steps) >= 3


def test_a_box_keeps_its_twelve_triangles_and_its_edges(tmp_path: Path) -> None:
    asset, _ = prepare(tmp_path, exported(trimesh.creation.box((0.2, 0.4, 0.6)), "stl"), "box.stl")
    box = Glb(asset.content).meshes["mesh"]
    assert asset.triangles == 12
    assert len(box["POSITION"]) == 24, "each corner belongs to three sides"
    corners = box["POSITION"][box["indices"].reshape(-1, 3)]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    assert np.allclose(box["NORMAL"][box["indices"].reshape(-1, 3)], across[:, None, :], atol=1e-6)


def test_a_cylinder_keeps_a_round_side_and_flat_ends(tmp_path: Path) -> None:
    asset, _ = prepare(tmp_path, exported(trimesh.creation.cylinder(0.1, 0.5, sections=96), "ply"), "pin.ply")
    pin = Glb(asset.content).meshes["mesh"]
    upright = np.abs(pin["NORMAL"][:, 2])
    assert set(np.round(upright, 2)) == {0.0, 1.0}
    side = upright < 0.5
    assert np.allclose(pin["NORMAL"][side, :2], pin["POSITION"][side, :2] / 0.1, atol=0.04)


def test_a_small_mesh_gets_fewer_triangles_than_a_large_one() -> None:
    sizes = [
        simplification.budget(np.array(((0.0, 0.0, 0.0), (size, 0.0, 0.0)))) for size in (0.01, 0.1, 0.25, 0.5, 3.0)
    ]
    assert sizes == [4_000, 8_000, 20_000, 40_000, 40_000]


def test_units_and_up_axis_of_the_file_are_applied(tmp_path: Path) -> None:
    box = exported(trimesh.creation.box((100.0, 200.0, 300.0)), "dae").decode()
    box = box.replace("<up_axis>Y_UP</up_axis>", '<unit meter="0.001"/><up_axis>Y_UP</up_axis>')
    asset, _ = prepare(tmp_path, box, "box.dae")
    glb = Glb(asset.content)
    assert np.allclose(np.ptp(glb.meshes["mesh"]["POSITION"], axis=0), (0.1, 0.3, 0.2))
    # Other programs use y up, and rotate the model at the root node.
    assert np.allclose(glb.json["nodes"][0]["rotation"], (-np.sqrt(0.5), 0, 0, np.sqrt(0.5)))


# ------------------------------------------------------------------------------------------------ colours
def painted() -> trimesh.Trimesh:
    """Return a ball that is red above and grey below."""
    ball: trimesh.Trimesh = BALL.copy()
    above = ball.triangles_center[:, 2:] > 0
    colours = np.where(above, [[200, 30, 30, 255]], [[128, 128, 128, 255]]).astype(np.uint8)
    ball.visual = trimesh.visual.ColorVisuals(ball, face_colors=colours)
    return ball


def test_simplification_keeps_face_colours_in_place(tmp_path: Path) -> None:
    content = exported(painted(), "ply")
    asset, _ = prepare(tmp_path, content, "ball.ply")
    ball = Glb(asset.content).meshes["mesh"]
    assert asset.triangles <= MAX_OF_BALL
    red, grey = linear_of((np.array(((200, 30, 30), (128, 128, 128))) / 255).astype(np.float32))
    height = ball["POSITION"][:, 2]
    assert np.allclose(ball["COLOR_0"][height > 0.004, :3], red, atol=1e-3)
    assert np.allclose(ball["COLOR_0"][height < -0.004, :3], grey, atol=1e-3)
    assert np.all(ball["COLOR_0"][:, 3] == 1.0)


def test_collada_materials_become_colours_except_default_grey(tmp_path: Path) -> None:
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    assert "COLOR_0" not in Glb(prepare(tmp_path, exported(box, "obj"), "box.obj")[0].content).meshes["mesh"]
    black = exported(box, "dae").decode()
    assert "COLOR_0" not in Glb(prepare(tmp_path, black, "box.dae")[0].content).meshes["mesh"]
    diffuse = re.compile(r"(<diffuse>\s*<color>)[^<]*")
    asset, _ = prepare(tmp_path, diffuse.sub(r"\g<1>0.0392 0.7843 0.0392 1.0", black), "box.dae")
    colours = Glb(asset.content).meshes["mesh"]["COLOR_0"]
    green = linear_of((np.array((10, 200, 10)) / 255).astype(np.float32))
    assert np.allclose(colours[:, :3], green, atol=4e-3)


def test_triangles_of_two_colours_share_an_edge_without_a_gap() -> None:
    grid = trimesh.creation.box((1, 1, 1)).subdivide().subdivide()
    left = grid.triangles_center[:, 0] < 0
    vertices = grid.vertices[grid.faces].reshape(-1, 3)
    colours = np.repeat(np.where(left[:, None], (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), 3, axis=0).astype(np.float32)
    drawn = simplification.with_normals(
        simplification.simplified(Surface(vertices, np.arange(len(vertices)).reshape(-1, 3), colours), 10**6)
    )
    assert drawn.colours is not None
    assert {tuple(each) for each in drawn.colours.tolist()} == {(65535, 0, 0, 65535), (0, 0, 65535, 65535)}
    of_triangle = drawn.colours[drawn.triangles]
    assert (of_triangle == of_triangle[:, :1]).all(), "no triangle has two colours"
    whole = trimesh.Trimesh(drawn.positions, drawn.triangles, process=False)
    whole.merge_vertices(merge_norm=True)
    assert whole.is_watertight


# ------------------------------------------------------------------------------------------------ robots
URDF = """<robot name="boxy">
  <link name="base"><visual><geometry><mesh filename="package://boxy/meshes/base.stl"/></geometry></visual></link>
  <link name="arm">
    <visual><geometry><mesh filename="package://boxy/meshes/arm.dae" scale="2 2 2"/></geometry></visual>
    <visual><geometry><mesh filename="meshes/base.stl"/></geometry></visual>
    <visual><geometry><mesh filename="meshes/broken.stl"/></geometry></visual>
    <visual><geometry><mesh filename="meshes/gone.stl"/></geometry></visual>
    <collision><geometry><mesh filename="meshes/only_for_collisions.stl"/></geometry></collision>
  </link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


def packed(**files: bytes | str) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name.replace("__", "/").replace("_dot_", "."), content)
    return out.getvalue()


def boxy(urdf: str = URDF) -> bytes:
    return packed(
        boxy__boxy_dot_urdf=urdf,
        boxy__meshes__base_dot_stl=exported(BALL, "stl"),
        boxy__meshes__arm_dot_dae=exported(trimesh.creation.box((0.1, 0.2, 0.3)), "dae"),
        boxy__meshes__broken_dot_stl=b"solid but not really",
    )


def test_a_robot_has_a_description_and_one_mesh_per_visual_file(tmp_path: Path) -> None:
    asset, _ = prepare(tmp_path, boxy(), "boxy.zip")
    glb = Glb(asset.content)
    assert glb.extras["urdf"] == URDF
    assert glb.extras["meshes"] == {
        "package://boxy/meshes/base.stl": "boxy/meshes/base.stl",
        "package://boxy/meshes/arm.dae": "boxy/meshes/arm.dae",
        "meshes/base.stl": "boxy/meshes/base.stl",
    }
    assert set(glb.meshes) == {"boxy/meshes/base.stl", "boxy/meshes/arm.dae"}
    # As in robot descriptions: the URDF states the scale, and the axes are those of the file.
    assert np.allclose(np.ptp(glb.meshes["boxy/meshes/arm.dae"]["POSITION"], axis=0), (0.1, 0.2, 0.3))
    assert set(glb.extras["problems"]) == {"meshes/broken.stl", "meshes/gone.stl"}
    assert "broken.stl" in glb.extras["problems"]["meshes/broken.stl"]
    assert "gone.stl is missing" in glb.extras["problems"]["meshes/gone.stl"]
    assert asset.problems == list(glb.extras["problems"].values())
    assert asset.before == TRIANGLES_OF_BALL + 12


def test_the_meshes_of_a_robot_share_one_triangle_budget(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_functions, "MAX_TRIANGLES_OF_ROBOT", 20_000)
    names = [f"m{number}" for number in range(4)]
    links = "".join(
        f'<link name="{name}"><visual><geometry><mesh filename="{name}.stl"/></geometry></visual></link>'
        for name in names
    )
    ball = exported(BALL, "stl")
    files = {f"{name}_dot_stl": ball for name in names}
    asset, _ = prepare(tmp_path, packed(r_dot_urdf=f'<robot name="r">{links}</robot>', **files), "r.zip")
    assert asset.before == 4 * TRIANGLES_OF_BALL
    assert 19_000 <= asset.triangles <= 20_000


def test_a_robot_of_primitive_shapes_needs_no_mesh_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "trimesh", None)
    plain = '<robot name="r"><link name="a"><visual><geometry><sphere radius="1"/></geometry></visual></link></robot>'
    glb = Glb(prepare(tmp_path, plain, "r.urdf")[0].content)
    assert (glb.extras["urdf"], glb.meshes) == (plain, {})
    glb = Glb(prepare(tmp_path, boxy(), "boxy.zip")[0].content)
    assert "trimesh" in glb.extras["problems"]["meshes/base.stl"]


# ------------------------------------------------------------------------------------------------ refusals
@pytest.mark.parametrize(
    ("content", "name", "kind", "words"),
    [
        (b"solid nothing", "part.stl", BadMesh, "part.stl"),
        (b"", "part.stl", BadMesh, "part.stl"),
        (b"anything", "part.step", BadMesh, "format of the mesh part.step is unknown"),
        (b"v 0 0 0\nv 0 0 0\nv 1 1 1\nf 1 2 3\n", "line.obj", BadMesh, "mesh line.obj have zero area"),
        (b"PK\3\4 but no archive", "arm.zip", ModelError, "arm.zip is not a zip"),
        (packed(a_dot_txt="x"), "arm.zip", ModelError, "arm.zip has no URDF file"),
        (b"<robot><link</robot>", "arm.urdf", ModelError, "arm.urdf is not valid XML"),
        (b"<sdf><robot/></sdf>", "arm.urdf", ModelError, "describes a sdf, not a robot"),
        (b'<!DOCTYPE r [<!ENTITY a "a">]><robot/>', "arm.urdf", UnsafeDescription, "document type"),
        (packed(r_dot_urdf='<robot name="r"/>', **{"..__out": "x"}), "arm.zip", UnsafeDescription, "outside"),
    ],
)
def test_unsupported_visuals_are_refused_by_name(
    content: bytes, name: str, kind: type[Exception], words: str, tmp_path: Path
) -> None:
    with pytest.raises(kind, match=words):
        prepare(tmp_path, content, name)


def test_a_missing_mesh_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadMesh, match=r"gone\.stl cannot be read"):
        prepared(PrepareAsset(StoredFile(str(tmp_path / "none"), "gone.stl")), WorkerState(lambda *_: None))


def test_the_prepared_file_depends_only_on_the_asset(tmp_path: Path) -> None:
    """The file contains no times, so that its cache tag depends only on the asset."""
    content = exported(painted(), "ply")
    assert prepare(tmp_path, content, "a.ply")[0].content == prepare(tmp_path, content, "a.ply")[0].content
