"""Check of a hand-eye calibration: size of the target, focal length, fit of the corners, and accuracy of the robot."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import fdtrc

from arcor2_hw.calibration.hand_eye_problem import Mount, Station, errors_at, slopes_of
from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.lens_check import CERTAIN, SIGNIFICANT, is_misfit
from arcor2_hw.calibration.rigid import inverted, moved, rotation_vector
from arcor2_hw.messages import Message, translatable

_ROUNDS: Final = 4
_POSE: Final = 12
"""Number of unknowns of mount and target; size of the target and focal length follow."""
_CONFIRMED: Final = 0.0015
"""Standard deviation of the size of the target up to which the motions of the robot confirm it, as a fraction."""
_LEVELS: Final = np.logspace(-2, 2, 41)
"""Accuracies of the robot that are tried, as multiples of the expected one."""


@dataclass(frozen=True, eq=False)
class CheckedCalibration:
    """A hand-eye calibration with an unknown size of the target and an unknown focal length.

    Attributes:
        size: Size of the target that fits best, as a multiple of the given one, and its standard deviation.
        focal: The same for the focal length.
        confirmed: Whether size and focal length are known well enough to notice an error of 1 %.
        contradicted: Whether size and focal length differ significantly from the given ones.
        misfit: Whether the corners of single images do not fit the target and the lens.
        robot: Inaccuracy of the robot's poses as a multiple of the expected one.
        robot_misfit: Whether it is significantly larger than expected.
        shift: Motion of the mount to the one that fits best: position (m), rotation vector (rad), (6).
        by_percent: Distance by which the mount moves if the target is 1 % larger, and if the focal length is, m.
    """

    size: tuple[float, float]
    focal: tuple[float, float]
    confirmed: bool
    contradicted: bool
    misfit: bool
    robot: float
    robot_misfit: bool
    shift: Array
    by_percent: tuple[float, float]

    @property
    def is_good(self) -> bool:
        """Return whether everything was confirmed and nothing contradicts the result."""
        return self.confirmed and not (self.contradicted or self.misfit or self.robot_misfit)

    @property
    def verdict(self) -> Message:
        """Return the facts that confirm or contradict the result, and the recommended action."""
        parts = [self._contradiction() if self.contradicted else self._confirmation()]
        if self.misfit:
            misfit = "The corners fit neither target nor lens: check that the target is flat, and the intrinsics."
            parts.append(Message.of(misfit))
        if self.robot_misfit:
            inaccurate = "The poses of the robot are {factor:.0f} times less accurate than expected."
            parts.append(Message.of(inaccurate, factor=self.robot))
        return Message.joined(parts)

    def _confirmation(self) -> Message:
        size, focal = self.size[1], self.focal[1]
        if self.confirmed:
            return Message.of(
                "The motions of the robot confirm the size of the target to {size:.2%} and the focal length to "
                "{focal:.2%}.",
                size=size,
                focal=focal,
            )
        by_size, by_focal = (1000 * distance for distance in self.by_percent)
        return Message.of(
            "The motions of the robot confirm the size of the target to {size:.2%} and the focal length to {focal:.2%} "
            "only. The stated accuracy does not include their errors: 1 % of the size moves the camera by "
            "{by_size:.1f} mm, 1 % of the focal length by {by_focal:.1f} mm. Measure the target exactly, or take more "
            "pictures, farther apart.",
            size=size,
            focal=focal,
            by_size=by_size,
            by_focal=by_focal,
        )

    def _contradiction(self) -> Message:
        found = []
        for (value, deviation), larger, smaller in (
            (
                self.size,
                translatable("The target seems {difference} larger (± {deviation})."),
                translatable("The target seems {difference} smaller (± {deviation})."),
            ),
            (
                self.focal,
                translatable("The focal length seems {difference} larger (± {deviation})."),
                translatable("The focal length seems {difference} smaller (± {deviation})."),
            ),
        ):
            if abs(value - 1) > CERTAIN * deviation:
                text = larger if value > 1 else smaller
                found.append(Message.of(text, difference=f"{abs(value - 1):.1%}", deviation=f"{deviation:.1%}"))
        wrong = found or [Message.of("The size of the target or the focal length is wrong.")]
        return Message.joined(
            [
                Message.of("The motions of the robot contradict target or lens."),
                *wrong,
                Message.of("Measure the target and the lens."),
            ]
        )


def check_of_hand_eye(
    lens: Lens, stations: Sequence[Station], found: Mount, robot: tuple[float, float]
) -> CheckedCalibration:
    """Check a result by computing it again with an unknown size of the target and an unknown focal length.

    The inaccuracy of the robot is estimated from the images (chi square equals its degrees of freedom), so that an
    exact robot gives a sharp test. The two unknowns are tested together by Wald's test with the F distribution.

    Args:
        lens: The lens.
        stations: Images and hand poses.
        found: The result to check.
        robot: Expected standard deviations of hand poses, m and rad.

    Source: A. Wald, "Tests of statistical hypotheses concerning several parameters", Transactions of the American
    Mathematical Society 54 (1943).
    """
    mount, target, logs = found.mount, found.target, np.zeros(2)
    level, covariance = 1.0, np.full((_POSE + 2, _POSE + 2), np.inf)
    normal = np.zeros_like(covariance)
    freedom = sum(2 * len(each.points) for each in stations) - _POSE - 2
    for _ in range(_ROUNDS):
        tried_lens, tried = _changed(lens, stations, logs)
        errors = errors_at(tried_lens, tried, mount, target)
        if errors is None:
            break
        slopes = [_slopes(tried_lens, each, mount, target) for each in tried]
        level = _level(tried, errors, slopes, robot, freedom)
        normal, right = np.zeros((_POSE + 2, _POSE + 2)), np.zeros(_POSE + 2)
        for each, left, by in zip(tried, errors, slopes, strict=True):
            weight = np.linalg.inv(_covariance(each, by, robot, level))
            normal += by.T @ weight @ by
            right -= by.T @ weight @ left.ravel()
        try:
            covariance = np.asarray(np.linalg.inv(normal), dtype=np.float64)
        except np.linalg.LinAlgError:
            break
        step = covariance @ right
        mount, target, logs = moved(mount, step[:6]), moved(target, step[6:_POSE]), logs + step[_POSE:]
    deviations = np.sqrt(np.diag(covariance)[_POSE:])
    squares = float(logs @ np.linalg.solve(covariance[_POSE:, _POSE:], logs)) if np.isfinite(deviations).all() else 0.0
    between = max(6 * len(stations) - _POSE - 2, 1)
    shift = np.concatenate((mount[:3, 3] - found.mount[:3, 3], rotation_vector(mount[:3, :3] @ found.mount[:3, :3].T)))
    size, focal = np.exp(logs)
    return CheckedCalibration(
        (float(size), float(deviations[0])),
        (float(focal), float(deviations[1])),
        bool((deviations <= _CONFIRMED).all()),
        bool(fdtrc(2, between, squares / 2) < SIGNIFICANT),
        is_misfit(*_within(stations, lens, found)),
        level,
        level > 1.0 and is_misfit(_squares(tried, errors, slopes, robot, 1.0), freedom) if errors is not None else True,
        shift,
        _by_percent(normal, mount),
    )


def _by_percent(normal: Array, mount: Array) -> tuple[float, float]:
    """Return the distances by which 1 % of the size and of the focal length move the mount, m; infinite if unknown."""
    try:
        moves = -0.01 * np.linalg.solve(normal[:_POSE, :_POSE], normal[:_POSE, _POSE:])
    except np.linalg.LinAlgError:
        return np.inf, np.inf
    size, focal = (float(np.linalg.norm(moved(mount, move[:6])[:3, 3] - mount[:3, 3])) for move in moves.T)
    return size, focal


def _changed(lens: Lens, stations: Sequence[Station], logs: Array) -> tuple[Lens, list[Station]]:
    """Return a lens and stations with another focal length and another size of the target."""
    size, focal = np.exp(logs)
    p = lens.parameters
    other = type(p)(p.fx * focal, p.fy * focal, p.cx, p.cy, p.dist_coefs)
    scaled = [replace(s, seen=[replace(each, points=each.points * size) for each in s.seen]) for s in stations]
    return Lens(other, lens.width, lens.height), scaled


def _slopes(lens: Lens, station: Station, mount: Array, target: Array) -> Array:
    """Return the derivatives of a station's pixels by mount, target, log size and log focal length, (2n, 14)."""
    chain = inverted(station.hand @ mount) @ target
    points = station.points @ chain[:3, :3].T
    _, by_point, by_lens = lens.projected_with_slopes(points + chain[:3, 3], np.zeros(len(lens.numbers)))
    by_size = np.einsum("nij,nj->ni", by_point, points).ravel()
    by_focal = (by_lens[:, :, :2] @ lens.numbers[:2]).ravel()
    return np.column_stack((slopes_of(lens, station, mount, target), by_size, by_focal))


def _covariance(station: Station, slopes: Array, robot: tuple[float, float], level: float) -> Array:
    """Return the covariance of a station's pixels by the noise of corners and the inaccuracy of the robot, (2n, 2n)."""
    variances = level**2 * np.array([robot[1] ** 2] * 3 + [robot[0] ** 2] * 3)
    by_hand = slopes[:, :6]
    covariance = (by_hand * variances) @ by_hand.T
    first = 0
    for seen in station.seen:
        last = first + len(seen.root)
        covariance[first:last, first:last] += np.linalg.inv(seen.root.T @ seen.root)
        first = last
    return np.asarray(covariance)


def _squares(
    stations: Sequence[Station],
    errors: Sequence[Array],
    slopes: Sequence[Array],
    robot: tuple[float, float],
    level: float,
) -> float:
    """Return chi square with a robot of some accuracy."""
    return sum(
        float(left.ravel() @ np.linalg.solve(_covariance(each, by, robot, level), left.ravel()))
        for each, left, by in zip(stations, errors, slopes, strict=True)
    )


def _level(
    stations: Sequence[Station],
    errors: Sequence[Array],
    slopes: Sequence[Array],
    robot: tuple[float, float],
    freedom: int,
) -> float:
    """Return the inaccuracy of the robot with which chi square is as large as its degrees of freedom."""
    low, high = 0, len(_LEVELS) - 1
    while low < high:
        middle = (low + high) // 2
        if _squares(stations, errors, slopes, robot, float(_LEVELS[middle])) > freedom:
            low = middle + 1
        else:
            high = middle
    return float(_LEVELS[low])


def _within(stations: Sequence[Station], lens: Lens, found: Mount) -> tuple[float, int]:
    """Return chi square of the corners with a pose of its own for each image, and its degrees of freedom."""
    total, freedom = 0.0, 0
    for each, left in zip(stations, found.errors, strict=True):
        by_hand = slopes_of(lens, each, found.mount, found.target)[:, :6]
        root = np.linalg.cholesky(np.linalg.inv(_covariance(each, by_hand, (0.0, 0.0), 0.0))).T
        a, b = root @ by_hand, root @ left.ravel()
        rest = b - a @ np.linalg.lstsq(a, b, rcond=None)[0]
        total += float(rest @ rest)
        freedom += len(b) - 6
    return total, freedom
