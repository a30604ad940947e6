"""Registration: the pose of a model in a cluster of points, and its quality.

The points are registered onto the model, not the model onto the points, so that hidden surfaces of a part have no
influence. For the quality, the model is rendered at the found pose and compared with the depth image.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
import open3d as o3d

from .models import Model
from .segmentation import Crate, Pixels

Floats = npt.NDArray[np.float64]

MAX_POINTS: Final = 3000
"""Largest number of points that are registered."""
REFINED_HYPOTHESES: Final = 4
"""Number of hypotheses, best first, that are refined."""
ITERATIONS: Final = 30
"""Largest number of iterations of a round of ICP."""
ROUNDS: Final = ((3.0, 2.0), (1.5, 1.0))
"""Search radius and Tukey's constant of each round of ICP, both in multiples of the tolerance."""
MIN_REFINED_QUALITY: Final = 0.5
"""Smallest quality of a pose that is refined by small steps."""
STEPS: Final = (0.001, 0.0005, 0.00025)
"""Step lengths, m."""
TURN_PER_STEP: Final = 12.0
"""Rotation per step length, rad/m: 0.7° per mm."""
MAX_STEPS: Final = 4
"""Largest number of steps of one length."""
MARGIN: Final = 6
"""Width of the margin around a cluster that is compared with the model, pixels."""
MIN_POINT_DISTANCE: Final = 0.01
"""Smallest distance of a point from the camera, m."""
MIN_SEEN: Final = 0.5
"""Smallest fraction of valid depth among the pixels in which the model is expected."""


class Fit(NamedTuple):
    """A pose of the model, and how well it fits.

    Attributes:
        pose: Pose in the frame of the crate, 4 × 4.
        quality: `explained` times `covered`, 0 to 1.
        explained: Fraction of the pixels of the cluster that agree with the model.
        covered: Fraction of the pixels in which the model is expected that agree with it.
        larger: Ratio of the number of pixels of the cluster to that of the visible model.
        error: Mean distance from the model, m.
    """

    pose: Floats
    quality: float
    explained: float
    covered: float
    larger: float
    error: float


def register(crate: Crate, pixels: Pixels, model: Model, camera: Floats, rays: Any, tolerance: float) -> Fit:
    """Find the model in a cluster.

    Args:
        crate: The segmented crate.
        pixels: The cluster, height × width.
        model: The model.
        camera: Pose of the camera in the frame of the crate, 4 × 4.
        rays: x and y of the ray of each pixel at 1 m, height × width × 2.
        tolerance: Largest distance of a point from the surface of its part, m.
    """
    points = crate.points[pixels].astype(np.float64)
    if len(points) > MAX_POINTS:
        points = points[np.linspace(0, len(points) - 1, MAX_POINTS).astype(int)]
    sparse = points[:: max(1, len(points) // 400)]
    tree = o3d.core.nns.NearestNeighborSearch(
        o3d.core.Tensor.from_numpy(np.asarray(model.cloud.points).astype(np.float32))
    )
    tree.knn_index()
    floor = float(np.median(crate.points[pixels][:, 2] - crate.height[pixels]))
    starts = _starts(points, model, floor - 2.0 * tolerance)
    starts.sort(key=lambda pose: _distance(tree, sparse, pose, tolerance))
    judge = _Evaluator(crate, pixels, model, camera, rays, tolerance)
    fits = []
    for start in starts[:REFINED_HYPOTHESES]:
        pose = _refined(points, model, start, tolerance)
        fits.append(judge(pose))
        if fits[-1].quality > 0.95:
            break
    best = max(fits, key=lambda fit: fit.quality)
    if best.quality < MIN_REFINED_QUALITY:
        return best
    return _polished(best, judge, points)


def _polished(fit: Fit, judge: Callable[[Floats], Fit], points: Floats) -> Fit:
    """Shift and rotate a model horizontally until no step improves its quality.

    ICP does not determine the position along a flat top; the outline in the depth image does.
    """
    middle = np.median(points, axis=0)
    for step in STEPS:
        for _ in range(MAX_STEPS):
            tried = [judge(_shifted(fit.pose, middle, move)) for move in _moves(step)]
            better = max(tried, key=lambda each: each.quality)
            if better.quality <= fit.quality:
                break
            fit = better
    return fit


def _moves(step: float) -> list[tuple[float, float, float]]:
    """Return the moves of one step: x and y, m, and rotation, rad, which moves the ends of a part about as far."""
    turn = step * TURN_PER_STEP
    return [(step, 0, 0), (-step, 0, 0), (0, step, 0), (0, -step, 0), (0, 0, turn), (0, 0, -turn)]


def _shifted(pose: Floats, middle: Floats, move: tuple[float, float, float]) -> Floats:
    shift = np.eye(4)
    shift[:3, :3] = _about_z(move[2])
    shift[:3, 3] = middle - shift[:3, :3] @ middle + np.array([move[0], move[1], 0.0])
    return np.asarray(shift @ pose)


def _starts(points: Floats, model: Model, lowest: float) -> list[Floats]:
    """Return initial poses: each side of the bounding box up, rotated like the minimum rectangle around the points.

    Args:
        points: Points of the cluster, n × 3, m.
        model: The model.
        lowest: Height of the floor, m; no pose is below it.
    """
    (x, y), _, angle = cv2.minAreaRect((points[:, :2] * 1000.0).astype(np.float32))
    top = float(np.percentile(points[:, 2], 97))
    middle = (model.low + model.high) / 2.0
    found: list[tuple[float, Floats]] = []
    for side in _sides(model.box):
        corners = (model.vertices - middle) @ side.T
        height = float(corners[:, 2].max())
        for quarter in (0, 1) if model.box else (0, 1, 2, 3):
            turn = np.radians(angle) + quarter * np.pi / 2.0
            pose = np.eye(4)
            pose[:3, :3] = _about_z(turn) @ side
            pose[:3, 3] = np.array([x / 1000.0, y / 1000.0, top - height]) - pose[:3, :3] @ middle
            found.append((top - 2.0 * height, pose))
    possible = [pose for bottom, pose in found if bottom >= lowest]
    return possible or [pose for _, pose in found]


def _sides(box: bool) -> list[Floats]:
    """Return the rotations that turn each side of the model up; for a box, only one of two opposite sides."""
    up = np.eye(3)
    y_up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    x_up = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    over = np.diag([1.0, -1.0, -1.0])
    return [up, y_up, x_up] if box else [up, over, y_up, over @ y_up, x_up, over @ x_up]


def _about_z(angle: float) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _distance(tree: Any, points: Floats, pose: Floats, tolerance: float) -> float:
    """Return the mean distance of the points from the model, m; each is limited to 3 tolerances."""
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    _, squares = tree.knn_search(o3d.core.Tensor.from_numpy(local.astype(np.float32)), 1)
    return float(np.minimum(np.sqrt(squares.numpy()), 3.0 * tolerance).mean())


def _refined(points: Floats, model: Model, start: Floats, tolerance: float) -> Floats:
    """Return the pose after ICP of the points onto the model, point to plane with Tukey weights."""
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    model_from_crate = np.linalg.inv(start)
    registration = o3d.pipelines.registration
    for reach, constant in ROUNDS:
        result = registration.registration_icp(
            cloud,
            model.cloud,
            reach * tolerance,
            model_from_crate,
            registration.TransformationEstimationPointToPlane(registration.TukeyLoss(constant * tolerance)),
            registration.ICPConvergenceCriteria(max_iteration=ITERATIONS),
        )
        if np.isfinite(result.transformation).all():
            model_from_crate = np.asarray(result.transformation)
    return np.asarray(np.linalg.inv(model_from_crate))


class _Evaluator:
    """Compares the model, rendered at a pose, with the depth of a cluster."""

    def __init__(self, crate: Crate, pixels: Pixels, model: Model, camera: Floats, rays: Any, tolerance: float) -> None:
        rows, columns = np.nonzero(pixels)
        self._bounds = (int(rows.min()), int(rows.max()), int(columns.min()), int(columns.max()))
        self._count = len(rows)
        self._crate, self._pixels, self._model, self._rays = crate, pixels, model, rays
        self._camera, self._camera_from_crate = camera, np.linalg.inv(camera)
        self._tolerance = tolerance
        # The rays of the middle row and column; the error by distortion is smaller than MARGIN.
        self._across, self._down = rays[rays.shape[0] // 2, :, 0], rays[:, rays.shape[1] // 2, 1]

    def __call__(self, pose: Floats) -> Fit:
        """Return a pose with its quality."""
        where = self._about(pose)
        reach = self._rendered(pose, where)
        towards = self._camera_from_crate[2]
        with np.errstate(invalid="ignore"):
            depth = self._crate.points[where] @ towards[:3].astype(np.float32) + np.float32(towards[3])
            expected = np.isfinite(reach)
            measured = expected & self._crate.inside[where]
            difference = np.where(measured, np.abs(depth - np.where(expected, reach, 0.0)), np.inf)
            on = difference < self._tolerance
        seen, agreed = int(measured.sum()), int(on.sum())
        explained = int((on & self._pixels[where]).sum()) / self._count
        covered = agreed / max(seen, 1) if seen >= MIN_SEEN * int(expected.sum()) else 0.0
        error = float(difference[on].mean()) if agreed else float("inf")
        return Fit(pose, explained * covered, explained, covered, self._count / max(seen, 1), error)

    def _rendered(self, pose: Floats, window: tuple[slice, slice]) -> Any:
        """Return the depth of the model in each pixel of a rectangle, m; infinite where it is not visible."""
        part_from_camera = (np.linalg.inv(pose) @ self._camera).astype(np.float32)
        beams = self._rays[window]
        both = np.empty((*beams.shape[:2], 6), np.float32)
        both[..., :3] = part_from_camera[:3, 3]
        both[..., 3:] = beams @ part_from_camera[:3, :2].T + part_from_camera[:3, 2]
        return self._model.scene.cast_rays(o3d.core.Tensor.from_numpy(both))["t_hit"].numpy()

    def _about(self, pose: Floats) -> tuple[slice, slice]:
        """Return the rectangle around the cluster and the expected model."""
        top, bottom, left, right = self._bounds
        in_crate = self._model.vertices @ pose[:3, :3].T + pose[:3, 3]
        seen = (in_crate - self._camera[:3, 3]) @ self._camera[:3, :3]
        seen = seen[seen[:, 2] > MIN_POINT_DISTANCE]
        if len(seen):
            x, y = seen[:, 0] / seen[:, 2], seen[:, 1] / seen[:, 2]
            left = min(left, int(np.searchsorted(self._across, x.min())))
            right = max(right, int(np.searchsorted(self._across, x.max())))
            top = min(top, int(np.searchsorted(self._down, y.min())))
            bottom = max(bottom, int(np.searchsorted(self._down, y.max())))
        height, width = self._pixels.shape
        return (
            slice(max(0, top - MARGIN), min(height, bottom + MARGIN)),
            slice(max(0, left - MARGIN), min(width, right + MARGIN)),
        )
