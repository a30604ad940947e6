"""Invalid descriptions, packages and meshes are refused by kind and name."""

import io
import random
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from arcor2_hw.kinematics import meshes, model_package
from arcor2_hw.kinematics.errors import BadMesh, JointLoop, MissingMesh, ModelError, UnsafeDescription, ZeroLength
from arcor2_hw.kinematics.meshes import read_mesh
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Hull, TriangleMesh
from tests.kinematics.kin_robots import UR, joint, links, urdf

GOOD = links("base", "arm") + joint("j", "base", "arm", xyz="0 0 1")


def with_shape(geometry: str) -> bytes:
    shaped = f'<link name="arm"><collision><geometry>{geometry}</geometry></collision></link>'
    return urdf(links("base") + shaped + joint("j", "base", "arm", xyz="0 0 1"))


def packed(**files: bytes) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name, data in files.items():
            archive.writestr(name.replace("__", "/").replace("_dot_", "."), data)
    return content.getvalue()


def stl(vertices: list[list[float]]) -> bytes:
    """Write a binary STL of the given triangles, valid or not."""
    out = bytes(80) + struct.pack("<I", len(vertices) // 3)
    for at in range(0, len(vertices), 3):
        out += struct.pack("<12fH", 0, 0, 0, *vertices[at], *vertices[at + 1], *vertices[at + 2], 0)
    return out


CUBE = trimesh.creation.box((1.0, 2.0, 3.0))
CUBE_STL: bytes = CUBE.export(file_type="stl")

# ------------------------------------------------------------------------------------------------ descriptions
REFUSED = {
    "no XML": (b"<robot", ModelError, "not valid XML"),
    "nothing": (b"", ModelError, "not valid XML"),
    "another document": (b"<html/>", ModelError, "a html"),
    "a xacro": (b'<robot xmlns:xacro="x"><xacro:arm/></robot>', ModelError, "xacro"),
    "no links": (urdf(""), ModelError, "no links"),
    "nothing moves": (urdf(links("base")), ModelError, "no joint that moves"),
    "a link twice": (urdf(GOOD + links("arm")), ModelError, "link arm is defined twice"),
    "a joint twice": (urdf(GOOD + links("b") + joint("j", "arm", "b")), ModelError, "joint j is defined twice"),
    "a link that does not exist": (urdf(GOOD + joint("k", "arm", "nose")), ModelError, "k refers to the link nose"),
    "two roots": (urdf(GOOD + links("lost")), ModelError, "multiple root links: base, lost"),
    "two parents": (urdf(GOOD + links("b") + joint("k", "base", "b") + joint("l", "arm", "b")), JointLoop, "k and l"),
    "a ring": (
        urdf(links("a", "b", "c") + joint("k", "a", "b") + joint("l", "b", "c") + joint("m", "c", "a")),
        JointLoop,
        "k, l, m form a loop",
    ),
    "a ring beside": (
        urdf(GOOD + links("b", "c") + joint("k", "b", "c") + joint("l", "c", "b")),
        JointLoop,
        "k, l form a loop",
    ),
    "a joint to itself": (urdf(GOOD + links("b") + joint("k", "b", "b")), JointLoop, "k form a loop"),
    "a kind that is not known": (
        urdf(links("base", "arm") + joint("j", "base", "arm", kind="planar")),
        ModelError,
        "j is of type planar",
    ),
    "no limit": (urdf(links("base", "arm") + joint("j", "base", "arm", limit="")), ModelError, "j has no limit"),
    "limits that cross": (
        urdf(links("base", "arm") + joint("j", "base", "arm", limit='<limit lower="1" upper="-1"/>')),
        ModelError,
        "j: its lower limit 1 is above the upper limit -1",
    ),
    "an axis without direction": (
        urdf(links("base", "arm") + joint("j", "base", "arm", axis="0 0 0")),
        ModelError,
        "j has an axis of length zero",
    ),
    "numbers that are none": (
        urdf(links("base", "arm") + joint("j", "base", "arm", xyz="0 nan 0")),
        ModelError,
        "joint j: xyz of origin must be 3 numbers, not '0 nan 0'",
    ),
    "too few numbers": (
        urdf(links("base", "arm") + joint("j", "base", "arm", rpy="0 0")),
        ModelError,
        "joint j: rpy of origin must be 3 numbers",
    ),
    "mimicking nobody": (
        urdf(links("base", "arm") + joint("j", "base", "arm", more='<mimic joint="nobody"/>')),
        ModelError,
        "j mimics nobody",
    ),
    "an entity bomb": (
        b'<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]><robot name="&b;"/>',
        UnsafeDescription,
        "entity",
    ),
    "a file fetched": (
        b'<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot name="&a;"/>',
        UnsafeDescription,
        "entity",
    ),
    "nested without end": (b"<robot>" + b"<a>" * 500, UnsafeDescription, "nested"),
    "links without end": (urdf("".join(f'<link name="{n}"/>' for n in range(2001))), UnsafeDescription, "2001 links"),
    "a cylinder of no length": (with_shape('<cylinder radius="0.1" length="0"/>'), ZeroLength, "arm.*length"),
    "a flat box": (with_shape('<box size="1 0 1"/>'), ZeroLength, "link arm, collision: y of a box"),
    "a ball turned inside out": (with_shape('<sphere radius="-1"/>'), ZeroLength, "radius of a sphere"),
    "a shape that is not known": (with_shape('<torus radius="1"/>'), ModelError, "torus"),
    "a missing mesh": (with_shape('<mesh filename="package://arm/arm.stl"/>'), MissingMesh, "package://arm/arm.stl"),
    "a mesh elsewhere": (with_shape('<mesh filename="http://x/arm.stl"/>'), UnsafeDescription, "http://x/arm.stl"),
    "a mesh above": (with_shape('<mesh filename="../../etc/passwd"/>'), UnsafeDescription, "is outside of"),
    "a mesh above, encoded": (
        with_shape('<mesh filename="package://arm/%2e%2e/%2e%2e/etc/passwd"/>'),
        UnsafeDescription,
        "is outside of",
    ),
    "a mesh at the root": (with_shape('<mesh filename="file:///etc/passwd"/>'), UnsafeDescription, "passwd"),
    "an end effector that is not a link": (
        urdf(GOOD + '<arcor2_hw><end_effector link="nose"/></arcor2_hw>'),
        ModelError,
        "end effector nose",
    ),
    "a setting of nothing": (
        urdf(GOOD + '<arcor2_hw><setting name="s" joint="k" component="x"/></arcor2_hw>'),
        ModelError,
        "joint k does not exist",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_description_is_refused_by_kind_and_name(case: str) -> None:
    content, kind, words = REFUSED[case]
    with pytest.raises(ModelError, match=words) as refused:
        RobotModel.load(content, name="robot.urdf")
    assert type(refused.value) is kind
    assert refused.value.code == kind.code


def test_similar_valid_descriptions_are_accepted() -> None:
    assert RobotModel.load(urdf(GOOD)).joint_names == ("j",)
    assert RobotModel.load(with_shape('<box size="1 1 1"/>')).collision[0].link == "arm"


# ------------------------------------------------------------------------------------------------ packages
def test_invalid_and_unsafe_packages_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ModelError, match=r"no URDF file"):
        RobotModel.load(packed(readme_dot_txt=b""))
    with pytest.raises(ModelError, match=r"2 URDF files: a\.urdf, b\.urdf"):
        RobotModel.load(packed(a_dot_urdf=urdf(GOOD), b_dot_urdf=urdf(GOOD)))
    nested = packed(a_dot_urdf=urdf(GOOD, "top"), deeper__b_dot_urdf=urdf(GOOD, "deep"))
    assert RobotModel.load(nested).name == "top"
    with pytest.raises(UnsafeDescription, match="outside"):
        RobotModel.load(packed(**{"..__evil_dot_urdf": urdf(GOOD)}))
    with pytest.raises(ModelError, match="not a zip archive"):
        RobotModel.load(b"PK\x03\x04" + bytes(100))
    damaged = bytearray(packed(a_dot_urdf=urdf(GOOD)))
    damaged[45] ^= 0xFF
    with pytest.raises(ModelError, match="damaged"):
        RobotModel.load(bytes(damaged))
    with pytest.raises(ModelError, match="Robot model nowhere does not exist"):
        RobotModel.load(tmp_path / "nowhere")
    (tmp_path / "arm").mkdir()
    (tmp_path / "secret").write_text("secret")
    (tmp_path / "arm" / "arm.stl").symlink_to(tmp_path / "secret")
    with pytest.raises(UnsafeDescription, match=r"arm\.stl is a link to a file outside"):
        RobotModel.load(tmp_path / "arm")
    monkeypatch.setattr(model_package, "MAX_PACKAGE", 100)
    with pytest.raises(UnsafeDescription, match="larger than 100 bytes"):
        RobotModel.load(packed(a_dot_urdf=urdf(GOOD)))


def test_every_form_of_mesh_reference_is_resolved() -> None:
    for name in ("package://any/meshes/arm.STL", "meshes/arm.STL", "file:meshes/arm.STL", "package://meshes/arm.STL"):
        content = packed(arm__arm_dot_urdf=with_shape(f'<mesh filename="{name}"/>'), arm__meshes__arm_dot_STL=CUBE_STL)
        (shape,) = RobotModel.load(content).collision
        assert isinstance(shape.shape, Hull)
        assert len(shape.shape.vertices) == 8
        (exact,) = RobotModel.load(content, mesh_use="exact").collision
        assert isinstance(exact.shape, TriangleMesh)


# ------------------------------------------------------------------------------------------------ meshes
@pytest.mark.parametrize("kind", ["stl", "obj", "ply", "off", "dae", "glb"])
def test_a_cube_is_read_and_scaled_in_every_format(kind: str) -> None:
    exported = CUBE.export(file_type=kind)
    content = exported if isinstance(exported, bytes) else exported.encode()
    mesh = read_mesh(content, f"cube.{kind}", (0.001, 0.001, 0.001), upright=False)
    assert np.allclose(mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0), (0.001, 0.002, 0.003), atol=1e-9)
    assert len(mesh.triangles) == 12
    mirrored = read_mesh(content, f"cube.{kind}", (1.0, 1.0, -1.0))
    volume = trimesh.Trimesh(mirrored.vertices, mirrored.triangles, process=False).volume
    assert volume == pytest.approx(6.0)


def test_the_unit_of_a_collada_file_is_applied() -> None:
    exported = CUBE.export(file_type="dae").decode()
    for unit, factor in (
        ('<unit name="inch" meter="0.0254"/>', 0.0254),
        ("<unit meter='1e-3' name='mm'></unit>", 1e-3),
    ):
        mesh = read_mesh(exported.replace("<up_axis>", f"{unit}<up_axis>").encode(), "cube.dae", upright=False)
        assert np.allclose(np.ptp(mesh.vertices, axis=0), np.array((1.0, 2.0, 3.0)) * factor)
    with pytest.raises(BadMesh, match=r"cube\.dae has an invalid unit"):
        read_mesh(exported.replace("<up_axis>", '<unit meter="0"/><up_axis>').encode(), "cube.dae")


@pytest.mark.parametrize(("up", "size"), [("X", (2, 3, 1)), ("Y", (1, 3, 2)), ("Z", (1, 2, 3)), ("", (1, 3, 2))])
def test_the_up_axis_of_a_collada_file_is_applied(up: str, size: tuple[int, int, int]) -> None:
    exported = CUBE.export(file_type="dae").decode()
    assert "<up_axis>Y_UP</up_axis>" in exported
    changed = exported.replace("<up_axis>Y_UP</up_axis>", f"<up_axis>{up}_UP</up_axis>" if up else "")
    mesh = read_mesh(changed.encode(), "cube.dae")
    assert np.allclose(np.ptp(mesh.vertices, axis=0), size)
    assert trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False).volume == pytest.approx(6.0)


def test_binary_gltf_is_recognised_and_has_y_up() -> None:
    mesh = read_mesh(CUBE.export(file_type="glb"), "a cube without an ending")
    assert np.allclose(np.ptp(mesh.vertices, axis=0), (1, 3, 2))


def test_the_format_of_a_mesh_is_detected_from_its_content() -> None:
    assert len(read_mesh(CUBE_STL, "asset_1").triangles) == 12
    assert len(read_mesh(CUBE.export(file_type="ply"), "cube.stl").triangles) == 12


def test_compressed_gltf_is_refused_by_name() -> None:
    content = b'{"asset":{"version":"2.0"},"extensionsRequired":["KHR_draco_mesh_compression"]}'
    head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(content), len(content), 0x4E4F534A)
    with pytest.raises(BadMesh, match=r"c\.glb is compressed \(KHR_draco_mesh_compression\)"):
        read_mesh(head + content, "c.glb")


TRIANGLE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]


@pytest.mark.parametrize(
    ("content", "name", "words"),
    [
        (b"not a mesh", "m.stl", "m.stl is damaged|m.stl has no triangles"),
        (b"", "m.stl", "m.stl"),
        (CUBE_STL[:200], "m.stl", "m.stl"),
        (stl([[0.0, 0.0, float("nan")], *TRIANGLE[1:]]), "m.stl", "m.stl has vertices that are not finite"),
        (stl([[0.0, 0.0, float("inf")], *TRIANGLE[1:]]), "m.stl", "m.stl has vertices that are not finite"),
        (stl([[0.0, 0.0, 1e9], *TRIANGLE[1:]]), "m.stl", "beyond 10000 m"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "m.obj", "m.obj"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "m.obj", "m.obj"),
        (b"x", "m.exe", "format of the mesh m.exe is unknown"),
        (b'<!DOCTYPE C [<!ENTITY a "a">]><COLLADA/>', "m.dae", "document type"),
        ('<?xml version="1.0"?><!DOCTYPE C><COLLADA/>'.encode("utf-16"), "m.dae", "UTF-8"),
    ],
)
def test_a_bad_mesh_is_refused_by_name(content: bytes, name: str, words: str) -> None:
    with pytest.raises(BadMesh, match=words):
        read_mesh(content, name)


def test_an_oversized_mesh_is_refused_before_reading(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "arm.urdf").write_bytes(with_shape('<mesh filename="arm.stl"/>'))
    with (tmp_path / "arm.stl").open("wb") as file:
        file.truncate(2 * 1024**3)  # 2 GB, sparse: they use no disk space
    with pytest.raises(UnsafeDescription, match=r"arm\.stl is larger than"):
        RobotModel.load(tmp_path)
    monkeypatch.setattr(meshes, "MAX_TRIANGLES", 11)
    with pytest.raises(BadMesh, match="12 triangles; the maximum is 11"):
        read_mesh(CUBE_STL, "cube.stl")


def test_an_archive_with_false_sizes_is_read_up_to_the_limit() -> None:
    content = bytearray(packed(a_dot_urdf=b" " * 3_000_000))
    honest = struct.pack("<I", 3_000_000)
    assert content.count(honest) == 4  # compressed and not, in the header and the directory
    package = model_package.Package.open(bytes(content))
    with pytest.raises(UnsafeDescription, match="larger than 1000 bytes"):
        package.read("a.urdf", 1000)
    lying = model_package.Package.open(bytes(content.replace(honest, struct.pack("<I", 500))))
    with pytest.raises(ModelError, match=r"damaged|larger than"):
        lying.read("a.urdf", 1000)


def test_a_flat_mesh_has_no_hull() -> None:
    content = packed(arm_dot_urdf=with_shape('<mesh filename="f.stl"/>'), f_dot_stl=stl(TRIANGLE + TRIANGLE))
    with pytest.raises(BadMesh, match=r"arm, collision: the mesh f\.stl is flat"):
        RobotModel.load(content)
    with pytest.raises(ZeroLength, match="a scale of zero"):
        RobotModel.load(packed(a_dot_urdf=with_shape('<mesh filename="f.stl" scale="1 0 1"/>'), f_dot_stl=CUBE_STL))


# ------------------------------------------------------------------------------------------------ damage
def damaged(content: bytes, chance: random.Random) -> bytes:
    out = bytearray(content)
    for _ in range(chance.choice((1, 2, 5, 30))):
        at = chance.randrange(len(out) + 1)
        match chance.randrange(3):
            case 0:
                out[at : at + 1] = bytes((chance.randrange(256),))
            case 1:
                del out[at : at + chance.randrange(40)]
            case 2:
                out[at:at] = chance.randbytes(chance.randrange(20))
    return bytes(out)


@pytest.mark.parametrize("kind", ["urdf", "zip", "stl", "obj", "ply", "off", "dae", "glb"])
def test_damaged_files_are_read_or_refused(kind: str) -> None:
    chance = random.Random(kind)
    refused = 0
    for _ in range(60):
        try:
            if kind == "urdf":
                RobotModel.load(damaged((UR / "ur5e" / "ur5e.urdf").read_bytes(), chance), name="ur5e.urdf")
            elif kind == "zip":
                whole = packed(a_dot_urdf=with_shape('<mesh filename="c.stl"/>'), c_dot_stl=CUBE_STL)
                RobotModel.load(damaged(whole, chance))
            else:
                exported = CUBE.export(file_type=kind)
                read_mesh(damaged(exported if isinstance(exported, bytes) else exported.encode(), chance), f"m.{kind}")
        except ModelError:
            refused += 1
    assert refused > 10
