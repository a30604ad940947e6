"""The averaging method for the pose of a camera: one pose per marker, weighted by distance and angle."""

import math
from collections.abc import Sequence

import numpy as np

from arcor2_hw.calibration.camera_results import PoseOptions
from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.pose_problem import DetectedTarget, Hints, PoseProblem
from arcor2_hw.calibration.pose_search import PoseCandidate, covariance_of, lens_changes, solve
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.rigid import inverted, mean_rotation, motion
from arcor2_hw.exceptions import InvalidData

_FLAT: float = 2.0
"""Angle between the camera's axis and a marker's z up to which the marker has no weight, rad (protocol, section 15)."""


def weight_of(camera_from_origin: Array, target: DetectedTarget, options: PoseOptions) -> float:
    """Return the weight of a marker, 0 to 1, by its distance and its angle to the camera (protocol, section 15)."""
    middle = camera_from_origin[:3, :3] @ target.middle + camera_from_origin[:3, 3]
    distance = float(np.linalg.norm(middle))
    near = 1.0 - (distance - options.min_distance) / (options.max_distance - options.min_distance)
    theta = math.acos(float(np.clip((camera_from_origin[:3, :3] @ target.normal)[2], -1.0, 1.0)))
    facing = (theta - _FLAT) / (math.pi - _FLAT)
    return (min(max(near, 0.0), 1.0) + min(max(facing, 0.0), 1.0)) / 2


def averaged(lens: Lens, seen: Sequence[DetectedTarget], hints: Hints, options: PoseOptions) -> PoseCandidate:
    """Find a pose for each marker and average the poses.

    Raises:
        CalibrationRefused: No marker has an unambiguous pose, or two markers contradict each other.
        InvalidData: All weights are zero.
    """
    changes = lens_changes(lens, options)
    refusal: CalibrationRefused | None = None
    left_out: set[tuple[str, int]] = set()
    poses: list[Array] = []
    weights: list[float] = []
    covariances: list[Array] = []
    for each in seen:
        problem = PoseProblem(lens, [each], hints, changes)
        try:
            solution = solve(problem, options)
        except CalibrationRefused as error:
            refusal = refusal or error
            left_out.add(each.key)
            continue
        poses.append(inverted(solution.pose))
        weights.append(weight_of(solution.pose, each, options))
        covariances.append(covariance_of(solution))
    if not poses:
        assert refusal is not None
        raise refusal
    if sum(weights) <= 0:
        raise InvalidData("All markers have a weight of zero. Move the camera nearer, or tilt it towards the markers.")
    share = np.array(weights) / sum(weights)
    stacked = np.stack(poses)
    pose = motion(mean_rotation(stacked[:, :3, :3], share), share @ stacked[:, :3, 3])
    spread = stacked[:, :3, 3] - pose[:3, 3]
    covariance = np.einsum("n,nij->ij", share**2, np.stack(covariances))
    covariance[:3, :3] += np.einsum("n,ni,nj->ij", share**2, spread, spread)
    everything = PoseProblem(lens, seen, hints, changes)
    errors = everything.errors(inverted(pose), everything.unchanged)
    if errors is None:
        raise CalibrationRefused(
            "The poses of the markers contradict each other. Check the configured poses.", reason=Reason.IMPLAUSIBLE
        )
    for each, left in zip(seen, errors, strict=True):
        residual = float(np.sqrt(np.mean(np.sum(left**2, axis=1))))
        if residual > 10 * options.largest_residual and each.key not in left_out:
            raise CalibrationRefused(
                "{name} contradicts the others. Check its configured pose.",
                f"residual {residual:.0f} px",
                Reason.IMPLAUSIBLE,
                name=each.name.capitalize(),
            )
    return PoseCandidate(
        inverted(pose), everything.unchanged, covariance, list(seen), errors, lens.parameters, left_out
    )
