"""Hand-eye calibration as one least-squares problem over the corners of all images, with one mount and one target.

For station i, `parent_from_hand` is known (of the carrier of the camera, or inversely of the carried target). A point
p of the target is projected from X⁻¹ · Hᵢ⁻¹ · T · p, with unknown mount X and target T.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.pose_problem import DetectedTarget
from arcor2_hw.calibration.rigid import cross_matrix, inverted, moved

_ROUNDS: Final = 60
_WEIGHINGS: Final = 2
_SOFT: Final = 3.0
"""Ratio of a station's error to the typical error above which it has less weight (Cauchy)."""


@dataclass(frozen=True, eq=False)
class Station:
    """One image: index of the sample, pose of the hand (4, 4), and detected points in the frame of the target."""

    index: int
    hand: Array
    seen: list[DetectedTarget]

    @property
    def points(self) -> Array:
        """Return the detected points of the target, (n, 3)."""
        return np.concatenate([each.points for each in self.seen])

    @property
    def pixels(self) -> Array:
        """Return their pixels, (n, 2)."""
        return np.concatenate([each.pixels for each in self.seen])


@dataclass(frozen=True, eq=False)
class Mount:
    """The mount (X) and the target (T), (4, 4), and the errors of each station's corners, px.

    Attributes:
        covariance: Of a small motion after the mount (rotation in rad, displacement in m), in the frame of the hand.
    """

    mount: Array
    target: Array
    errors: list[Array]
    covariance: Array


def errors_at(lens: Lens, stations: Sequence[Station], mount: Array, target: Array) -> list[Array] | None:
    """Return the errors of all corners, px; None where a point would be behind the camera."""
    result = []
    for each in stations:
        chain = inverted(each.hand @ mount) @ target
        camera = each.points @ chain[:3, :3].T + chain[:3, 3]
        if camera[:, 2].min() < 1e-3:
            return None
        result.append(lens.projected(camera, np.zeros(len(lens.numbers))) - each.pixels)
    return result


def refined(
    lens: Lens, stations: Sequence[Station], mount: Array, target: Array, robot: tuple[float, float]
) -> Mount | None:
    """Find the mount and the target that explain all corners best, from an initial guess.

    Args:
        lens: The lens.
        stations: Images and hand poses.
        mount: Initial mount, (4, 4).
        target: Initial target, (4, 4).
        robot: Standard deviations of hand poses, m and rad. Only their ratio to each other and to the errors of corners
            matters. An inexact hand pose moves all corners of an image together; without it in the weights, such a
            motion would count as many independent measurements.
    """
    found: Mount | None = None
    for _ in range(_WEIGHINGS):
        whiteners = _whiteners(lens, stations, mount, target, robot)
        found = _searched(lens, stations, mount, target, whiteners) if whiteners is not None else None
        if found is None:
            return None
        mount, target = found.mount, found.target
    return found


def _searched(
    lens: Lens, stations: Sequence[Station], mount: Array, target: Array, whiteners: Sequence[Array]
) -> Mount | None:
    """Search with given weights (Levenberg-Marquardt)."""
    errors = errors_at(lens, stations, mount, target)
    if errors is None:
        return None
    damping, usual = 1e-4, 1.0
    for _ in range(_ROUNDS):
        usual = _usual(errors, whiteners)
        cost = _cost(errors, whiteners, usual)
        normal, right = _equations(lens, stations, mount, target, errors, whiteners, usual)
        gain = -1.0
        while gain < 0 and damping < 1e8:
            step = np.asarray(np.linalg.solve(normal + damping * np.diag(np.diag(normal)), right), dtype=np.float64)
            tried = moved(mount, step[:6]), moved(target, step[6:])
            new = errors_at(lens, stations, *tried)
            gain = cost - _cost(new, whiteners, usual) if new is not None else -1.0
            damping = max(damping / 10, 1e-9) if gain >= 0 else damping * 10
        if gain < 0 or new is None:
            break
        (mount, target), errors = tried, new
        if gain < 1e-6 * max(cost, 1.0):
            break
    usual = _usual(errors, whiteners)
    normal, _ = _equations(lens, stations, mount, target, errors, whiteners, usual)
    freedom = max(len(stations) - 2, 1) / len(stations)
    try:
        covariance = np.asarray(np.linalg.inv(normal)[:6, :6] / freedom, dtype=np.float64)
    except np.linalg.LinAlgError:
        covariance = np.full((6, 6), np.inf)
    return Mount(mount, target, errors, covariance)


def _whiteners(
    lens: Lens, stations: Sequence[Station], mount: Array, target: Array, robot: tuple[float, float]
) -> list[Array] | None:
    """Return for each station the matrix that whitens its errors; None where a point would be behind the camera."""
    if errors_at(lens, stations, mount, target) is None:
        return None
    position, orientation = robot
    variances = np.array([orientation**2] * 3 + [position**2] * 3)
    result = []
    for each in stations:
        by_hand = slopes_of(lens, each, mount, target)[:, :6]
        covariance = (by_hand * variances) @ by_hand.T
        first = 0
        for seen in each.seen:
            last = first + len(seen.root)
            covariance[first:last, first:last] += np.linalg.inv(seen.root.T @ seen.root)
            first = last
        result.append(np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)), dtype=np.float64))
    return result


def _usual(errors: Sequence[Array], whiteners: Sequence[Array]) -> float:
    """Return the typical error of a station relative to its expected error, the median."""
    sizes = [np.mean((root @ each.ravel()) ** 2) for each, root in zip(errors, whiteners, strict=True)]
    return max(float(np.sqrt(np.median(sizes))), 1e-3)


def _cost(errors: Sequence[Array], whiteners: Sequence[Array], usual: float) -> float:
    total = 0.0
    for each, root in zip(errors, whiteners, strict=True):
        reach = _SOFT**2 * each.size
        total += reach * float(np.log1p(np.sum((root @ each.ravel()) ** 2) / usual**2 / reach))
    return total


def slopes_of(lens: Lens, station: Station, mount: Array, target: Array) -> Array:
    """Return the derivatives of a station's pixels by small motions of mount and target (rotation, displacement)."""
    hand_from_parent, camera_from_hand = inverted(station.hand), inverted(mount)
    placed = station.points @ target[:3, :3].T + target[:3, 3]
    at_hand = placed @ hand_from_parent[:3, :3].T + hand_from_parent[:3, 3]
    camera = at_hand @ camera_from_hand[:3, :3].T + camera_from_hand[:3, 3]
    _, by_point, _ = lens.projected_with_slopes(camera, np.zeros(len(lens.numbers)))
    by_hand = by_point @ camera_from_hand[:3, :3]
    by_placed = by_hand @ hand_from_parent[:3, :3]
    a = np.concatenate(
        (by_hand @ cross_matrix(at_hand), -by_hand, -by_placed @ cross_matrix(placed), by_placed), axis=2
    )
    return np.asarray(a.reshape(-1, 12))


def _equations(
    lens: Lens,
    stations: Sequence[Station],
    mount: Array,
    target: Array,
    errors: Sequence[Array],
    whiteners: Sequence[Array],
    usual: float,
) -> tuple[Array, Array]:
    """Return the normal equations for small motions of mount and target (rotation, displacement)."""
    normal, right = np.zeros((12, 12)), np.zeros(12)
    for each, left, root in zip(stations, errors, whiteners, strict=True):
        a = root @ slopes_of(lens, each, mount, target)
        white = root @ left.ravel()
        weight = 1.0 / (1.0 + float(white @ white) / usual**2 / (_SOFT**2 * len(white))) / usual**2
        normal += weight * a.T @ a
        right -= weight * a.T @ white
    return normal, right
