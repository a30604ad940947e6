"""The model of a part: a box or a mesh, checked, and sampled for registration."""

from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import open3d as o3d

from .settings import LARGEST_PART, BinSettings

Floats = npt.NDArray[np.float64]
LARGEST_FILE: Final = 20_000_000
MOST_TRIANGLES: Final = 200_000
SMALLEST_PART: Final = 0.003
SAMPLES: Final = 4000
KINDS: Final = (".stl", ".obj", ".ply")


class BadModel(Exception):
    """The model is none that could be found."""


class Model(NamedTuple):
    """A part: sampled points with normals, and triangles to cast rays at.

    box: whether it looks the same when it is turned by 180°. low, high: corners of its bounding box, m.
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
    """Make the model that the settings tell. Raises BadModel."""
    if settings.part_mesh:
        return of_mesh(_read(Path(settings.part_mesh)), box=False)
    size = (settings.part_length, settings.part_width, settings.part_height)
    mesh = o3d.geometry.TriangleMesh.create_box(*size)
    mesh.translate([-side / 2.0 for side in size])
    return of_mesh(mesh, box=True)


def _read(path: Path) -> Any:
    if path.suffix.lower() not in KINDS:
        raise BadModel(f"part_mesh {path.name} must be one of {', '.join(KINDS)}")
    try:
        size = path.stat().st_size
    except OSError as error:
        raise BadModel(f"part_mesh {path} cannot be read: {error.strerror}") from error
    if size > LARGEST_FILE:
        raise BadModel(f"part_mesh {path.name} has {size} bytes, {LARGEST_FILE} at most are taken")
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        return o3d.io.read_triangle_mesh(path)


def of_mesh(mesh: Any, box: bool) -> Model:
    """Check a mesh and make a model of it. Raises BadModel."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    triangles = np.asarray(mesh.triangles)
    if not len(triangles):
        raise BadModel("part_mesh has no triangles")
    if len(triangles) > MOST_TRIANGLES:
        raise BadModel(f"part_mesh has {len(triangles)} triangles, {MOST_TRIANGLES} at most are taken: simplify it")
    if not np.isfinite(vertices).all():
        raise BadModel("part_mesh has corners that are not numbers")
    used = vertices[np.unique(triangles)]
    low, high = used.min(axis=0), used.max(axis=0)
    longest = float((high - low).max())
    if longest > LARGEST_PART:
        raise BadModel(f"part_mesh is {longest:g} m long, {LARGEST_PART:g} m at most: is it in millimetres?")
    if longest < SMALLEST_PART or float(np.sort(high - low)[1]) < SMALLEST_PART:
        raise BadModel(f"part_mesh is {longest:g} m long; both sides must be {SMALLEST_PART:g} m at least")
    mesh.compute_triangle_normals()
    o3d.utility.random.seed(1)
    cloud = mesh.sample_points_uniformly(SAMPLES, use_triangle_normal=True)
    if not np.isfinite(np.asarray(cloud.points)).all() or not np.isfinite(np.asarray(cloud.normals)).all():
        raise BadModel("part_mesh has triangles without an area")
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(vertices.astype(np.float32)),
        o3d.core.Tensor.from_numpy(triangles.astype(np.uint32)),
    )
    return Model(cloud, scene, used, box, low, high)
