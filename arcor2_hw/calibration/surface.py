"""The surface of a robot in one joint configuration, as triangles in its base frame, for comparison with a camera."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.kinematics.shapes import Capsule, Cylinder, Shape, Sphere, TriangleMesh, triangles_of

if TYPE_CHECKING:
    from arcor2_hw.kinematics.model import RobotModel

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

MAX_TRIANGLES: Final = 2_000_000
_SIDES: Final = 96


@dataclass(frozen=True)
class RobotSurface:
    """Triangles of all links: vertices (n, 3) in m in the robot's base frame, and triangles (m, 3) of indices.

    Raises:
        InvalidData: The number of triangles is not between 1 and MAX_TRIANGLES, or a number or index is invalid.
    """

    vertices: Floats
    triangles: Indices
    name: str = "the robot"

    def __post_init__(self) -> None:
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3 or not len(self.vertices):
            raise InvalidData("The model of {name} has no vertices with three coordinates.", name=self.name)
        if self.triangles.ndim != 2 or self.triangles.shape[1] != 3 or not len(self.triangles):
            raise InvalidData("The model of {name} has no triangles, so it is invisible.", name=self.name)
        if len(self.triangles) > MAX_TRIANGLES:
            raise InvalidData(
                "The model of {name} has {count} triangles; the maximum is {most_triangles}.",
                name=self.name,
                count=len(self.triangles),
                most_triangles=MAX_TRIANGLES,
            )
        if not np.isfinite(self.vertices).all():
            raise InvalidData("The model of {name} has vertices that are not finite.", name=self.name)
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.vertices):
            raise InvalidData("The model of {name} has a triangle with a missing vertex.", name=self.name)

    @classmethod
    def of_links(cls, links: Iterable[tuple[Floats, Indices, Floats]], name: str = "the robot") -> "RobotSurface":
        """Combine links, each as vertices in its own frame, triangles, and base_from_link (4, 4)."""
        vertices: list[Floats] = []
        triangles: list[Indices] = []
        count = 0
        for own, indices, base_from_link in links:
            vertices.append(own @ base_from_link[:3, :3].T + base_from_link[:3, 3])
            triangles.append(np.asarray(indices, dtype=np.int64) + count)
            count += len(own)
        if not vertices:
            raise InvalidData("The model of {name} has no links with a shape.", name=name)
        return cls(np.concatenate(vertices), np.concatenate(triangles), name)

    @property
    def size(self) -> float:
        """Return the diagonal of its bounding box, m."""
        return float(np.linalg.norm(self.vertices.max(axis=0) - self.vertices.min(axis=0)))


def surface_of(model: "RobotModel", joints: Iterable[Joint]) -> RobotSurface:
    """Return the surface of a robot at joint values: visual shapes, or collision shapes where a link has none.

    Raises:
        ModelError: Joints are missing or repeated; the message names them.
        InvalidData: The robot has no shapes.
    """
    poses = model.link_poses(model.values(joints))
    seen = {shape.link for shape in model.visual}
    shapes = [*model.visual, *(shape for shape in model.collision if shape.link not in seen)]
    links = []
    for each in shapes:
        mesh = finely_of(each.shape)
        links.append((mesh.vertices, mesh.triangles, poses[each.link] @ each.origin))
    return RobotSurface.of_links(links, model.name)


def finely_of(shape: Shape) -> TriangleMesh:
    """Return a shape as triangles that deviate from a round shape by less than 0.1 % of its radius."""
    import trimesh

    made: Any
    match shape:
        case Cylinder():
            made = trimesh.creation.cylinder(shape.radius, shape.length, sections=_SIDES)
        case Capsule():
            made = trimesh.creation.capsule(shape.length, shape.radius, count=(_SIDES // 2, _SIDES))
            made.apply_translation(-np.mean(made.bounds, axis=0))
        case Sphere():
            made = trimesh.creation.icosphere(4, shape.radius)
        case _:
            return triangles_of(shape)
    return TriangleMesh(np.asarray(made.vertices, dtype=np.float64), np.asarray(made.faces, dtype=np.int64))
