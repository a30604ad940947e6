"""Models of parts and settings of a crate: invalid ones are refused and named."""

from pathlib import Path
from typing import Any

import pytest

from arcor2_drivers.bin_picking.bin import Bin
from arcor2_drivers.bin_picking.settings import BinSettings
from arcor2_hw.data.device import Connection
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import NotConnected, OutOfRange

STL = """solid part
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex {0} 0 0
vertex 0 {1} 0
endloop
endfacet
endsolid
"""


def connect(mesh: str) -> Bin:
    crate = Bin("id", "crate", Pose(), BinSettings(0.3, 0.2, 0.1, part_mesh=mesh))
    crate.connect()
    return crate


@pytest.mark.parametrize(
    ("name", "text", "problem"),
    [
        ("part.stl", STL.format(80, 40), "80 m long, at most 1 m are allowed: is it in millimetres"),
        ("part.stl", STL.format(0.08, 0.001), "3 m|0.08 m long; two sides must be at least 0.003 m"),
        ("part.stl", STL.format("nan", 0.04), "vertices that are not finite|has no triangles"),
        ("part.stl", "solid part\nendsolid\n", "has no triangles"),
        ("part.step", "ISO-10303-21;", r"must be one of \.stl, \.obj, \.ply"),
        ("part.obj", "v 0 0 0\nv nan 0 0\nv 0 0.1 0\nf 1 2 3\n", "vertices that are not finite|has no triangles"),
    ],
)
def test_invalid_meshes_are_refused(tmp_path: Path, name: str, text: str, problem: str) -> None:
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(NotConnected, match=f"^crate: part_mesh .*({problem})"):
        connect(str(file))


def test_missing_and_oversized_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(NotConnected, match=r"^crate: part_mesh .*missing\.stl cannot be read: No such file"):
        connect(str(tmp_path / "missing.stl"))
    with (tmp_path / "large.stl").open("wb") as file:
        file.truncate(20_000_001)
    with pytest.raises(NotConnected, match=r"large\.stl has 20000001 bytes"):
        connect(str(tmp_path / "large.stl"))


def test_a_mesh_with_too_many_triangles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import open3d as o3d

    from arcor2_drivers.bin_picking import models

    assert models.MAX_TRIANGLES == 200_000
    monkeypatch.setattr(models, "MAX_TRIANGLES", 11)
    mesh = o3d.geometry.TriangleMesh.create_box(0.1, 0.1, 0.1)
    mesh.compute_triangle_normals()
    o3d.io.write_triangle_mesh(str(tmp_path / "fine.stl"), mesh)
    with pytest.raises(NotConnected, match="has 12 triangles, at most 11 are allowed"):
        connect(str(tmp_path / "fine.stl"))


def test_a_bin_connects_and_disconnects() -> None:
    crate = Bin("id", "crate", Pose(), BinSettings(0.3, 0.2, 0.1, 0.05, 0.04, 0.03))
    assert crate.connection is Connection.OFFLINE
    crate.connect()
    crate.connect()
    assert crate.connection is Connection.ONLINE
    crate.disconnect()
    assert crate.connection is Connection.OFFLINE


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"length": 0.0}, "length"),
        ({"width": float("nan")}, "width"),
        ({"height": 9.0}, "height"),
        ({"part_length": 0.0}, "part_length"),
        ({"part_height": 2.0}, "part_height"),
        ({"part_mesh": "part.stl"}, "part_mesh"),
        ({"min_quality": 0.0}, "min_quality"),
        ({"tolerance": 0.1}, "tolerance"),
        ({"grip_depth": -0.1}, "grip_depth"),
        ({"max_age": 0.0}, "max_age"),
    ],
)
def test_settings_are_checked(wrong: dict[str, Any], named: str) -> None:
    right = {
        "length": 0.3,
        "width": 0.2,
        "height": 0.1,
        "part_length": 0.05,
        "part_width": 0.04,
        "part_height": 0.03,
    }
    with pytest.raises(OutOfRange, match=f"^{named} must be"):
        BinSettings(**{**right, **wrong})
