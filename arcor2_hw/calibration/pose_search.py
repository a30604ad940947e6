"""The search for the pose of a camera from several starts. Contradictions are excluded, ambiguity is refused."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from arcor2_hw.calibration.camera_results import PoseOptions
from arcor2_hw.calibration.layout import item_name
from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.pose_problem import DetectedTarget, Hints, PoseProblem, Solution
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.rigid import inverted, pose_difference
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.messages import Message

_TRIED: Final = 4
"""Number of best starts that are refined."""
_TELL_APART: Final = 16.0
"""Difference of cost (chi square) above which the better of two poses is correct: four standard deviations."""
_NO_RIVAL: Final = 300.0
"""Cost of a start above that of the best pose from which it cannot lead to a rival.

The closed form for all corners yields both poses that a flat layout allows; other starts are for cases it misses.
"""
_SCALINGS: Final = 3
_SAME: Final = (0.002, 0.004)
"""Differences in m and rad up to which two poses are the same."""


@dataclass(frozen=True, eq=False)
class PoseCandidate:
    """A pose (camera_from_origin), errors in px, and the lens.

    Attributes:
        change: Change of the intrinsics in standard deviations.
        covariance: Of the camera in the frame of the origin, m and rad.
    """

    pose: Array
    change: Array
    covariance: Array
    seen: list[DetectedTarget]
    errors: list[Array]
    parameters: CameraParameters
    left_out: set[tuple[str, int]] = field(default_factory=set)

    @property
    def used(self) -> list[DetectedTarget]:
        """Return the targets that were not excluded."""
        return [each for each in self.seen if each.key not in self.left_out]


def search(lens: Lens, seen: Sequence[DetectedTarget], hints: Hints, options: PoseOptions) -> PoseCandidate:
    """Find the pose that explains everything detected.

    Raises:
        CalibrationRefused: The result is ambiguous, implausible or missing.
    """
    left_out: set[tuple[str, int]] = set()
    changes = lens_changes(lens, options)
    everything = PoseProblem(lens, seen, hints, changes)
    while True:
        used = [each for each in seen if each.key not in left_out]
        problem = PoseProblem(lens, used, hints, changes) if left_out else everything
        best = solve(problem, options)
        worst, worst_key = worst_of(problem, best)
        if worst <= options.largest_residual:
            break
        names = {each.key: each.name for each in used}
        if len(names) < 3:
            raise CalibrationRefused(
                "The picture contradicts the configuration of {names} by {worst:.0f} px: "
                "it is at another place, or has another size.",
                f"residual {worst:.1f} px, at most {options.largest_residual:.1f}",
                Reason.IMPLAUSIBLE,
                names=Message.listed([item_name(name) for name in sorted(names.values())]),
                worst=worst,
            )
        left_out.add(worst_key)
        if 2 * (len(names) - 1) <= len({each.key for each in seen}):
            raise CalibrationRefused(
                "Most markers are not at their configured poses: no majority agrees on the pose of the camera.",
                f"{len(left_out)} of {len({each.key for each in seen})} contradict the others",
                Reason.IMPLAUSIBLE,
            )
    left = everything.errors(best.pose, best.change)
    if left is None:
        raise CalibrationRefused("The markers contradict each other.", reason=Reason.IMPLAUSIBLE)
    parameters = lens.changed(changes @ best.change)
    return PoseCandidate(best.pose, best.change, covariance_of(best), list(seen), left, parameters, left_out)


def solve(problem: PoseProblem, options: PoseOptions) -> Solution:
    """Return the best pose of a problem, even if it contradicts the image.

    Raises:
        CalibrationRefused: Another pose is equally good, or there is none.
    """
    typical = [(problem.typical(start), start) for start in problem.starts()]
    starts = [start for errors, start in typical if np.isfinite(errors)]
    if not starts:
        raise CalibrationRefused("No pose of the camera explains the picture.", reason=Reason.NOT_CONVERGED)
    problem.scale = max(1.0, min(errors for errors, _ in typical))
    found = _minima(problem, starts)
    for _ in range(_SCALINGS):
        scale = max(1.0, problem.typical(found[0].pose, found[0].change)) if found else problem.scale
        if abs(scale / problem.scale - 1) < 0.1:
            break
        problem.scale = scale
        least = min(problem.cost(each.pose, each.change) for each in found)
        again = [problem.refined(each.pose, each.change, enough=least) for each in found]
        found = sorted((each for each in again if each), key=lambda each: each.cost)
    allowed = [each for each in found if _allowed(each.pose, options)]
    if not allowed:
        raise CalibrationRefused(
            "The position of the camera according to the picture is impossible: it is below its minimum height."
            if found
            else "The position of the camera according to the picture is impossible: it could not be found.",
            "" if not found else f"z = {inverted(found[0].pose)[2, 3]:.3f} m, at least {options.lowest} m",
            Reason.IMPLAUSIBLE if found else Reason.NOT_CONVERGED,
        )
    best = allowed[0]
    if worst_of(problem, best)[0] > options.largest_residual:
        return best
    for other in allowed[1:]:
        distance, angle = pose_difference(inverted(best.pose), inverted(other.pose))
        if other.cost - best.cost < _TELL_APART and distance > 2 * options.largest_deviation:
            raise CalibrationRefused(
                "Two poses of the camera, {distance:.0f} mm and {angle:.0f}° apart, explain the picture, because it "
                "was taken from nearly straight ahead of {names}. Add a second marker, take the picture from the "
                "side or from closer, or state the direction of gravity or the approximate pose of the camera.",
                f"costs {best.cost:.1f} and {other.cost:.1f}",
                Reason.AMBIGUOUS,
                distance=distance * 1000,
                angle=np.degrees(angle),
                names=Message.listed([item_name(name) for name in sorted({each.name for each in problem.seen})]),
            )
    return best


def worst_of(problem: PoseProblem, solution: Solution) -> tuple[float, tuple[str, int]]:
    """Return the largest residual of a target, px, and the target."""
    errors = problem.errors(solution.pose, solution.change) or []
    residuals = [float(np.sqrt(np.mean(np.sum(each**2, axis=1)))) for each in errors]
    index = int(np.argmax(residuals))
    return residuals[index], problem.seen[index].key


def covariance_of(solution: Solution) -> Array:
    """Return the covariance of the camera in the frame of the origin: position (m), rotation vector (rad), (6, 6)."""
    # From a motion of the origin before the camera (rotation, displacement) to one of the camera in the origin.
    back = -solution.pose[:3, :3].T
    turn = np.zeros((6, 6))
    turn[:3, 3:] = back
    turn[3:, :3] = back
    return np.asarray(turn @ solution.covariance @ turn.T)


def lens_changes(lens: Lens, options: PoseOptions) -> Array:
    """Return the intrinsics (as Lens.numbers) as independent unknowns, each with its standard deviation, (n, n)."""
    p = lens.parameters
    centre = options.centre_deviation
    coefficients = np.abs(lens.coefficients) * options.distortion_deviation
    focal = options.focal_deviation * p.fx, options.focal_deviation * p.fy
    return np.diag([*focal, centre, centre, *coefficients])


def _minima(problem: PoseProblem, starts: list[Array]) -> list[Solution]:
    """Return the distinct minima reached from the best starts, best first."""
    result: list[Solution] = []
    tried: list[Array] = []
    least = float("inf")
    for cost, start in sorted(((problem.cost(start), start) for start in starts), key=lambda each: each[0]):
        if len(tried) >= _TRIED or cost > least + _NO_RIVAL:
            break
        if any(_same(start, other) for other in tried):
            continue
        tried.append(start)
        solution = problem.refined(start, enough=least)
        if solution is not None and not any(_same(solution.pose, other.pose) for other in result):
            result.append(solution)
            least = min(least, solution.cost)
    return sorted(result, key=lambda each: each.cost)


def _same(a: Array, b: Array) -> bool:
    """Return whether two poses (camera_from_origin) are the same."""
    distance, angle = pose_difference(inverted(a), inverted(b))
    return distance < _SAME[0] and angle < _SAME[1]


def _allowed(pose: Array, options: PoseOptions) -> bool:
    """Return whether the camera may be at a pose."""
    return not isinstance(options.lowest, float | int) or float(inverted(pose)[2, 3]) >= options.lowest
