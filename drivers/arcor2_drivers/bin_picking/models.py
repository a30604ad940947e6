"""The model of a part: a box or a mesh, sampled for registration."""

from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import open3d as o3d

from .settings import MAX_PART, BinSettings

Floats = npt.NDArray[np.float64]
MAX_FILE: Final = 20_000_000
MAX_TRIANGLES: Final = 200_000
MIN_PART: Final = 0.003
"""Smallest of the two longer sides of a part, m."""
SAMPLES: Final = 4000
"""Number of points sampled from the surface."""
FORMATS: Final = (".stl", ".obj", ".ply")


class BadModel(Exception):
    """The model cannot be used."""


class Model(NamedTuple):
    """A part.

    Attributes:
        cloud: Points sampled from the surface, with normals.
        scene: Triangles for ray casting.
        vertices: Corners of the triangles, n × 3, m.
        box: Whether the part is unchanged by a rotation of 180° about an axis.
        low: Lower corner of the bounding box, m.
        high: Upper corner of the bounding box, m.
    """

    cloud: Any
    scene: Any
    vertices: Floats
    box: bool
    low: Floats
    high: Floats

    @property
    def size(self) -> Floats:
        """Return the sides of the bounding box, m."""
        return self.high - self.low

    @property
    def faces(self) -> tuple[float, float]:
        """Return the areas of the smallest and the largest side of the bounding box, m²."""
        x, y, z = self.size
        areas = sorted((x * y, y * z, x * z))
        return float(areas[0]), float(areas[2])


def load(settings: BinSettings) -> Model:
    """Return the model that the settings describe. Raises BadModel."""
    if settings.part_mesh:
        return of_mesh(_read(Path(settings.part_mesh)), box=False)
    size = (settings.part_length, settings.part_width, settings.part_height)
    mesh = o3d.geometry.TriangleMesh.create_box(*size)
    mesh.translate([-side / 2.0 for side in size])
    return of_mesh(mesh, box=True)


def _read(path: Path) -> Any:
    if path.suffix.lower() not in FORMATS:
        raise BadModel(f"part_mesh {path.name} must be one of {', '.join(FORMATS)}")
    try:
        size = path.stat().st_size
    except OSError as error:
        raise BadModel(f"part_mesh {path} cannot be read: {error.strerror}") from error
    if size > MAX_FILE:
        raise BadModel(f"part_mesh {path.name} has {size} bytes, at most {MAX_FILE} are allowed")
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        return o3d.io.read_triangle_mesh(path)


def of_mesh(mesh: Any, box: bool) -> Model:
    """Check a mesh and return its model. Raises BadModel."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    triangles = np.asarray(mesh.triangles)
    if not len(triangles):
        raise BadModel("part_mesh has no triangles")
    if len(triangles) > MAX_TRIANGLES:
        raise BadModel(f"part_mesh has {len(triangles)} triangles, at most {MAX_TRIANGLES} are allowed. Simplify it.")
    if not np.isfinite(vertices).all():
        raise BadModel("part_mesh has vertices that are not finite")
    used = vertices[np.unique(triangles)]
    low, high = used.min(axis=0), used.max(axis=0)
    longest = float((high - low).max())
    if longest > MAX_PART:
        raise BadModel(f"part_mesh is {longest:g} m long, at most {MAX_PART:g} m are allowed: is it in millimetres?")
    if longest < MIN_PART or float(np.sort(high - low)[1]) < MIN_PART:
        raise BadModel(f"part_mesh is {longest:g} m long; two sides must be at least {MIN_PART:g} m")
    mesh.compute_triangle_normals()
    o3d.utility.random.seed(1)
    cloud = mesh.sample_points_uniformly(SAMPLES, use_triangle_normal=True)
    if not np.isfinite(np.asarray(cloud.points)).all() or not np.isfinite(np.asarray(cloud.normals)).all():
        raise BadModel("part_mesh has triangles without area")
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(vertices.astype(np.float32)), o3d.core.Tensor.from_numpy(triangles.astype(np.uint32))
    )
    return Model(cloud, scene, used, box, low, high)
