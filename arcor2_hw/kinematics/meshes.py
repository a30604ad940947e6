"""Mesh files: STL, OBJ, PLY, OFF, COLLADA and binary glTF. Sizes are checked before parsing, content after it."""

import io
import json
import re
import struct
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arcor2_hw.kinematics.errors import BadMesh
from arcor2_hw.kinematics.model_package import MAX_MESH
from arcor2_hw.kinematics.shapes import Array, TriangleMesh, Triangles

MAX_TRIANGLES: Final = 1_000_000
KINDS: Final = ("stl", "obj", "ply", "off", "dae", "glb")
_MAGIC: Final = ((b"glTF", "glb"), (b"ply\n", "ply"), (b"ply\r", "ply"), (b"OFF", "off"))
_UNIT: Final = re.compile(rb"<unit\b[^>]*?\bmeter\s*=\s*[\"']([^\"']*)[\"']")
_UP: Final = re.compile(rb"<up_axis>\s*([XYZ])_UP\s*</up_axis>")
_Z_FROM_UP: Final = {
    "X": np.array(((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0))),
    "Y": np.array(((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))),
}
"""Rotations from the named up axis to z up. With X_UP in COLLADA, y points left and z towards the viewer."""
_FARTHEST: Final = 1e4
"""Maximum coordinate of a vertex, m; larger ones mean wrong units."""
_NO_COLOUR: Final = ((102, 102, 102, 255),)
"""Colour that trimesh uses where a file has none."""


class Surface(NamedTuple):
    """A mesh for display.

    Attributes:
        vertices: (n, 3), m.
        triangles: (m, 3).
        colours: (n, 3), red, green and blue in sRGB from 0 to 1, or None.
    """

    vertices: Array
    triangles: Triangles
    colours: NDArray[np.float32] | None


def kind_of(content: bytes, name: str) -> str:
    """Return the format of a mesh: by its first bytes, otherwise by the extension of its name.

    Raises:
        BadMesh: The format is unknown.
    """
    for magic, kind in _MAGIC:
        if content.startswith(magic):
            return kind
    if b"<COLLADA" in content[:4096]:
        return "dae"
    ending = name.rsplit(".", 1)[-1].lower()
    if ending in KINDS:
        return ending
    binary = len(content) >= 84 and len(content) == 84 + 50 * int(struct.unpack_from("<I", content, 80)[0])
    if binary or content.startswith(b"solid"):
        return "stl"
    raise BadMesh("The format of the mesh {name} is unknown. Supported are {kinds}.", name=name, kinds=", ".join(KINDS))


def read_mesh(
    content: bytes, name: str, scale: tuple[float, float, float] = (1.0, 1.0, 1.0), *, upright: bool = True
) -> TriangleMesh:
    """Read the triangles of a mesh file.

    The unit of a COLLADA file is applied.

    Args:
        content: The file.
        name: Name of the file in messages.
        scale: Factor of each axis.
        upright: Whether the up axis of COLLADA and glTF is rotated to z. URDF expects the axes of the file.

    Raises:
        BadMesh: The format is unknown, the file is larger than 64 MiB or a million triangles, damaged or empty, or has
            coordinates that are not finite or beyond 10 km. The message names the file.
    """
    kind = _checked_format(content, name, MAX_MESH)
    vertices, triangles = _parse(content, kind, name)
    vertices = _checked(vertices * _unit(content, kind, name), triangles, name, MAX_TRIANGLES)
    if upright:
        vertices = _turned(vertices, content, kind)
    scaled = vertices * np.asarray(scale)
    _refuse_far(scaled[np.unique(triangles)], name)
    if np.prod(scale) < 0.0:  # a mirrored mesh needs the opposite winding
        triangles = triangles[:, ::-1]
    return TriangleMesh(np.ascontiguousarray(scaled), np.ascontiguousarray(triangles))


def read_surface(content: bytes, name: str, *, upright: bool, most_bytes: int, most_triangles: int) -> Surface:
    """Read a mesh file for display, with its colours; textures are sampled at the vertices.

    Files that it refers to are not read.

    Args:
        content: The file.
        name: Name of the file in messages.
        upright: Whether the up axis of COLLADA and glTF is rotated to z.
        most_bytes: Maximum size, bytes.
        most_triangles: Maximum number of triangles.

    Raises:
        BadMesh: As in `read_mesh`.
    """
    kind = _checked_format(content, name, most_bytes)
    vertices, triangles, colours = _parse_coloured(content, kind, name)
    vertices = _checked(vertices * _unit(content, kind, name), triangles, name, most_triangles)
    _refuse_far(vertices[np.unique(triangles)], name)
    return Surface(_turned(vertices, content, kind) if upright else vertices, triangles, colours)


# ------------------------------------------------------------------------------------------------ reading
def _parse(content: bytes, kind: str, name: str) -> tuple[Array, Triangles]:
    import trimesh

    try:
        whole = trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False, skip_materials=True).to_mesh()
        vertices = np.asarray(whole.vertices, dtype=np.float64).reshape(-1, 3)
        return vertices, np.asarray(whole.faces, dtype=np.int64).reshape(-1, 3)
    except Exception as error:
        raise BadMesh(
            "The mesh {name} is damaged or not a mesh.", f"{type(error).__name__}: {error}", name=name
        ) from error


def _parse_coloured(content: bytes, kind: str, name: str) -> tuple[Array, Triangles, NDArray[np.float32] | None]:
    import trimesh

    try:
        scene = trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False)
        meshes = [each for each in scene.dump() if isinstance(each, trimesh.Trimesh) and len(each.faces)]
        parts = [_part(mesh, linear=kind == "glb") for mesh in meshes]
    except Exception as error:
        raise BadMesh(
            "The mesh {name} is damaged or not a mesh.", f"{type(error).__name__}: {error}", name=name
        ) from error
    if not parts:
        raise BadMesh("The mesh {name} has no triangles.", name=name)
    starts = np.cumsum([0, *(len(vertices) for vertices, _, _ in parts)])
    vertices = np.concatenate([vertices for vertices, _, _ in parts])
    triangles = np.concatenate([faces + start for (_, faces, _), start in zip(parts, starts, strict=False)])
    if all(colours is None for _, _, colours in parts):
        return vertices, triangles, None
    plain = np.full(3, 0.75, dtype=np.float32)
    colours = [np.broadcast_to(plain if given is None else given, (len(at), 3)) for at, _, given in parts]
    together = np.concatenate(colours)
    # Programs without colours write black, so a mesh that is all black counts as having none.
    return vertices, triangles, together if together.any() else None


def _part(mesh: Any, *, linear: bool) -> tuple[Array, Triangles, NDArray[np.float32] | None]:
    """Return vertices, triangles and colours (n, 3) or (3,) of one mesh of a file."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    faces = np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)
    visual, given = mesh.visual, None
    if visual.kind == "texture":
        given, linear = _textured(visual, linear)
    elif visual.kind == "face" and len(visual.face_colors) == len(faces):
        vertices = vertices[faces].reshape(-1, 3)
        faces = np.arange(len(vertices), dtype=np.int64).reshape(-1, 3)
        given = np.repeat(np.asarray(visual.face_colors), 3, axis=0)
    elif visual.kind == "vertex" and len(visual.vertex_colors) == len(vertices):
        given = np.asarray(visual.vertex_colors)
    if given is None or not np.isfinite(given).all():
        return vertices, faces, None
    colours = np.clip(given[..., :3].astype(np.float32) / 255.0, 0.0, 1.0)
    return vertices, faces, srgb(colours) if linear else colours


def _textured(visual: Any, linear: bool) -> tuple[NDArray[Any] | None, bool]:
    """Return the colours of a material, and whether they are linear, as glTF factors are but glTF textures are not."""
    material = visual.material
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    if image is not None and visual.uv is not None and len(visual.uv):
        return np.asarray(visual.to_color().vertex_colors), False
    if hasattr(material, "baseColorFactor") and material.baseColorFactor is None:
        return None, linear
    colour = np.asarray(material.main_color)
    return (None if tuple(colour.tolist()) in _NO_COLOUR else colour), linear


def srgb(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """Convert linear colours, 0 to 1, to sRGB (IEC 61966-2-1)."""
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.power(linear, 1 / 2.4) - 0.055).astype(np.float32)


def linear_of(colours: NDArray[np.float32]) -> NDArray[np.float32]:
    """Convert sRGB colours, 0 to 1, to linear."""
    return np.where(colours <= 0.04045, colours / 12.92, np.power((colours + 0.055) / 1.055, 2.4)).astype(np.float32)


# ------------------------------------------------------------------------------------------------ checks
def _checked_format(content: bytes, name: str, most_bytes: int) -> str:
    """Return the format of a mesh that is safe to parse."""
    kind = kind_of(content, name)
    if len(content) > most_bytes:
        raise BadMesh(
            "The mesh {name} has {count} bytes; the maximum is {most_bytes}.",
            name=name,
            count=len(content),
            most_bytes=most_bytes,
        )
    if kind == "dae":
        _refuse_entities(content, name)
    if kind == "glb":
        _refuse_compressed(content, name)
    return kind


def _checked(vertices: Array, triangles: Triangles, name: str, most_triangles: int) -> Array:
    """Return the vertices. Unused vertices are replaced by finite ones."""
    if not len(triangles):
        raise BadMesh("The mesh {name} has no triangles.", name=name)
    if len(triangles) > most_triangles:
        raise BadMesh(
            "The mesh {name} has {count} triangles; the maximum is {most_triangles}.",
            name=name,
            count=len(triangles),
            most_triangles=most_triangles,
        )
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise BadMesh("The mesh {name} has triangles that refer to missing vertices.", name=name)
    if not np.isfinite(vertices[np.unique(triangles)]).all():
        raise BadMesh("The mesh {name} has vertices that are not finite.", name=name)
    return np.where(np.isfinite(vertices), vertices, 0.0)


def _refuse_far(used: Array, name: str) -> None:
    if np.abs(used).max() > _FARTHEST:
        raise BadMesh("The mesh {name} extends beyond {farthest:g} m. Check its units.", name=name, farthest=_FARTHEST)


def _refuse_entities(content: bytes, name: str) -> None:
    """Reject XML entities, which could make a parser read other files or expand without bounds."""
    if b"\0" in content[:4096]:
        raise BadMesh("The mesh {name} must be encoded in UTF-8.", name=name)
    lowered = content.lower()
    if b"<!doctype" in lowered or b"<!entity" in lowered:
        raise BadMesh("The mesh {name} has a document type, which is not allowed. Remove it.", name=name)


def _refuse_compressed(content: bytes, name: str) -> None:
    """Reject compressed glTF by its list of required extensions."""
    try:
        (length,) = struct.unpack_from("<I", content, 12)
        required = json.loads(content[20 : 20 + length]).get("extensionsRequired", [])
    except (struct.error, ValueError, AttributeError, RecursionError):
        return  # the parser reports the error
    packed = {"KHR_draco_mesh_compression", "EXT_meshopt_compression"} & {str(each) for each in required}
    if packed:
        raise BadMesh(
            "The mesh {name} is compressed ({packed}), which is not supported. Export it without compression.",
            name=name,
            packed=", ".join(sorted(packed)),
        )


def _unit(content: bytes, kind: str, name: str) -> float:
    """Return the unit of a COLLADA file in m; 1 for other formats."""
    if kind != "dae":
        return 1.0
    found = _UNIT.search(content)
    try:
        unit = float(found[1]) if found else 1.0
    except ValueError:
        unit = 0.0
    if not 1e-6 <= unit <= 1e3:
        raise BadMesh("The mesh {name} has an invalid unit.", name=name)
    return unit


def _turned(vertices: Array, content: bytes, kind: str) -> Array:
    """Return vertices with z up; glTF, and COLLADA without an up axis, have y up."""
    if kind not in ("dae", "glb"):
        return vertices
    found = _UP.search(content) if kind == "dae" else None
    axis = found[1].decode() if found else "Y"
    return vertices if axis == "Z" else vertices @ _Z_FROM_UP[axis].T
