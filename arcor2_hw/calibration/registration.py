"""Registration of a point cloud onto the visible part of a surface: point to plane, Tukey's kernel, from a start.

Sources: Y. Chen and G. Medioni, "Object modelling by registration of multiple range images" (1992), for point to
plane; A. Beaton and J. Tukey (1974) for the weights.
"""

from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from arcor2_hw.calibration.surface import RobotSurface

Floats = npt.NDArray[np.float64]

MIN_SEEN: Final = 60
"""Minimum number of points for a step."""
COARSE: Final = 5e-4
FINE: Final = 1e-5
"""Step size at which a stage ends, m."""
MIN_INCIDENCE_COSINE: Final = 0.2
"""Cosine of the angle between ray and normal below which a point is not used."""


DEPTH_NOISE: Final = 0.001
"""Standard deviation of a depth divided by its square, 1/m, as of a stereo camera; used for weights only."""
SURFACE_NOISE: Final = 0.0007
"""Standard deviation between a model and its robot, m."""


class RenderedSurface(NamedTuple):
    """A surface as seen along rays: depth (n,) along the optical axis, infinite where there is none."""

    depth: Floats
    normals: Floats
    """(n, 3), in the base frame, towards the camera."""


class Fit(NamedTuple):
    """The end of a registration. Rows are (position, rotation vector about `centre`), in the base frame."""

    base_from_camera: Floats
    rows: Floats
    """(n, 6), derivative of the distance of each used point by a small motion."""
    errors: Floats
    """(n,), distance from the surface before the last step, m."""
    weights: Floats
    """(n,), 0 to 1."""
    used: npt.NDArray[np.intp]
    """Indices of the points used."""
    centre: Floats
    spread: float
    """Root mean square distance of the points used from the centre, m."""
    moved: float
    """Length of the last step at the distance `spread`, m."""

    @property
    def residual(self) -> float:
        """Return the root mean square of the weighted distances, m."""
        return float(np.sqrt((self.weights * self.errors**2).sum() / max(self.weights.sum(), 1e-12)))

    def scaled_rows(self) -> Floats:
        """Return the rows with rotations as motions at the distance `spread`, so that all columns are in m."""
        return np.asarray(self.rows / np.array([1.0] * 3 + [max(self.spread, 1e-6)] * 3))

    def least_known(self) -> float:
        """Return the visibility of a motion in the worst direction: 1 complete, 0 none."""
        rows = self.scaled_rows()
        information = (rows * self.weights[:, None]).T @ rows / max(self.weights.sum(), 1e-12)
        return float(np.sqrt(max(0.0, np.linalg.eigvalsh(information)[0])))

    def covariance(self, tiles: npt.NDArray[np.intp]) -> Floats:
        """Return the covariance (6, 6) of position and rotation of the base in its own frame.

        Errors of neighbouring depth pixels are correlated, so only tiles count as independent. Source: K.-Y. Liang and
        S. Zeger, "Longitudinal data analysis using generalized linear models" (1986), the clustered sandwich.

        Args:
            tiles: (n,), tile of the image of each point of the cloud.
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
    """A robot's surface for ray casting, in the base frame. Not thread-safe."""

    def __init__(self, surface: RobotSurface) -> None:
        import open3d as o3d  # it takes a second

        self._scene = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(
            _tensor(np.ascontiguousarray(surface.vertices, dtype=np.float32)),
            _tensor(np.ascontiguousarray(surface.triangles, dtype=np.uint32)),
        )

    def render(self, base_from_camera: Floats, rays: Floats) -> RenderedSurface:
        """Cast rays (n, 3), given in the camera's frame with z = 1."""
        both = np.empty((len(rays), 6), np.float32)
        both[:, :3] = base_from_camera[:3, 3]
        both[:, 3:] = rays @ base_from_camera[:3, :3].T
        hit = self._scene.cast_rays(_tensor(both))
        normals: Floats = _towards(hit["primitive_normals"].numpy().astype(np.float64), both[:, 3:])
        return RenderedSurface(hit["t_hit"].numpy().astype(np.float64), normals)

    def distance(self, points: Floats) -> Floats:
        """Return the distances of points (n, 3) from the surface, m."""
        found = self._scene.compute_distance(_tensor(points.astype(np.float32)))
        return np.asarray(found.numpy(), dtype=np.float64)

    def nearest(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the nearest point of the surface to each point, and its normal."""
        found = self._scene.compute_closest_points(_tensor(points.astype(np.float32)))
        return found["points"].numpy().astype(np.float64), found["primitive_normals"].numpy().astype(np.float64)


def _tensor(array: npt.NDArray[Any]) -> Any:
    from open3d.core import Tensor

    return Tensor.from_numpy(array)


def _towards(normals: Floats, rays: npt.NDArray[np.float32]) -> Floats:
    """Flip normals against the rays; the winding of triangles is not relied upon."""
    away = np.einsum("ij,ij->i", normals, rays) > 0
    normals[away] *= -1.0
    return normals


def tukey(distances: Floats, reach: float) -> Floats:
    """Return Tukey's weights: 1 at 0, 0 from `reach` on."""
    square: Floats = np.minimum(1.0, (distances / reach) ** 2)
    return (1.0 - square) ** 2


def rotation(vector: Floats) -> Floats:
    """Return the matrix of a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-9:
        return np.asarray(np.eye(3) + k)
    return np.asarray(np.eye(3) + np.sin(angle) / angle * k + (1.0 - np.cos(angle)) / angle**2 * (k @ k))


class Stage(NamedTuple):
    """A number of steps with a kernel that reaches up to `reach` m."""

    reach: float
    steps: int


def approach(model: Model, cloud: Floats, rays: Floats, start: Floats, stages: tuple[Stage, ...]) -> Fit | None:
    """Register a cloud (n, 3, in the camera's frame) onto the visible surface along rays, from a distant start.

    The surface is rendered again after every step.

    Returns:
        None when too few points are near enough to determine a step.
    """
    pose = start
    fit: Fit | None = None
    for stage in stages:
        for _ in range(stage.steps):
            seen = model.render(pose, rays)
            there = np.isfinite(seen.depth)
            if np.count_nonzero(there) < MIN_SEEN:
                return None
            surface = rays[there] * seen.depth[there][:, None] @ pose[:3, :3].T + pose[:3, 3]
            points = cloud @ pose[:3, :3].T + pose[:3, 3]
            gaps, index = cKDTree(surface).query(points, distance_upper_bound=stage.reach)
            near = np.isfinite(gaps)
            if np.count_nonzero(near) < MIN_SEEN:
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
    """Register a cloud (n, 3, in the camera's frame) onto the nearest points of the surface, from a near start.

    Returns:
        None when too few points are near enough to determine a step.
    """
    pose = start
    fit: Fit | None = None
    measured, gaps = np.zeros_like(cloud), np.zeros(len(cloud))  # where each point was measured last, and its distance
    for stage in stages:
        for _ in range(stage.steps):
            points = cloud @ pose[:3, :3].T + pose[:3, 3]
            # Queries take longest, above all for far points. A point comes nearer by no more than it has moved.
            within = np.flatnonzero(gaps - np.linalg.norm(points - measured, axis=1) < stage.reach)
            points = measured[within] = points[within]
            targets, normals = model.nearest(points)
            rays = points - pose[:3, 3]
            slope = np.abs(np.einsum("ij,ij->i", normals, rays)) / np.linalg.norm(rays, axis=1)
            gaps[within] = np.linalg.norm(targets - points, axis=1)
            near = (slope > MIN_INCIDENCE_COSINE) & (gaps[within] < stage.reach)
            if np.count_nonzero(near) < MIN_SEEN:
                return None
            fit, pose = _fit(pose, points[near], within[near], targets[near], normals[near], stage.reach)
            if fit.moved < FINE:
                break
    return fit


def _fit(
    pose: Floats, points: Floats, used: npt.NDArray[np.intp], targets: Floats, normals: Floats, reach: float
) -> tuple[Fit, Floats]:
    """Compute one step: the motion that moves points onto the planes of their targets."""
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
    information += np.eye(6) * (1e-6 * np.trace(information) + 1e-12)  # an undetermined direction is not moved
    solution = np.linalg.solve(information, weighted @ errors / scale) / scale
    motion = np.eye(4)
    motion[:3, :3] = rotation(solution[3:])
    motion[:3, 3] = solution[:3] + centre - motion[:3, :3] @ centre
    moved = float(np.linalg.norm(solution[:3]) + np.linalg.norm(solution[3:]) * spread)
    after = np.asarray(motion @ pose)
    return Fit(after, rows, errors, weights, used, centre, spread, moved), after
