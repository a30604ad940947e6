"""Shapes of bodies, in m, around their own origin: coal geometries for collision checks, triangles for display."""

from dataclasses import dataclass
from typing import Any, Final, Literal

import msgspec
import numpy as np
import numpy.typing as npt

from arcor2_hw.data import object_type
from arcor2_hw.kinematics.errors import BadMesh, ZeroLength
from arcor2_hw.kinematics.primitives import Box, Capsule, Cylinder, Sphere, primitive_of
from arcor2_hw.messages import Message

__all__ = [
    "Array",
    "Box",
    "Capsule",
    "Cylinder",
    "Hull",
    "MeshUse",
    "Shape",
    "Sphere",
    "TriangleMesh",
    "Triangles",
    "check",
    "coal_geometry",
    "extent",
    "hull_of",
    "of_model",
    "triangles_of",
]

Array = npt.NDArray[np.float64]
Triangles = npt.NDArray[np.int64]
MeshUse = Literal["hull", "exact"]

_SIDES: Final = 24
_TINY: Final = 1e-9


@dataclass(frozen=True, eq=False)
class Hull:
    """Convex hull: vertices (n, 3) in m, triangles (m, 3) that wind counter-clockwise seen from outside."""

    vertices: Array
    triangles: Triangles


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangle surface: vertices (n, 3) in m, triangles (m, 3). A body enclosed by it is not in contact with it."""

    vertices: Array
    triangles: Triangles


Shape = Box | Cylinder | Capsule | Sphere | Hull | TriangleMesh


def check(shape: Shape, what: str | Message) -> None:
    """Require finite sizes above zero.

    Args:
        shape: The shape to check.
        what: Name of the shape in the error message.

    Raises:
        ZeroLength: A size is not a finite number above zero.
    """
    if isinstance(shape, Hull | TriangleMesh):
        return
    for name, value in msgspec.structs.asdict(shape).items():
        if not (np.isfinite(value) and value > _TINY) and not (isinstance(shape, Capsule) and name == "length"):
            raise ZeroLength(
                "{what}: {name} of a {type} must be above zero, not {value!r}.",
                what=what,
                name=name,
                type=type(shape).__name__.lower(),
                value=value,
            )


def hull_of(vertices: Array, what: str | Message) -> Hull:
    """Compute the convex hull of points (n, 3).

    Raises:
        BadMesh: All points are in one plane; the message names `what`.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        found = ConvexHull(vertices)
    except (QhullError, ValueError) as error:
        raise BadMesh("{what} is flat and has no volume.", str(error).splitlines()[0], what=what) from error
    number = np.full(len(vertices), -1)
    number[found.vertices] = np.arange(len(found.vertices))
    triangles = number[found.simplices]
    points = vertices[found.vertices]
    first, second, third = (points[triangles[:, corner]] for corner in range(3))
    inward = (np.cross(second - first, third - first) * found.equations[:, :3]).sum(axis=1) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    return Hull(points, triangles)


def of_model(model: object_type.Models, mesh: TriangleMesh | None = None, use: MeshUse = "hull") -> Shape:
    """Return the shape of a collision model of the protocol.

    Args:
        model: The collision model.
        mesh: The mesh read from the model's asset; required for a Mesh.
        use: Whether a mesh is used as it is or as its convex hull.

    Raises:
        BadMesh: The mesh is missing, or it is flat and its hull is wanted.
    """
    if not isinstance(model, object_type.Mesh):
        return primitive_of(model)
    if mesh is None:
        raise BadMesh("The mesh {asset_id} of {id} was not read.", asset_id=model.asset_id, id=model.id)
    return mesh if use == "exact" else hull_of(mesh.vertices, Message.of("The mesh {path}", path=model.asset_id))


def triangles_of(shape: Shape) -> TriangleMesh:
    """Return the surface of a shape as triangles that wind counter-clockwise seen from outside.

    Cylinders and capsules get 24 sides.
    """
    import trimesh

    made: Any
    match shape:
        case TriangleMesh():
            return shape
        case Hull():
            return TriangleMesh(shape.vertices, shape.triangles)
        case Box():
            made = trimesh.creation.box((shape.x, shape.y, shape.z))
        case Cylinder():
            made = trimesh.creation.cylinder(shape.radius, shape.length, sections=_SIDES)
        case Capsule():
            made = trimesh.creation.capsule(shape.length, shape.radius, count=(_SIDES, _SIDES))
            made.apply_translation(-np.mean(made.bounds, axis=0))
        case Sphere():
            made = trimesh.creation.icosphere(3, shape.radius)
    return TriangleMesh(np.asarray(made.vertices, dtype=np.float64), np.asarray(made.faces, dtype=np.int64))


def extent(shape: Shape) -> Array:
    """Return the lower and upper corner (2, 3) of the axis-aligned bounding box of a shape, m."""
    match shape:
        case Box():
            half = np.array((shape.x, shape.y, shape.z)) / 2.0
        case Cylinder():
            half = np.array((shape.radius, shape.radius, shape.length / 2.0))
        case Capsule():
            half = np.array((shape.radius, shape.radius, shape.length / 2.0 + shape.radius))
        case Sphere():
            half = np.full(3, shape.radius)
        case _:
            return np.array((shape.vertices.min(axis=0), shape.vertices.max(axis=0)))
    return np.array((-half, half))


def coal_geometry(shape: Shape) -> Any:
    """Return coal's geometry of a shape: a primitive, a convex hull, or a tree of triangles for a mesh."""
    import coal

    match shape:
        case Box():
            return coal.Box(shape.x, shape.y, shape.z)
        case Cylinder():
            return coal.Cylinder(shape.radius, shape.length)
        case Capsule():
            return coal.Capsule(shape.radius, shape.length)
        case Sphere():
            return coal.Sphere(shape.radius)
        case Hull() | TriangleMesh():
            tree = coal.BVHModelOBBRSS()
            tree.beginModel(len(shape.triangles), len(shape.vertices))
            tree.addVertices(np.ascontiguousarray(shape.vertices))
            tree.addTriangles(np.ascontiguousarray(shape.triangles, dtype=np.int32))
            tree.endModel()
            if isinstance(shape, TriangleMesh):
                return tree
            tree.buildConvexRepresentation(False)
            return tree.convex
