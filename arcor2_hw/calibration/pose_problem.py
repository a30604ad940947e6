"""The pose of a camera as one least-squares problem over all detected corners and hints."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.rigid import cross_matrix, inverted, motion, moved, rotation_vector

_ROUNDS: Final = 30
_CONVERGED: Final = 1e-3
"""Decrease of cost (chi square) in one iteration below which the search ends."""
_GIVES_UP_AFTER: Final = 2
_FAR_ABOVE: Final = 60.0
"""Cost above that of another pose at which a start is abandoned."""
_BEHIND: Final = 1e9
"""Cost of a pose at which a point would be behind the camera."""
_SOFT: Final = 4.0
"""Standard deviations per corner above which a marker has less weight (Cauchy)."""
_CANDIDATES_OF: Final = 6
"""Number of markers, largest first, whose poses are used as starts."""


@dataclass(frozen=True, eq=False)
class DetectedTarget:
    """A detected marker or board of known pose.

    Attributes:
        points: (n, 3), in the frame of the origin, m.
        pixels: (n, 2).
        root: (2n, 2n), square root of the information (px⁻¹): root @ errors has unit variance.
        normal: Normal of its plane in the frame of the origin.
        middle: Its middle in the frame of the origin, m.
    """

    name: str
    key: tuple[str, int]
    picture: int
    points: Array
    pixels: Array
    root: Array
    normal: Array
    middle: Array
    square: Array | None = None
    """Pose of a marker in the world, (4, 4); None for a board."""
    size: float = 0.0

    @property
    def extent(self) -> float:
        """Return its size in the image, px."""
        return float(np.linalg.norm(np.ptp(self.pixels, axis=0)))


@dataclass(frozen=True, eq=False)
class Hints:
    """Prior knowledge, linearized at each pose as weighted conditions.

    Attributes:
        expected: camera_from_origin with standard deviations in m and rad.
        gravity: Unit vector in the camera's frame with its standard deviation in rad.
    """

    expected: Array | None = None
    expected_position: float = 1.0
    expected_orientation: float = 1.0
    gravity: Array | None = None
    gravity_deviation: float = 1.0

    def rows(self, pose: Array) -> tuple[Array, Array]:
        """Return residuals and their derivatives by a small motion of the pose (rotation, displacement)."""
        residuals: list[Array] = []
        slopes: list[Array] = []
        if self.expected is not None:
            # The position of the camera in the frame of the origin is known, so the error is stated in the camera's
            # frame.
            eye = pose[:3, :3] @ inverted(self.expected)[:3, 3] + pose[:3, 3]
            residuals.append(eye / self.expected_position)
            slopes.append(np.hstack((-cross_matrix(eye), np.eye(3))) / self.expected_position)
            turn = rotation_vector(pose[:3, :3] @ self.expected[:3, :3].T)
            residuals.append(turn / self.expected_orientation)
            slopes.append(np.hstack((np.eye(3), np.zeros((3, 3)))) / self.expected_orientation)
        if self.gravity is not None:
            down = -pose[:3, 2]
            residuals.append((down - self.gravity) / self.gravity_deviation)
            slopes.append(np.hstack((-cross_matrix(down), np.zeros((3, 3)))) / self.gravity_deviation)
        if not residuals:
            return np.zeros(0), np.zeros((0, 6))
        return np.concatenate(residuals), np.vstack(slopes)


@dataclass(frozen=True, eq=False)
class Solution:
    """A pose (camera_from_origin, (4, 4)), the change of intrinsics in standard deviations, cost, and covariance.

    Attributes:
        covariance: (6, 6), of a small motion after the pose (rotation vector, displacement), including the uncertainty
            of the intrinsics.
        lens_covariance: Of the change of the intrinsics, in standard deviations.
    """

    pose: Array
    change: Array
    cost: float
    covariance: Array
    lens_covariance: Array


class _Group:
    """Targets with equal numbers of points, computed together."""

    def __init__(self, members: list[int], seen: Sequence[DetectedTarget], firsts: Sequence[int]) -> None:
        self.members = members
        count = len(seen[members[0]].points)
        self.index = np.concatenate([np.arange(firsts[i], firsts[i] + count) for i in members])
        self.roots = np.stack([seen[i].root for i in members])
        self.rows = 2 * count

    def white(self, errors: Array) -> Array:
        """Return errors in standard deviations, members × rows."""
        own = errors[self.index].reshape(len(self.members), self.rows)
        return np.asarray(np.matmul(self.roots, own[:, :, None])[:, :, 0])


class PoseProblem:
    """All targets that one camera sees from one place, with intrinsics of limited accuracy.

    `lens_changes` has one column for each way in which the intrinsics (as Lens.numbers) may differ, of one standard
    deviation. The intrinsics are unknowns with prior knowledge. Their errors that the image shows do not affect the
    pose; the others increase the covariance of the pose.

    Attributes:
        scale: Unit of standard deviations; above 1 where targets are not exactly where they should be.
    """

    def __init__(self, lens: Lens, seen: Sequence[DetectedTarget], hints: Hints, lens_changes: Array) -> None:
        self.lens = lens
        self.seen = list(seen)
        self.hints = hints
        self.scale = 1.0
        self.lens_changes = lens_changes
        self.unchanged: Array = np.zeros(lens_changes.shape[1])
        self._points = np.concatenate([each.points for each in self.seen])
        self._pixels = np.concatenate([each.pixels for each in self.seen])
        counts = [len(each.points) for each in self.seen]
        firsts = [sum(counts[:i]) for i in range(len(counts))]
        self._parts = [slice(first, first + count) for first, count in zip(firsts, counts, strict=True)]
        alike = [[i for i, c in enumerate(counts) if c == count] for count in sorted(set(counts))]
        self._groups = [_Group(members, self.seen, firsts) for members in alike]

    def starts(self) -> list[Array]:
        """Return initial poses: both poses that each marker allows, and the poses from all corners together."""
        found: list[Array] = []
        if len(self.seen) > 1:
            rays = self.lens.rays(self._pixels)
            flat = self._points - self._points.mean(axis=0)
            _, sizes, axes = np.linalg.svd(flat, full_matrices=False)
            if sizes[2] < 1e-6 * sizes[0]:
                # IPPE needs the points in its xy plane.
                turn = axes if np.linalg.det(axes) > 0 else axes * np.array([[1.0], [1.0], [-1.0]])
                to_plane = motion(turn, -turn @ self._points.mean(axis=0))
                found += [pose @ to_plane for pose in _solved(flat @ turn.T, rays, cv2.SOLVEPNP_IPPE)]
            else:
                found += _solved(self._points, rays, cv2.SOLVEPNP_SQPNP)
        for each in sorted(self.seen, key=lambda s: -s.extent)[:_CANDIDATES_OF]:
            found += planar_poses(self.lens, each)
        return found

    def typical(self, pose: Array, change: Array | None = None) -> float:
        """Return the typical error of a corner at a pose in standard deviations: the median."""
        errors = self._errors(pose, self.unchanged if change is None else change)
        if errors is None:
            return float("inf")
        squares = [np.mean(group.white(errors) ** 2, axis=1) for group in self._groups]
        return float(np.sqrt(np.median(np.concatenate(squares))))

    def goodness(self, pose: Array, change: Array) -> tuple[float, int]:
        """Return chi square of a solution, with the measured noise of corners, and its degrees of freedom."""
        errors = self._errors(pose, change)
        hints, _ = self.hints.rows(pose)
        freedom = self._pixels.size + len(hints) - 6
        if errors is None:
            return float("inf"), freedom
        squares = sum(float(np.sum(group.white(errors) ** 2)) for group in self._groups)
        return squares + float(hints @ hints + change @ change), freedom

    def cost(self, pose: Array, change: Array | None = None) -> float:
        """Return the robust cost of a pose."""
        change = self.unchanged if change is None else change
        errors = self._errors(pose, change)
        if errors is None:
            return _BEHIND
        residuals, _ = self.hints.rows(pose)
        total = float(residuals @ residuals + change @ change)
        for group in self._groups:
            squares = np.sum(group.white(errors) ** 2, axis=1) / self.scale**2
            reach = _SOFT**2 * group.rows
            total += reach * float(np.sum(np.log1p(squares / reach)))
        return total

    def refined(self, start: Array, change: Array | None = None, *, enough: float = _BEHIND) -> Solution | None:
        """Minimize the cost from an initial pose (Levenberg-Marquardt).

        Returns:
            None when a point is behind the camera at the start, or the cost stays far above `enough`.
        """
        pose, damping = start, 1e-4
        change = self.unchanged if change is None else change
        cost = self.cost(pose, change)
        if cost >= _BEHIND:
            return None
        for done in range(_ROUNDS):
            normal, right = self._equations(pose, change)
            gain = -1.0
            while gain < 0 and damping < 1e8:
                step = np.asarray(np.linalg.solve(normal + damping * np.diag(np.diag(normal)), right), dtype=np.float64)
                tried = moved(pose, step[:6]), change + step[6:]
                new = self.cost(*tried)
                gain = cost - new
                damping = max(damping / 10, 1e-9) if gain >= 0 else damping * 10
            if gain >= 0:
                cost, (pose, change) = new, tried
            if gain < _CONVERGED or (done == _GIVES_UP_AFTER and cost > enough + _FAR_ABOVE):
                break
        if cost > enough + _FAR_ABOVE:
            return None
        return self.solution(pose, change, cost)

    def solution(self, pose: Array, change: Array, cost: float) -> Solution:
        """Return a solution with its covariance."""
        normal, _ = self._equations(pose, change)
        try:
            covariance = np.asarray(np.linalg.inv(normal), dtype=np.float64)
        except np.linalg.LinAlgError:
            covariance = np.full(normal.shape, np.inf)
        return Solution(pose, change, cost, covariance[:6, :6], covariance[6:, 6:])

    def errors(self, pose: Array, change: Array) -> list[Array] | None:
        """Return the errors of all targets at a pose, px, (n, 2) each; None where a point is behind the camera."""
        errors = self._errors(pose, change)
        return None if errors is None else [errors[part] for part in self._parts]

    def _errors(self, pose: Array, change: Array) -> Array | None:
        camera = self._points @ pose[:3, :3].T + pose[:3, 3]
        if camera[:, 2].min() < 1e-3:
            return None
        return np.asarray(self.lens.projected(camera, self.lens_changes @ change) - self._pixels)

    def _equations(self, pose: Array, change: Array) -> tuple[Array, Array]:
        """Return the normal equations at a pose: rotation, displacement, intrinsics in standard deviations."""
        camera = self._points @ pose[:3, :3].T + pose[:3, 3]
        pixels, by_point, by_lens = self.lens.projected_with_slopes(camera, self.lens_changes @ change)
        errors = pixels - self._pixels
        # A rotation by r moves a point p by r × p, and so a pixel by slope · (r × p) = r · (p × slope).
        slopes = np.concatenate((_cross(camera[:, None, :], by_point), by_point, by_lens @ self.lens_changes), axis=2)
        size = slopes.shape[2]
        normal, right = np.zeros((size, size)), np.zeros(size)
        residuals, rows = self.hints.rows(pose)
        normal[:6, :6] = rows.T @ rows
        right[:6] = -rows.T @ residuals
        normal[6:, 6:] = np.eye(size - 6)
        right[6:] = -change
        for group in self._groups:
            white = group.white(errors)
            a = np.matmul(group.roots, slopes[group.index].reshape(len(group.members), group.rows, size))
            squares = np.sum(white**2, axis=1) / self.scale**2
            weights = 1.0 / (1.0 + squares / (_SOFT**2 * group.rows)) / self.scale**2
            weighted = (a * weights[:, None, None]).reshape(-1, size)
            normal += weighted.T @ a.reshape(-1, size)
            right -= weighted.T @ white.ravel()
        return normal, right


def planar_poses(lens: Lens, target: DetectedTarget) -> list[Array]:
    """Return the poses of the camera (camera_from_origin) that one marker or board allows: one or two."""
    rays = lens.rays(target.pixels)
    if target.square is not None:
        half = target.size / 2
        corners = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
        marker_from_origin = inverted(target.square)
        return [pose @ marker_from_origin for pose in _solved(corners, rays, cv2.SOLVEPNP_IPPE_SQUARE)]
    z = target.normal
    x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0), z)
    x /= np.linalg.norm(x)
    plane = np.vstack((x, np.cross(z, x), z))
    to_plane = np.eye(4)
    to_plane[:3, :3] = plane
    to_plane[:3, 3] = -plane @ target.middle
    flat = target.points @ plane.T + to_plane[:3, 3]
    flat[:, 2] = 0.0
    return [pose @ to_plane for pose in _solved(flat, rays, cv2.SOLVEPNP_IPPE)]


def _solved(points: Array, rays: Array, flags: int) -> list[Array]:
    """Return OpenCV's closed-form solutions for points along rays, (4, 4); empty when there is none."""
    try:
        _, turns, places, _ = cv2.solvePnPGeneric(
            np.ascontiguousarray(points), np.ascontiguousarray(rays), np.eye(3), np.zeros(4), flags=flags
        )
    except cv2.error:
        return []
    result = []
    for turn, place in zip(turns, places, strict=True):
        pose = np.eye(4)
        pose[:3, :3] = cv2.Rodrigues(turn)[0]
        pose[:3, 3] = np.ravel(place)
        if np.all(np.isfinite(pose)):
            result.append(pose)
    return result


def _cross(a: Array, b: Array) -> Array:
    """Return the cross products of vectors along the last axis; np.cross is several times slower for so few."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    result = np.empty(b.shape)
    result[..., 0] = y * w - z * v
    result[..., 1] = z * u - x * w
    result[..., 2] = x * v - y * u
    return result
