"""Registration of a cloud onto the part of a surface that a camera sees: point to plane, Tukey's kernel, from a start.

Source of the method: Y. Chen and G. Medioni, "Object modelling by registration of multiple range images" (1992), for
point to plane; A. Beaton and J. Tukey (1974) for the kernel's weights.
"""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
import open3d as o3d
from scipy.spatial import cKDTree

from arcor2_hw.calibration.surface import RobotSurface

Floats = npt.NDArray[np.float64]

LEAST_SEEN: Final = 60
"""Points below which no step is made."""
COARSE: Final = 5e-4
FINE: Final = 1e-5
"""m; a step that moves the points by less is the last one of its stage."""
COMES_NEAR: Final = 4.0
"""Of a stage's reach: a point farther from the surface does not come within reach any more."""
GRAZING: Final = 0.2
"""Cosine of the angle between ray and normal below which a point is too uncertain to be used."""


DEPTH_NOISE: Final = 0.001
"""1/m: standard deviation of a depth over its square, as of a stereo pair; only how points weigh depends on it."""
SURFACE_NOISE: Final = 0.0007
"""m, by which a model differs from its robot all the same."""


class Rendered(NamedTuple):
    """What of a surface is seen along rays: depth (n,) along the optical axis, infinite where nothing is."""

    depth: Floats
    normals: Floats
    """(n, 3), in the base frame, towards the camera."""


class Fit(NamedTuple):
    """The end of a registration. Rows of (position, rotation vector about `centre`), in the base frame."""

    base_from_camera: Floats
    rows: Floats
    """(n, 6): how the distance of each point used changes with a small motion."""
    errors: Floats
    """(n,): its distance from the surface, m, before the last step."""
    weights: Floats
    """(n,): 0..1."""
    used: npt.NDArray[np.intp]
    """Indices of the points used."""
    centre: Floats
    spread: float
    """m, rms distance of the points used from the centre."""
    moved: float
    """m, by the last step, at the distance of `spread`."""

    @property
    def residual(self) -> float:
        """Give the rms of the weighted distances, m."""
        return float(np.sqrt((self.weights * self.errors**2).sum() / max(self.weights.sum(), 1e-12)))

    def scaled_rows(self) -> Floats:
        """Give the rows with rotations as motions at the distance of `spread`: all columns in the same unit."""
        return np.asarray(self.rows / np.array([1.0] * 3 + [max(self.spread, 1e-6)] * 3))

    def least_known(self) -> float:
        """Give how much of a motion in the worst known direction the distances show: 1 all, 0 nothing."""
        rows = self.scaled_rows()
        information = (rows * self.weights[:, None]).T @ rows / max(self.weights.sum(), 1e-12)
        return float(np.sqrt(max(0.0, np.linalg.eigvalsh(information)[0])))

    def covariance(self, tiles: npt.NDArray[np.intp]) -> Floats:
        """Give the 6 × 6 covariance of position and rotation of the base in its own frame.

        Errors of a depth picture belong together where pixels are neighbours: `tiles` (n,) says which tile of the
        picture each point of the cloud is in, and only tiles count as independent. Source: K.-Y. Liang and S. Zeger,
        "Longitudinal data analysis using generalized linear models" (1986), the clustered sandwich.
        """
        weighted = self.rows * self.weights[:, None]
        bread = np.linalg.pinv(weighted.T @ self.rows, rcond=1e-12, hermitian=True)
        numbers, where = np.unique(tiles[self.used], return_inverse=True)
        sums = np.zeros((len(numbers), 6))
        np.add.at(sums, where, weighted * self.errors[:, None])
        count = max(len(numbers), 8)
        about_centre = bread @ (sums.T @ sums) @ bread * (count / (count - 6.0))
        x, y, z = self.centre
        to_origin = np.eye(6)  # position of the origin = position of the centre - rotation × centre
        to_origin[:3, 3:] = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return np.asarray(to_origin @ about_centre @ to_origin.T)


class Model:
    """A robot's surface at which rays are cast. Everything is in the base frame. Not thread-safe."""

    def __init__(self, surface: RobotSurface) -> None:
        self._scene = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(surface.vertices, dtype=np.float32)),
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(surface.triangles, dtype=np.uint32)),
        )

    def render(self, base_from_camera: Floats, rays: Floats) -> Rendered:
        """Cast rays (n, 3), given in the camera's frame with z = 1."""
        both = np.empty((len(rays), 6), np.float32)
        both[:, :3] = base_from_camera[:3, 3]
        both[:, 3:] = rays @ base_from_camera[:3, :3].T
        hit = self._scene.cast_rays(o3d.core.Tensor.from_numpy(both))
        normals: Floats = _towards(hit["primitive_normals"].numpy().astype(np.float64), both[:, 3:])
        return Rendered(hit["t_hit"].numpy().astype(np.float64), normals)

    def distance(self, points: Floats) -> Floats:
        """Give how far points (n, 3) are from the surface, m."""
        found = self._scene.compute_distance(o3d.core.Tensor.from_numpy(points.astype(np.float32)))
        return np.asarray(found.numpy(), dtype=np.float64)

    def nearest(self, points: Floats) -> tuple[Floats, Floats]:
        """Give the nearest point of the surface to each point, and the normal there."""
        found = self._scene.compute_closest_points(o3d.core.Tensor.from_numpy(points.astype(np.float32)))
        return found["points"].numpy().astype(np.float64), found["primitive_normals"].numpy().astype(np.float64)


def _towards(normals: Floats, rays: npt.NDArray[np.float32]) -> Floats:
    """Turn normals against the rays; how triangles are wound is not relied upon."""
    away = np.einsum("ij,ij->i", normals, rays) > 0
    normals[away] *= -1.0
    return normals


def tukey(distances: Floats, reach: float) -> Floats:
    """Give Tukey's weights: 1 at 0, 0 from `reach` on."""
    square: Floats = np.minimum(1.0, (distances / reach) ** 2)
    return (1.0 - square) ** 2


def rotation(vector: Floats) -> Floats:
    """Give the matrix of a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-9:
        return np.asarray(np.eye(3) + k)
    return np.asarray(np.eye(3) + np.sin(angle) / angle * k + (1.0 - np.cos(angle)) / angle**2 * (k @ k))


class Stage(NamedTuple):
    """So many steps with a kernel that takes points up to `reach` m."""

    reach: float
    steps: int


def approach(model: Model, cloud: Floats, rays: Floats, start: Floats, stages: tuple[Stage, ...]) -> Fit | None:
    """Register a cloud (n, 3, in the camera's frame) onto what is seen of the surface along rays, from far off.

    What is seen is rendered anew after every step. Gives None when too little is near enough to determine a step.
    """
    pose = start
    fit: Fit | None = None
    for stage in stages:
        for _ in range(stage.steps):
            seen = model.render(pose, rays)
            there = np.isfinite(seen.depth)
            if np.count_nonzero(there) < LEAST_SEEN:
                return None
            surface = rays[there] * seen.depth[there][:, None] @ pose[:3, :3].T + pose[:3, 3]
            points = cloud @ pose[:3, :3].T + pose[:3, 3]
            gaps, index = cKDTree(surface).query(points, distance_upper_bound=stage.reach)
            near = np.isfinite(gaps)
            if np.count_nonzero(near) < LEAST_SEEN:
                return None
            fit, pose = _fit(
                pose,
                points[near],
                np.flatnonzero(near),
                surface[index[near]],
                seen.normals[there][index[near]],
                stage.reach,
            )
            if fit.moved < COARSE:
                break
    return fit


def refine(model: Model, cloud: Floats, start: Floats, stages: tuple[Stage, ...]) -> Fit | None:
    """Register a cloud (n, 3, in the camera's frame) onto the nearest points of the surface, from near by.

    Gives None when too little is near enough to determine a step.
    """
    pose = start
    fit: Fit | None = None
    for stage in stages:
        kept = np.arange(len(cloud))
        for _ in range(stage.steps):
            points = cloud[kept] @ pose[:3, :3].T + pose[:3, 3]
            targets, normals = model.nearest(points)
            rays = points - pose[:3, 3]
            slope = np.abs(np.einsum("ij,ij->i", normals, rays)) / np.linalg.norm(rays, axis=1)
            gaps = np.linalg.norm(targets - points, axis=1)
            near = (slope > GRAZING) & (gaps < stage.reach)
            if np.count_nonzero(near) < LEAST_SEEN:
                return None
            fit, pose = _fit(pose, points[near], kept[near], targets[near], normals[near], stage.reach)
            kept = kept[gaps < COMES_NEAR * stage.reach]  # to ask for the nearest of far points takes longest
            if fit.moved < FINE:
                break
    return fit


def _fit(
    pose: Floats, points: Floats, used: npt.NDArray[np.intp], targets: Floats, normals: Floats, reach: float
) -> tuple[Fit, Floats]:
    """Make one step: the motion that brings points onto the planes of their targets."""
    errors = np.einsum("ij,ij->i", normals, targets - points)
    ways = points - pose[:3, 3]
    away = np.linalg.norm(ways, axis=1)
    noise = DEPTH_NOISE * away * np.abs(np.einsum("ij,ij->i", normals, ways))
    weights = tukey(errors, reach) * SURFACE_NOISE**2 / (noise**2 + SURFACE_NOISE**2)
    total = max(float(weights.sum()), 1e-12)
    centre = np.asarray((weights[:, None] * points).sum(axis=0) / total)
    arms = points - centre
    spread = float(np.sqrt((weights * (arms**2).sum(axis=1)).sum() / total))
    rows = np.hstack([normals, np.cross(arms, normals)])
    scale = np.array([1.0] * 3 + [max(spread, 1e-6)] * 3)
    weighted = (rows * weights[:, None]).T
    information = weighted @ rows / np.outer(scale, scale)
    information += np.eye(6) * (1e-6 * np.trace(information) + 1e-12)  # a free direction stays where it is
    solution = np.linalg.solve(information, weighted @ errors / scale) / scale
    motion = np.eye(4)
    motion[:3, :3] = rotation(solution[3:])
    motion[:3, 3] = solution[:3] + centre - motion[:3, :3] @ centre
    moved = float(np.linalg.norm(solution[:3]) + np.linalg.norm(solution[3:]) * spread)
    after = np.asarray(motion @ pose)
    return Fit(after, rows, errors, weights, used, centre, spread, moved), after
