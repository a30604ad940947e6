"""Hand and eye as one least-squares problem: the corners of all pictures against one mount and one target.

Of station i is known `parent_from_hand` (of what carries the camera, or of what the camera carries turned round): a
point p of the target is seen at X⁻¹ · Hᵢ⁻¹ · T · p, with the mount X and the target T, both unknown.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.pose_problem import Seen
from arcor2_hw.calibration.rigid import crossed, inverted, moved

_ROUNDS: Final = 60
_SOFT: Final = 3.0
"""How many times the usual error a station may be off before it counts less (Cauchy)."""


@dataclass(frozen=True, eq=False)
class Station:
    """One picture: index of the sample, where the hand was (4 × 4), what was seen (points in the target's frame)."""

    index: int
    hand: Array
    seen: list[Seen]

    @property
    def points(self) -> Array:
        """Give the points of the target that were seen, n × 3."""
        return np.concatenate([each.points for each in self.seen])

    @property
    def pixels(self) -> Array:
        """Give where they were seen, n × 2."""
        return np.concatenate([each.pixels for each in self.seen])


@dataclass(frozen=True, eq=False)
class Mount:
    """mount (X) and target (T), 4 × 4; errors of each station's corners, px.

    covariance: of a small motion after the mount (rotation in rad, displacement in m), in the hand's frame.
    """

    mount: Array
    target: Array
    errors: list[Array]
    covariance: Array


def errors_at(lens: Lens, stations: Sequence[Station], mount: Array, target: Array) -> list[Array] | None:
    """Give the errors of all corners, px; None where something would lie behind the camera."""
    result = []
    for each in stations:
        chain = inverted(each.hand @ mount) @ target
        camera = each.points @ chain[:3, :3].T + chain[:3, 3]
        if camera[:, 2].min() < 1e-3:
            return None
        result.append(lens.projected(camera, np.zeros(len(lens.numbers))) - each.pixels)
    return result


def refined(lens: Lens, stations: Sequence[Station], mount: Array, target: Array) -> Mount | None:
    """Search for the mount and the target that explain all corners (Levenberg and Marquardt), from a start."""
    errors = errors_at(lens, stations, mount, target)
    if errors is None:
        return None
    damping = 1e-4
    for _ in range(_ROUNDS):
        usual = max(float(np.median([_size(each) for each in errors])), 1e-3)
        cost = _cost(errors, usual)
        normal, right = _equations(lens, stations, mount, target, errors, usual)
        gain = -1.0
        while gain < 0 and damping < 1e8:
            step = np.asarray(np.linalg.solve(normal + damping * np.diag(np.diag(normal)), right), dtype=np.float64)
            tried = moved(mount, step[:6]), moved(target, step[6:])
            new = errors_at(lens, stations, *tried)
            gain = cost - _cost(new, usual) if new is not None else -1.0
            damping = max(damping / 10, 1e-9) if gain >= 0 else damping * 10
        if gain < 0 or new is None:
            break
        (mount, target), errors = tried, new
        if gain < 1e-6 * max(cost, 1.0):
            break
    usual = max(float(np.median([_size(each) for each in errors])), 1e-3)
    normal, _ = _equations(lens, stations, mount, target, errors, usual)
    # The robot's errors are those of a whole picture, not of a corner: every station counts as few measurements.
    corners = sum(len(each) for each in errors)
    spread = float(np.mean(np.concatenate([np.sum(each**2, axis=1) for each in errors]))) / usual**2
    share = corners / max(3 * len(stations), 1)
    try:
        covariance = np.asarray(np.linalg.inv(normal)[:6, :6] * max(spread, 0.5) * max(share, 1.0), dtype=np.float64)
    except np.linalg.LinAlgError:
        covariance = np.full((6, 6), np.inf)
    return Mount(mount, target, errors, covariance)


def _size(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))


def _cost(errors: Sequence[Array], usual: float) -> float:
    total = 0.0
    for each in errors:
        reach = _SOFT**2 * len(each)
        total += reach * float(np.log1p(np.sum(each**2) / usual**2 / reach))
    return total


def _equations(
    lens: Lens, stations: Sequence[Station], mount: Array, target: Array, errors: Sequence[Array], usual: float
) -> tuple[Array, Array]:
    """Give the normal equations for small motions of mount and target (rotation, displacement)."""
    normal, right = np.zeros((12, 12)), np.zeros(12)
    unchanged = np.zeros(len(lens.numbers))
    for each, left in zip(stations, errors, strict=True):
        hand_from_parent, camera_from_hand = inverted(each.hand), inverted(mount)
        placed = each.points @ target[:3, :3].T + target[:3, 3]
        at_hand = placed @ hand_from_parent[:3, :3].T + hand_from_parent[:3, 3]
        camera = at_hand @ camera_from_hand[:3, :3].T + camera_from_hand[:3, 3]
        _, by_point, _ = lens.projected_with_slopes(camera, unchanged)
        by_hand = by_point @ camera_from_hand[:3, :3]
        by_placed = by_hand @ hand_from_parent[:3, :3]
        a = np.concatenate((by_hand @ crossed(at_hand), -by_hand, -by_placed @ crossed(placed), by_placed), axis=2)
        a = a.reshape(-1, 12)
        weight = 1.0 / (1.0 + float(np.sum(left**2)) / usual**2 / (_SOFT**2 * len(left))) / usual**2
        normal += weight * a.T @ a
        right -= weight * a.T @ left.ravel()
    return normal, right
