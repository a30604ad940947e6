"""Check of a camera's lens by the markers of one view: goodness of fit, and the focal length that fits them best."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtrc

from arcor2_hw.calibration.camera_results import LensCheck, LensState, PoseOptions
from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.pose_problem import Hints, PoseProblem, Solution
from arcor2_hw.calibration.pose_search import PoseCandidate, covariance_of, lens_changes
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.rigid import inverted, rotation_vector
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.messages import Message

SIGNIFICANT: Final = 0.001
"""Probability of a misfit by chance below which measurement and model disagree."""
CERTAIN: Final = 3.3
"""Number of standard deviations that corresponds to SIGNIFICANT."""
_NOISE_KNOWN: Final = 1.4
"""Factor to which the noise of corners is known: it is itself an estimate from the edges of each marker."""
_FOCAL_RANGE: Final = 0.1
"""Standard deviation of the focal length in the check, as a fraction, as if it was hardly known."""
_CONFIRMED: Final = 0.004
"""Standard deviation of the measured focal length up to which markers confirm a lens, as a fraction."""


def is_misfit(squares: float, freedom: int) -> bool:
    """Return whether residuals are larger than the noise of corners explains.

    Args:
        squares: Chi square of the residuals.
        freedom: Degrees of freedom.

    Source: K. Pearson, "On the criterion that a given system of deviations ...", Philosophical Magazine 50 (1900).
    """
    return bool(chdtrc(max(freedom, 1), squares / _NOISE_KNOWN**2) < SIGNIFICANT)


@dataclass(frozen=True, eq=False)
class CheckedPose:
    """A pose checked against the noise of corners and with an unknown focal length.

    Attributes:
        lens: The result for the lens.
        misfit: Whether the residuals are larger than the noise of corners explains.
        covariance: Of the camera in the frame of the origin, position (m) and rotation vector (rad), (6, 6). It grows
            with the misfit, and with the distance between the pose and the one that another focal length gives, when
            the lens is contradicted.
    """

    lens: LensCheck
    misfit: bool
    covariance: Array


def check_of_lens(lens: Lens, found: PoseCandidate, hints: Hints, options: PoseOptions) -> CheckedPose:
    """Check a pose and the lens.

    The pose is computed again with an unknown focal length, and its change is compared with its standard deviation
    (Wald's test). Standard deviations grow with the misfit that remains (Birge's ratio).

    Args:
        lens: The lens.
        found: The pose found with the lens.
        hints: Prior knowledge of the pose.
        options: Standard deviations of the intrinsics.

    Raises:
        CalibrationRefused: The search does not converge.

    Sources: A. Wald, "Tests of statistical hypotheses concerning several parameters", Transactions of the American
    Mathematical Society 54 (1943); R. Birge, "The calculation of errors by the method of least squares", Physical
    Review 40 (1932).
    """
    known = lens_changes(lens, options)
    focal = np.zeros(len(known))
    focal[:2] = lens.numbers[:2] * _FOCAL_RANGE
    seen, pose, change = found.used, found.pose, found.change
    as_given, misfit, is_large = _solved(PoseProblem(lens, seen, hints, known), pose, change)
    unknown = PoseProblem(lens, seen, hints, np.column_stack((focal, known)))
    other, left, _ = _solved(unknown, pose, np.append(0.0, change))
    factor = 1.0 + _FOCAL_RANGE * float(other.change[0])
    deviation = _FOCAL_RANGE * math.sqrt(float(other.lens_covariance[0, 0]))
    contradicted = abs(factor - 1.0) > CERTAIN * math.hypot(deviation, options.focal_deviation)
    state = LensState.CONFIRMED if deviation <= _CONFIRMED else LensState.UNCHECKED
    state = LensState.CONTRADICTED if contradicted else state
    covariance = covariance_of(as_given)
    if contradicted:
        shift = _between(as_given, other)
        covariance = covariance + np.outer(shift, shift)
    p = lens.parameters
    parameters = CameraParameters(p.fx * factor, p.fy * factor, p.cx, p.cy, p.dist_coefs)
    distance = float(np.median([np.linalg.norm(inverted(pose)[:3, 3] - each.middle) for each in seen]))
    verdict = _verdict(state, factor, deviation, distance)
    check = LensCheck(state, factor, deviation, misfit, left, parameters, verdict.text, **verdict.translation())
    return CheckedPose(check, is_large, covariance)


def _solved(problem: PoseProblem, pose: Array, change: Array) -> tuple[Solution, float, bool]:
    """Return the solution near a pose with its misfit in its covariance, the misfit, and whether it is significant."""
    solution = problem.refined(pose, change)
    if solution is not None:
        squares, freedom = problem.goodness(solution.pose, solution.change)
        misfit = math.sqrt(squares / max(freedom, 1))
        if misfit > 1.0:
            problem.scale = misfit
            solution = problem.solution(solution.pose, solution.change, solution.cost)
        return solution, misfit, is_misfit(squares, freedom)
    raise CalibrationRefused("No pose of the camera explains the picture.", reason=Reason.NOT_CONVERGED)


def _between(a: Solution, b: Solution) -> Array:
    """Return the motion of the camera between two solutions: position (m), rotation vector (rad), (6)."""
    one, other = inverted(a.pose), inverted(b.pose)
    return np.concatenate((other[:3, 3] - one[:3, 3], rotation_vector(other[:3, :3] @ one[:3, :3].T)))


def _verdict(state: LensState, factor: float, deviation: float, distance: float) -> Message:
    """Return the conclusion from the markers about the focal length, and the recommended action."""
    match state:
        case LensState.CONFIRMED:
            return Message.of("The markers confirm the focal length to {deviation:.1%}.", deviation=deviation)
        case LensState.CONTRADICTED:
            text = (
                "The markers fit a focal length that is {change:.1%} larger (± {deviation:.1%}). "
                "Determine the intrinsic parameters of the camera again, and measure the markers."
                if factor > 1
                else "The markers fit a focal length that is {change:.1%} smaller (± {deviation:.1%}). "
                "Determine the intrinsic parameters of the camera again, and measure the markers."
            )
            return Message.of(text, change=abs(factor - 1), deviation=deviation)
        case LensState.UNCHECKED:
            return Message.of(
                "This view does not check the focal length: an error of 1 % moves the camera by {shift:.0f} mm. "
                "Look from the side, or add markers at another height.",
                shift=distance * 10,
            )
