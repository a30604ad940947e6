"""The pose of a camera on a robot's flange (eye in hand), or next to the robot (eye to hand)."""

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from arcor2_hw.calibration.boards import check_pose
from arcor2_hw.calibration.camera_results import (
    HandEye,
    HandEyeError,
    HandEyeMethod,
    HandEyeOptions,
    HandEyeSample,
    Mounting,
    PoseOptions,
)
from arcor2_hw.calibration.detection import detect_layout
from arcor2_hw.calibration.drawing import error_picture
from arcor2_hw.calibration.hand_eye_check import check_of_hand_eye
from arcor2_hw.calibration.hand_eye_methods import METHODS
from arcor2_hw.calibration.hand_eye_problem import Mount, Station, refined
from arcor2_hw.calibration.layout import Layout
from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.pictures import one_by_one
from arcor2_hw.calibration.pose_problem import Hints
from arcor2_hw.calibration.pose_search import search
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.results import Grade
from arcor2_hw.calibration.rigid import cross_matrix, inverted, mean_rotation, motion, rotation_vector
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message

FEWEST: Final = 3
MAX_SAMPLES: Final = 300
_TARGET_DEVIATION: Final = 0.03
"""Standard deviation of the position from one image above which the image is not used, m."""
_OUTLIER: Final = 4.0
"""Ratio of a sample's error to the median error above which the sample is not used."""
_MIN_OUTLIER: Final = 1.0
"""Error up to which a sample is always used, px."""
_GOOD: Final = 0.001
"""Standard deviation of the position up to which a result is good, m."""


def find_hand_eye(
    samples: Sequence[HandEyeSample],
    parameters: CameraParameters,
    target: Layout,
    mounting: Mounting,
    options: HandEyeOptions | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> HandEye:
    """Find the pose of a camera on the flange, or in the robot's base frame.

    Args:
        samples: At least three, better ten or more, with the flange rotated about two or more axes between them.
        parameters: Parameters of the lens for this image size.
        target: Markers or board, with poses in the target's own frame.
        mounting: `eye_in_hand`: the target is fixed; `eye_to_hand`: the flange carries the target.
        options: Limits.
        progress: Called with the number of processed images and their total number.

    Raises:
        InvalidPicture: As in `find_camera_pose`.
        InvalidData: As in `find_camera_pose`; also fewer than three samples, or a flange pose that is not finite.
        CalibrationRefused: No marker in too many images; degenerate (rotations about one axis only, or too small);
            implausible (flange poses do not match the images); unobservable (too uncertain).
    """
    options = options or HandEyeOptions()
    if not FEWEST <= len(samples) <= MAX_SAMPLES:
        raise InvalidData(
            "{fewest} to {most_samples} samples are needed, not {count}",
            fewest=FEWEST,
            most_samples=MAX_SAMPLES,
            count=len(samples),
        )
    for index, each in enumerate(samples):
        check_pose(each.flange, f"the flange's pose of sample {index}")
    if not (0 < options.robot_position < 1 and 0 < options.robot_orientation < 1):
        raise InvalidData("robot_position and robot_orientation must be small positive numbers, in m and rad")
    problems: dict[int, Message] = {}
    stations: list[Station] = []
    eyes: list[Array] = []
    lens: Lens | None = None
    for index, grey in enumerate(one_by_one(each.picture for each in samples)):
        lens = lens or Lens(parameters, grey.shape[1], grey.shape[0])
        flange = samples[index].flange.matrix()
        hand = flange if mounting == "eye_in_hand" else inverted(flange)
        try:
            seen = detect_layout([grey], lens, target, options.blur_threshold, options.largest_blur).seen
            found = search(lens, seen, Hints(), PoseOptions(largest_deviation=_TARGET_DEVIATION))
        except CalibrationRefused as error:
            problems[index] = error.message
        else:
            if found.covariance[0, 0] + found.covariance[1, 1] + found.covariance[2, 2] < 3 * _TARGET_DEVIATION**2:
                stations.append(Station(index, hand, seen))
                eyes.append(found.pose)
            else:
                problems[index] = Message.of("the target is too far away, or seen only from the front")
        if progress is not None:
            progress(index + 1, len(samples))
    assert lens is not None
    _check_enough(stations, problems)
    _check_turns([each.hand for each in stations], options)
    best, methods = _solve(lens, stations, eyes, options)
    while (worst := _outlier(best)) is not None and len(stations) > max(FEWEST, len(samples) // 2):
        problems[stations[worst].index] = Message.of(
            "it contradicts the others by {residual:.1f} px: was the arm still moving?",
            residual=_root_mean_square(best.errors[worst]),
        )
        stations = [each for i, each in enumerate(stations) if i != worst]
        eyes = [each for i, each in enumerate(eyes) if i != worst]
        _check_turns([each.hand for each in stations], options)
        best, methods = _solve(lens, stations, eyes, options)
    return _result(best, methods, stations, problems, mounting, options, lens)


def _check_enough(stations: list[Station], problems: dict[int, Message]) -> None:
    """Require enough images of the target.

    Raises:
        CalibrationRefused: There are too few.
    """
    if len(stations) < FEWEST:
        first = next((f"sample {index}: {problem}" for index, problem in problems.items()), "")
        raise CalibrationRefused(
            "The target is well visible in {count} pictures only; at least {fewest} are needed, ten are recommended.",
            first,
            Reason.TOO_FEW_POINTS if stations else Reason.NO_MARKER,
            count=len(stations),
            fewest=FEWEST,
        )


def _check_turns(hands: list[Array], options: HandEyeOptions) -> None:
    """Require rotations of the flange about two axes.

    Raises:
        CalibrationRefused: The rotations are too small, or about one axis.
    """
    turns = [rotation_vector(a[:3, :3].T @ b[:3, :3]) for index, a in enumerate(hands) for b in hands[index + 1 :]]
    large = [turn / np.linalg.norm(turn) for turn in turns if np.linalg.norm(turn) >= options.smallest_turn]
    if not large:
        raise CalibrationRefused(
            "The flange was hardly turned between the images. Turn it by 30° or more about different axes.",
            f"largest rotation {math.degrees(max(float(np.linalg.norm(turn)) for turn in turns)):.1f}°",
            Reason.DEGENERATE,
        )
    axes = np.stack(large)
    spread = float(np.arccos(np.clip(np.abs(axes @ axes.T), 0.0, 1.0).min()))
    if spread < options.smallest_spread:
        raise CalibrationRefused(
            "The flange was turned about one axis only, so the position of the camera along this axis is "
            "undetermined. Turn it about another axis, too.",
            f"axes within {math.degrees(spread):.1f}°, at least {math.degrees(options.smallest_spread):.1f}°",
            Reason.DEGENERATE,
        )


def _solve(
    lens: Lens, stations: list[Station], eyes: list[Array], options: HandEyeOptions
) -> tuple[Mount, list[HandEyeMethod]]:
    """Return the mount that explains the images best, and the results of closed-form methods."""
    hands = [each.hand for each in stations]
    methods: list[HandEyeMethod] = []
    found: list[Mount] = []
    for name, method in METHODS.items():
        rotation, position = method(
            [each[:3, :3] for each in hands],
            [each[:3, 3] for each in hands],
            [each[:3, :3] for each in eyes],
            [each[:3, 3] for each in eyes],
            options.smallest_turn,
        )
        mount = motion(rotation, position)
        if not np.all(np.isfinite(mount)):
            continue
        target, turn, shift = _scatter([hand @ mount @ eye for hand, eye in zip(hands, eyes, strict=True)])
        methods.append(HandEyeMethod(name, Pose.from_matrix(mount), turn, shift))
        solution = refined(lens, stations, mount, target, (options.robot_position, options.robot_orientation))
        if solution is not None:
            found.append(solution)
    if not found:
        raise CalibrationRefused(
            "The flange poses do not match the images: no pose of the camera explains both. Check that they "
            "are in the same order and in the base frame, and that the mounting is correct.",
            reason=Reason.IMPLAUSIBLE,
        )
    return min(found, key=lambda each: _root_mean_square(np.concatenate(each.errors))), methods


def _scatter(targets: list[Array]) -> tuple[Array, float, float]:
    """Return the mean of poses, and their scatter (rms) in rad and m."""
    stacked = np.stack(targets)
    middle = motion(mean_rotation(stacked[:, :3, :3], np.ones(len(targets))), stacked[:, :3, 3].mean(axis=0))
    turns = [float(np.linalg.norm(rotation_vector(middle[:3, :3].T @ each[:3, :3]))) for each in targets]
    shifts = np.linalg.norm(stacked[:, :3, 3] - middle[:3, 3], axis=1)
    return middle, float(np.sqrt(np.mean(np.square(turns)))), float(np.sqrt(np.mean(shifts**2)))


def _root_mean_square(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))


def _outlier(mount: Mount) -> int | None:
    """Return the sample that fits far worse than the others."""
    residuals = [_root_mean_square(each) for each in mount.errors]
    worst = int(np.argmax(residuals))
    return worst if residuals[worst] > max(_OUTLIER * float(np.median(residuals)), _MIN_OUTLIER) else None


def _result(
    best: Mount,
    methods: list[HandEyeMethod],
    stations: list[Station],
    problems: dict[int, Message],
    mounting: Mounting,
    options: HandEyeOptions,
    lens: Lens,
) -> HandEye:
    """Return the result with its verdict, or refuse it."""
    checked = check_of_hand_eye(lens, stations, best, (options.robot_position, options.robot_orientation))
    residual = _root_mean_square(np.concatenate(best.errors))
    if residual > options.largest_residual:
        raise CalibrationRefused(
            "The flange poses do not match the pictures: the corners are off by {residual:.1f} px. Check that the "
            "poses are in the same order, of the flange and in the base frame, and that the mounting is correct.",
            f"at most {options.largest_residual} px",
            Reason.IMPLAUSIBLE,
            residual=residual,
        )
    # Outside of the solvers, position comes before rotation, and the displacement is that of the camera itself.
    turn = np.zeros((6, 6))
    turn[:3, :3] = -cross_matrix(best.mount[:3, 3])
    turn[:3, 3:] = turn[3:, :3] = np.eye(3)
    covariance = turn @ best.covariance @ turn.T
    if checked.contradicted:
        covariance = covariance + np.outer(checked.shift, checked.shift)
    position = float(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1]))
    orientation = float(np.sqrt(np.linalg.eigvalsh(covariance[3:, 3:])[-1]))
    if checked.contradicted and not position <= options.largest_deviation:
        raise CalibrationRefused(
            "The position of the camera would be off by {position:.0f} mm. {verdict}",
            f"at most {options.largest_deviation * 1000:.1f} mm",
            Reason.IMPLAUSIBLE,
            position=position * 1000,
            verdict=checked.verdict,
        )
    if not position <= options.largest_deviation:
        raise CalibrationRefused(
            "The position of the camera would be uncertain by {position:.0f} mm. Take more pictures, and turn the "
            "flange further, in all directions.",
            f"standard deviation {position * 1000:.1f} mm, at most {options.largest_deviation * 1000:.1f} mm",
            Reason.UNOBSERVABLE,
            position=position * 1000,
        )
    errors = [
        HandEyeError(s.index, len(e), _root_mean_square(e), float(np.linalg.norm(e, axis=1).max()))
        for s, e in zip(stations, best.errors, strict=True)
    ]
    errors += [
        HandEyeError(index, 0, 0.0, 0.0, used=False, problem=problem.text, **problem.translation())
        for index, problem in problems.items()
    ]
    errors.sort(key=lambda each: each.sample)
    count = len(stations)
    text = (
        "The camera's position on the flange is known to {position:.1f} mm and its direction to {direction:.2f}° "
        "(standard deviations; pictures: {count}, residual {residual:.2f} px)."
        if mounting == "eye_in_hand"
        else "The camera's position next to the robot is known to {position:.1f} mm and its direction to "
        "{direction:.2f}° (standard deviations; pictures: {count}, residual {residual:.2f} px)."
    )
    known = Message.of(
        text, position=position * 1000, direction=math.degrees(orientation), count=count, residual=residual
    )
    parts = [known, checked.verdict]
    grade = Grade.GOOD if position <= _GOOD and count >= 8 and checked.is_good else Grade.USABLE
    if count < 8:
        parts.append(Message.of("Ten pictures or more improve the result."))
    if problems:
        parts.append(
            Message.of(
                "Pictures that could not be used: {unused} of {count}.",
                unused=len(problems),
                count=count + len(problems),
            )
        )
    verdict = Message.joined(parts)
    views = [(f"sample {s.index}", s.pixels, e, True) for s, e in zip(stations, best.errors, strict=True)]
    return HandEye(
        mounting=mounting,
        pose=Pose.from_matrix(best.mount),
        target=Pose.from_matrix(best.target),
        residual=residual,
        samples=errors,
        methods=methods,
        covariance=[[float(value) for value in row] for row in covariance],
        position_deviation=position,
        orientation_deviation=orientation,
        grade=grade,
        verdict=verdict.text,
        picture=error_picture((lens.width, lens.height), views, verdict.text.split(" (")[0] + "."),
        **verdict.translation(),
    )
