"""The pose of a camera as one least-squares problem over all corners of everything that is seen, and over hints."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.rigid import crossed, inverted, motion, moved, rotation_vector

_ROUNDS: Final = 30
_CONVERGED: Final = 1e-3
"""Gain of cost (chi square) in a round below which the search is over."""
_GIVES_UP_AFTER: Final = 2
_FAR_ABOVE: Final = 60.0
"""Cost above that of another pose from which on a start is not followed to its end."""
_BEHIND: Final = 1e9
"""Cost of a pose from which something that is seen would lie behind the camera."""
_SOFT: Final = 4.0
"""How many standard deviations per corner a marker may be off before it counts less (Cauchy)."""
_CANDIDATES_OF: Final = 6
"""Of how many markers, the largest, the poses are tried as starts."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Something of known place that is seen: a marker, or a board.

    points: n × 3, m, in the origin's frame. pixels: n × 2. root: 2n × 2n, the square root of the information (px⁻¹):
    root @ errors has unit variance. normal: of its plane, in the origin's frame. middle: m, likewise.
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
    """World from marker, 4 × 4, for a marker; None for a board."""
    size: float = 0.0

    @property
    def extent(self) -> float:
        """Give its size in the picture, px."""
        return float(np.linalg.norm(np.ptp(self.pixels, axis=0)))


@dataclass(frozen=True, eq=False)
class Hints:
    """What else is known: rows of a linear, weighted condition are made of it at every pose.

    expected: camera_from_origin with standard deviations in m and rad. gravity: unit vector in the camera's frame, with
    its standard deviation in rad.
    """

    expected: Array | None = None
    expected_position: float = 1.0
    expected_orientation: float = 1.0
    gravity: Array | None = None
    gravity_deviation: float = 1.0

    def rows(self, pose: Array) -> tuple[Array, Array]:
        """Give residuals and their derivatives by a small motion of the pose (rotation, displacement)."""
        residuals: list[Array] = []
        slopes: list[Array] = []
        if self.expected is not None:
            # The camera's position in the origin is what is known, so the error is stated in the camera's frame.
            eye = pose[:3, :3] @ inverted(self.expected)[:3, 3] + pose[:3, 3]
            residuals.append(eye / self.expected_position)
            slopes.append(np.hstack((-crossed(eye), np.eye(3))) / self.expected_position)
            turn = rotation_vector(pose[:3, :3] @ self.expected[:3, :3].T)
            residuals.append(turn / self.expected_orientation)
            slopes.append(np.hstack((np.eye(3), np.zeros((3, 3)))) / self.expected_orientation)
        if self.gravity is not None:
            down = -pose[:3, 2]
            residuals.append((down - self.gravity) / self.gravity_deviation)
            slopes.append(np.hstack((-crossed(down), np.zeros((3, 3)))) / self.gravity_deviation)
        if not residuals:
            return np.zeros(0), np.zeros((0, 6))
        return np.concatenate(residuals), np.vstack(slopes)


@dataclass(frozen=True, eq=False)
class Solution:
    """A pose (camera_from_origin, 4 × 4), the intrinsics' change in standard deviations, cost, covariance of the pose.

    covariance: 6 × 6, of a small motion after the pose (rotation vector, displacement), with what the intrinsics may be
    off in it.
    """

    pose: Array
    change: Array
    cost: float
    covariance: Array


class _Group:
    """Things with as many points each, so that they are computed at once."""

    def __init__(self, members: list[int], seen: Sequence[Seen], firsts: Sequence[int]) -> None:
        self.members = members
        count = len(seen[members[0]].points)
        self.index = np.concatenate([np.arange(firsts[i], firsts[i] + count) for i in members])
        self.roots = np.stack([seen[i].root for i in members])
        self.rows = 2 * count

    def white(self, errors: Array) -> Array:
        """Give errors in standard deviations: members × rows."""
        own = errors[self.index].reshape(len(self.members), self.rows)
        return np.asarray(np.matmul(self.roots, own[:, :, None])[:, :, 0])


class PoseProblem:
    """All that one camera sees from one place, with intrinsics that are known to `deviations` (as Lens.numbers).

    The intrinsics are unknowns too, held by what is known of them: an error of theirs that the picture shows does not
    go into the pose, and one that it does not show goes into the pose's covariance.

    scale: standard deviations that count as one. Above 1 where things stand a little elsewhere than they are said to.
    """

    def __init__(self, lens: Lens, seen: Sequence[Seen], hints: Hints, deviations: Array) -> None:
        self.lens = lens
        self.seen = list(seen)
        self.hints = hints
        self.scale = 1.0
        self._deviations = deviations
        self.unchanged: Array = np.zeros(len(deviations))
        self._points = np.concatenate([each.points for each in self.seen])
        self._pixels = np.concatenate([each.pixels for each in self.seen])
        counts = [len(each.points) for each in self.seen]
        firsts = [sum(counts[:i]) for i in range(len(counts))]
        self._parts = [slice(first, first + count) for first, count in zip(firsts, counts, strict=True)]
        alike = [[i for i, c in enumerate(counts) if c == count] for count in sorted(set(counts))]
        self._groups = [_Group(members, self.seen, firsts) for members in alike]

    def starts(self) -> list[Array]:
        """Give poses from which a search may begin: both that each marker allows, and those of all corners."""
        found: list[Array] = []
        if len(self.seen) > 1:
            rays = self.lens.rays(self._pixels)
            flat = self._points - self._points.mean(axis=0)
            _, sizes, axes = np.linalg.svd(flat, full_matrices=False)
            if sizes[2] < 1e-6 * sizes[0]:
                # IPPE wants the points in its xy plane.
                turn = axes if np.linalg.det(axes) > 0 else axes * np.array([[1.0], [1.0], [-1.0]])
                to_plane = motion(turn, -turn @ self._points.mean(axis=0))
                found += [pose @ to_plane for pose in _solved(flat @ turn.T, rays, cv2.SOLVEPNP_IPPE)]
            else:
                found += _solved(self._points, rays, cv2.SOLVEPNP_SQPNP)
        for each in sorted(self.seen, key=lambda s: -s.extent)[:_CANDIDATES_OF]:
            found += planar_poses(self.lens, each)
        return found

    def typical(self, pose: Array, change: Array | None = None) -> float:
        """Give how many standard deviations a corner is off at a pose: the median over what is seen."""
        errors = self._errors(pose, self.unchanged if change is None else change)
        if errors is None:
            return float("inf")
        squares = [np.mean(group.white(errors) ** 2, axis=1) for group in self._groups]
        return float(np.sqrt(np.median(np.concatenate(squares))))

    def cost(self, pose: Array, change: Array | None = None) -> float:
        """Give the robust cost of a pose."""
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
        """Search for the least cost from a start (Levenberg and Marquardt).

        None if there is none in front of the start, or if after some rounds it is still far above `enough`.
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
        normal, _ = self._equations(pose, change)
        try:
            covariance = np.asarray(np.linalg.inv(normal)[:6, :6], dtype=np.float64)
        except np.linalg.LinAlgError:
            covariance = np.full((6, 6), np.inf)
        return Solution(pose, change, cost, covariance)

    def errors(self, pose: Array, change: Array) -> list[Array] | None:
        """Give the errors of all that is seen at a pose, px, n × 2 each; None where something is behind the camera."""
        errors = self._errors(pose, change)
        return None if errors is None else [errors[part] for part in self._parts]

    def _errors(self, pose: Array, change: Array) -> Array | None:
        camera = self._points @ pose[:3, :3].T + pose[:3, 3]
        if camera[:, 2].min() < 1e-3:
            return None
        return np.asarray(self.lens.projected(camera, change * self._deviations) - self._pixels)

    def _equations(self, pose: Array, change: Array) -> tuple[Array, Array]:
        """Give the normal equations at a pose: rotation, displacement, intrinsics in standard deviations."""
        camera = self._points @ pose[:3, :3].T + pose[:3, 3]
        pixels, by_point, by_lens = self.lens.projected_with_slopes(camera, change * self._deviations)
        errors = pixels - self._pixels
        # A rotation by r moves a point p by r × p, and so a pixel by slope · (r × p) = r · (p × slope).
        slopes = np.concatenate((_cross(camera[:, None, :], by_point), by_point, by_lens * self._deviations), axis=2)
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


def planar_poses(lens: Lens, each: Seen) -> list[Array]:
    """Give the poses of the camera (camera_from_origin) that one marker, or one board, allows: one or two."""
    rays = lens.rays(each.pixels)
    if each.square is not None:
        half = each.size / 2
        corners = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
        marker_from_origin = inverted(each.square)
        return [pose @ marker_from_origin for pose in _solved(corners, rays, cv2.SOLVEPNP_IPPE_SQUARE)]
    z = each.normal
    x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0), z)
    x /= np.linalg.norm(x)
    plane = np.vstack((x, np.cross(z, x), z))
    to_plane = np.eye(4)
    to_plane[:3, :3] = plane
    to_plane[:3, 3] = -plane @ each.middle
    flat = each.points @ plane.T + to_plane[:3, 3]
    flat[:, 2] = 0.0
    return [pose @ to_plane for pose in _solved(flat, rays, cv2.SOLVEPNP_IPPE)]


def _solved(points: Array, rays: Array, flags: int) -> list[Array]:
    """Give OpenCV's closed solutions for points seen along rays, 4 × 4; none where it finds none."""
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
    """Give the cross products of vectors along the last axis; np.cross takes several times as long for so few."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    result = np.empty(b.shape)
    result[..., 0] = y * w - z * v
    result[..., 1] = z * u - x * w
    result[..., 2] = x * v - y * u
    return result
