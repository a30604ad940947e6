"""Meshes from files: bounded before they are parsed, checked after; STL, OBJ, PLY, OFF and COLLADA."""

import io
import re
from typing import Final

import numpy as np

from arcor2_hw.kinematics.errors import BadMesh
from arcor2_hw.kinematics.shapes import Array, TriangleMesh, Triangles
from arcor2_hw.kinematics.source import MAX_MESH

MAX_TRIANGLES: Final = 1_000_000
KINDS: Final = ("stl", "obj", "ply", "off", "dae")
_UNIT: Final = re.compile(rb"<unit\b[^>]*?\bmeter\s*=\s*[\"']([^\"']*)[\"']")
_FARTHEST: Final = 1e4
"""m: a vertex farther away than that is a mistake in the units at least."""


def read_mesh(content: bytes, name: str, scale: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> TriangleMesh:
    """Give the triangles of a mesh file, each axis multiplied by `scale`; `name` tells its kind by its ending.

    Of COLLADA the unit is heeded and the up axis is not, as robots' descriptions have come to expect.

    Raises BadMesh naming the file: not of a known kind, larger than 64 MiB or a million triangles, damaged, empty,
    with numbers that are not finite or farther than 10 km.
    """
    kind = name.rsplit(".", 1)[-1].lower()
    if kind not in KINDS:
        raise BadMesh(f"The mesh {name} is of no kind that is known: {', '.join(KINDS)}.")
    if len(content) > MAX_MESH:
        raise BadMesh(f"The mesh {name} has {len(content)} bytes; at most {MAX_MESH} are taken.")
    unit = 1.0
    if kind == "dae":
        _refuse_entities(content, name)
        unit = _unit(content, name)
    vertices, triangles = _parse(content, kind, name)
    vertices = vertices * unit
    if not len(triangles):
        raise BadMesh(f"The mesh {name} has no triangles.")
    if len(triangles) > MAX_TRIANGLES:
        raise BadMesh(f"The mesh {name} has {len(triangles)} triangles; at most {MAX_TRIANGLES} are taken.")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise BadMesh(f"The mesh {name} has triangles of vertices that it does not have.")
    used = vertices[np.unique(triangles)]
    if not np.isfinite(used).all():
        raise BadMesh(f"The mesh {name} has vertices that are not finite numbers.")
    scaled = np.where(np.isfinite(vertices), vertices, 0.0) * np.asarray(scale)
    if np.abs(used * np.asarray(scale)).max() > _FARTHEST:
        raise BadMesh(f"The mesh {name} reaches farther than {_FARTHEST:g} m; are its units right?")
    if np.prod(scale) < 0.0:  # mirrored: what was outside must not become inside
        triangles = triangles[:, ::-1]
    return TriangleMesh(np.ascontiguousarray(scaled), np.ascontiguousarray(triangles))


def _parse(content: bytes, kind: str, name: str) -> tuple[Array, Triangles]:
    import trimesh

    try:
        whole = trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False, skip_materials=True).to_mesh()
        vertices = np.asarray(whole.vertices, dtype=np.float64).reshape(-1, 3)
        return vertices, np.asarray(whole.faces, dtype=np.int64).reshape(-1, 3)
    except Exception as error:
        raise BadMesh(f"The mesh {name} is damaged, or is none.", f"{type(error).__name__}: {error}") from error


def _refuse_entities(content: bytes, name: str) -> None:
    """Refuse what makes an XML parser read other files or grow without bounds."""
    if b"\0" in content[:4096]:
        raise BadMesh(f"The mesh {name} must be encoded in UTF-8.")
    lowered = content.lower()
    if b"<!doctype" in lowered or b"<!entity" in lowered:
        raise BadMesh(f"The mesh {name} has a document type, which is refused.")


def _unit(content: bytes, name: str) -> float:
    """Give the metres of a COLLADA file's unit."""
    found = _UNIT.search(content)
    try:
        unit = float(found[1]) if found else 1.0
    except ValueError:
        unit = 0.0
    if not 1e-6 <= unit <= 1e3:
        raise BadMesh(f"The mesh {name} has a unit that is none.")
    return unit
