"""Camera intrinsics and distortion from images of a ChArUco board."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np

from arcor2_hw.calibration.boards import board_observations, board_of
from arcor2_hw.calibration.camera_results import Intrinsics, IntrinsicsOptions, ViewError
from arcor2_hw.calibration.drawing import error_picture
from arcor2_hw.calibration.layout import CharucoBoard
from arcor2_hw.calibration.lens import Array
from arcor2_hw.calibration.markers import detect
from arcor2_hw.calibration.pictures import Grey, Picture, one_by_one, sharpness_of
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.results import Grade
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message

MAX_PICTURES: Final = 300
_FLAGS: Final = {
    4: cv2.CALIB_FIX_K3,
    5: 0,
    8: cv2.CALIB_RATIONAL_MODEL,
    12: cv2.CALIB_RATIONAL_MODEL | cv2.CALIB_THIN_PRISM_MODEL,
}
_FIELDS: Final = (8, 6)
"""Columns and rows of the fields in which corners are counted."""
_OUTLIER: Final = 3.0
"""Ratio of a view's error to the median error above which the view is not used."""
_MIN_OUTLIER: Final = 0.5
"""Error up to which a view is always used, px."""
_GOOD: Final = 0.0007
"""Standard deviation of the focal length, as a fraction, up to which a calibration is good."""


@dataclass(frozen=True, eq=False)
class _View:
    index: int
    points: Array
    pixels: Array


@dataclass(frozen=True, eq=False)
class _Solution:
    matrix: Array
    coefficients: Array
    deviations: Array
    errors: list[Array]
    normals: Array
    """Normals of the board in the camera's frame, (n, 3)."""


def find_intrinsics(
    pictures: Sequence[Picture],
    board: CharucoBoard,
    options: IntrinsicsOptions | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Intrinsics:
    """Find the intrinsics of a camera.

    Args:
        pictures: Images of the board from different directions and distances, all over the image; 10 to 30 are good.
        board: The board; its pose is ignored.
        options: Lens model and limits.
        progress: Called with the number of processed images and their total number.

    Raises:
        InvalidPicture: As in `find_camera_pose`; also images of different sizes.
        InvalidData: The board is invalid, or the number of images is not between 1 and MAX_PICTURES.
        CalibrationRefused: Too few images or too little coverage; degenerate (the board is seen from one direction
            only); implausible (errors are large: another board, or a bent one).
    """
    options = options or IntrinsicsOptions()
    if not 1 <= len(pictures) <= MAX_PICTURES:
        raise InvalidData(
            "1 to {most_pictures} images are needed, not {count}", most_pictures=MAX_PICTURES, count=len(pictures)
        )
    made = board_of(board)
    size = (0, 0)
    views: list[_View] = []
    problems: dict[int, Message] = {}
    for index, grey in enumerate(one_by_one(pictures)):
        size = grey.shape[1], grey.shape[0]
        points, pixels = board_observations(grey, board, made, detect(grey, board.dictionary))
        if len(points):
            views.append(_View(index, points, pixels))
        else:
            problems[index] = _why_not(grey, options)
        if progress is not None:
            progress(index + 1, len(pictures))
    _check_enough(views, problems, size, options)
    solved = _solve(views, size, options)
    while (outlier := _outlier(solved)) is not None and len(views) > options.fewest_views:
        residual = _root_mean_square(solved.errors[outlier])
        text = "its corners are off by {residual:.1f} px: moved, bent or blurred"
        problems[views[outlier].index] = Message.of(text, residual=residual)
        views = [view for i, view in enumerate(views) if i != outlier]
        solved = _solve(views, size, options)
    _check_enough(views, problems, size, options)
    return _result(views, solved, problems, size, options, len(pictures))


def _why_not(grey: Grey, options: IntrinsicsOptions) -> Message:
    if sharpness_of(grey) < options.blur_threshold:
        return Message.of("the board is not visible, or the picture is blurred")
    return Message.of("the board is not visible, only in part, or too small")


def _check_enough(
    views: list[_View], problems: dict[int, Message], size: tuple[int, int], options: IntrinsicsOptions
) -> None:
    """Require enough views and coverage.

    Raises:
        CalibrationRefused: There are too few views, or too little coverage.
    """
    if len(views) < options.fewest_views:
        first = next((f"picture {index}: {problem}" for index, problem in problems.items()), "")
        if not views:
            text = "The board is in none of the pictures. Check its description."
            raise CalibrationRefused(text, first, Reason.NO_MARKER)
        raise CalibrationRefused(
            "The board is well visible in {count} pictures only; at least {fewest} are needed.",
            first,
            Reason.TOO_FEW_POINTS,
            count=len(views),
            fewest=options.fewest_views,
        )
    covered = coverage_of([view.pixels for view in views], size)
    if covered < options.smallest_coverage:
        raise CalibrationRefused(
            "The board covered only {covered:.0%} of the picture; at least {smallest_coverage:.0%} is needed. Hold "
            "it in the corners, too.",
            reason=Reason.TOO_FEW_POINTS,
            covered=covered,
            smallest_coverage=options.smallest_coverage,
        )


def coverage_of(pixels: Sequence[Array], size: tuple[int, int]) -> float:
    """Return the fraction of an image's fields that has a corner."""
    columns, rows = _FIELDS
    together = np.concatenate(pixels) / size * _FIELDS
    fields = {(int(x), int(y)) for x, y in together if 0 <= x < columns and 0 <= y < rows}
    return len(fields) / (columns * rows)


def _solve(views: list[_View], size: tuple[int, int], options: IntrinsicsOptions) -> _Solution:
    """Find the intrinsics that explain the views best."""
    points: Any = [view.points.astype(np.float32).reshape(-1, 1, 3) for view in views]
    pixels: Any = [view.pixels.astype(np.float32).reshape(-1, 1, 2) for view in views]
    start: Any = np.eye(3)
    try:
        _, matrix, coefficients, turns, places, deviations, _, _ = cv2.calibrateCameraExtended(
            points, pixels, size, start, np.zeros(5), flags=_FLAGS[options.coefficients]
        )
    except cv2.error as error:
        raise CalibrationRefused(
            "The pictures do not determine a lens. Check that all of them show the board, from different directions.",
            str(error).strip(),
            Reason.DEGENERATE,
        ) from error
    numbers = np.ravel(coefficients)[: options.coefficients].astype(np.float64)
    if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(numbers))):
        raise CalibrationRefused("The search for the lens did not converge.", reason=Reason.NOT_CONVERGED)
    errors, normals = [], []
    for view, turn, place in zip(views, turns, places, strict=True):
        expected: Any = cv2.projectPoints(view.points, turn, place, matrix, numbers)[0]
        errors.append(np.asarray(expected, dtype=np.float64).reshape(-1, 2) - view.pixels)
        normals.append(np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)[:, 2])
    return _Solution(
        np.asarray(matrix, dtype=np.float64),
        numbers,
        np.ravel(deviations)[:4].astype(np.float64),
        errors,
        np.stack(normals),
    )


def _outlier(solved: _Solution) -> int | None:
    """Return the view that fits far worse than the others."""
    residuals = [_root_mean_square(each) for each in solved.errors]
    worst = int(np.argmax(residuals))
    return worst if residuals[worst] > max(_OUTLIER * float(np.median(residuals)), _MIN_OUTLIER) else None


def _root_mean_square(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))


def _tilt_between(normals: Array) -> float:
    """Return the largest angle between two directions from which the board was seen, rad."""
    return float(np.arccos(np.clip(normals @ normals.T, -1.0, 1.0).min()))


def _result(
    views: list[_View],
    solved: _Solution,
    problems: dict[int, Message],
    size: tuple[int, int],
    options: IntrinsicsOptions,
    pictures: int,
) -> Intrinsics:
    """Return the result with its verdict, or refuse it."""
    tilt = _tilt_between(solved.normals)
    if tilt < options.smallest_tilt:
        raise CalibrationRefused(
            "The board is seen from one direction only, within {tilt:.0f}°, so the focal length and the distance "
            "cannot be distinguished. Tilt it by 30° or more in all directions.",
            f"at least {math.degrees(options.smallest_tilt):.0f}°",
            Reason.DEGENERATE,
            tilt=math.degrees(tilt),
        )
    residual = _root_mean_square(np.concatenate(solved.errors))
    if residual > options.largest_residual:
        raise CalibrationRefused(
            "The corners are off by {residual:.1f} px. Check that it is the configured board and that it is flat, "
            "or use a lens model with more coefficients.",
            f"residual {residual:.2f} px, at most {options.largest_residual}",
            Reason.IMPLAUSIBLE,
            residual=residual,
        )
    fx, fy, cx, cy = (float(solved.matrix[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
    width, height = size
    if not (0.25 < cx / width < 0.75 and 0.25 < cy / height < 0.75 and fx > 0 and 0.5 < fx / fy < 2.0):
        raise CalibrationRefused(
            "The lens that fits the pictures is implausible: its axis is far from the center of the picture. Take "
            "more pictures with the board tilted in all directions.",
            f"fx {fx:.1f}, fy {fy:.1f}, cx {cx:.1f}, cy {cy:.1f}",
            Reason.IMPLAUSIBLE,
        )
    focal = float(max(solved.deviations[0] / fx, solved.deviations[1] / fy))
    centre = float(max(solved.deviations[2:4]))
    covered = coverage_of([view.pixels for view in views], size)
    errors = [
        ViewError(view.index, len(left), _root_mean_square(left), float(np.linalg.norm(left, axis=1).max()))
        for view, left in zip(views, solved.errors, strict=True)
    ]
    errors += [
        ViewError(index, 0, 0.0, 0.0, used=False, problem=problem.text, **problem.translation())
        for index, problem in problems.items()
    ]
    errors.sort(key=lambda each: each.view)
    grade, verdict = _verdict(len(views), pictures, residual, focal * fx, focal, centre, covered)
    return Intrinsics(
        parameters=CameraParameters(fx, fy, cx, cy, [float(k) for k in solved.coefficients]),
        width=width,
        height=height,
        residual=residual,
        deviations=[float(value) for value in solved.deviations],
        focal_deviation=focal,
        centre_deviation=centre,
        coverage=covered,
        views=errors,
        grade=grade,
        verdict=verdict.text,
        picture=error_picture(
            size,
            [(f"picture {v.index}", v.pixels, e, True) for v, e in zip(views, solved.errors, strict=True)],
            f"{len(views)} pictures, rms {residual:.2f} px, corners in {covered:.0%} of the picture",
        ),
        **verdict.translation(),
    )


def _verdict(
    used: int, pictures: int, residual: float, focal_px: float, focal: float, centre: float, covered: float
) -> tuple[Grade, Message]:
    """Return the quality of intrinsics, and advice to improve them."""
    parts = [
        Message.of(
            "The focal length is known to {focal:.1f} px and the principal point to {centre:.1f} px (standard "
            "deviations, {used} of {pictures} pictures, residual {residual:.2f} px, corners in {covered:.0%} of it).",
            focal=focal_px,
            centre=centre,
            used=used,
            pictures=pictures,
            residual=residual,
            covered=covered,
        )
    ]
    grade = Grade.GOOD
    if focal > _GOOD:
        parts.append(Message.of("More pictures of a tilted board improve the result."))
        grade = Grade.USABLE
    if covered < 0.7:
        text = "Parts of the picture's edge were never covered; the lens is extrapolated there."
        parts.append(Message.of(text))
        grade = Grade.USABLE
    if used < pictures:
        parts.append(Message.of("Pictures that were not used: {unused}.", unused=pictures - used))
    return grade, Message.joined(parts)
