"""The pose of a camera, from images of markers and boards of known size and pose."""

import math
from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np

from arcor2_hw.calibration.averaging import averaged, weight_of
from arcor2_hw.calibration.boards import check_pose
from arcor2_hw.calibration.camera_results import CameraPose, LensCheck, LensState, MarkerError, PoseOptions
from arcor2_hw.calibration.detection import Detection, detect_layout
from arcor2_hw.calibration.diagnosis import check_not_mirrored, wanted_markers
from arcor2_hw.calibration.drawing import GOOD, Canvas, error_picture
from arcor2_hw.calibration.layout import Layout, item_name
from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.lens_check import CheckedPose, check_of_lens
from arcor2_hw.calibration.pictures import Picture, grey_of, one_by_one
from arcor2_hw.calibration.pose_problem import DetectedTarget, Hints
from arcor2_hw.calibration.pose_search import PoseCandidate, search
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.results import Grade
from arcor2_hw.calibration.rigid import inverted
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message

MAX_PICTURES: Final = 100
_GOOD: Final = 0.002
"""Standard deviation of the position up to which a result is good, m."""
_STOOD_STILL: Final = 0.5
"""Maximum movement of a marker between images, px."""


def find_camera_pose(
    pictures: Sequence[Picture], parameters: CameraParameters, layout: Layout, options: PoseOptions | None = None
) -> CameraPose:
    """Find the pose of a camera in the frame of the origin.

    Args:
        pictures: One image, or several from the same camera at the same place, whose noise is averaged.
        parameters: Parameters of the lens for this image size.
        layout: Markers and boards that may be visible; others are ignored.
        options: Method, hints and limits.

    Raises:
        InvalidPicture: A file is not an image, damaged or too large, or the images have different sizes.
        InvalidData: Parameters or a marker are invalid.
        Conflict: A marker is listed twice.
        CalibrationRefused: The image is blurred; it shows no marker; the pose is ambiguous (one marker seen from the
            front; the message says what helps), unobservable (too uncertain) or implausible (a marker appears twice or
            not at its configured place, or the camera moved between the images).
    """
    options = options or PoseOptions()
    hints, lens, detection = _detected(pictures, parameters, layout, options)
    find = averaged if options.method == "averaged" else search
    try:
        found = find(lens, detection.seen, hints, options)
    except CalibrationRefused as error:
        if error.reason == Reason.IMPLAUSIBLE:  # in a mirrored image, some markers are mistaken for others
            check_not_mirrored(grey_of(pictures[0]), wanted_markers(layout))
        raise
    checked = check_of_lens(lens, found, hints, options)
    return _result(found, checked, layout, options, detection.blur, len(pictures))


def check_lens(
    pictures: Sequence[Picture], parameters: CameraParameters, layout: Layout, options: PoseOptions | None = None
) -> LensCheck:
    """Check the focal length of a camera by markers of known pose, even where no pose is reliable.

    Args:
        pictures: As in `find_camera_pose`.
        parameters: The parameters to check.
        layout: Markers and boards that may be visible.
        options: Standard deviations of the intrinsics, hints and limits.

    Raises:
        InvalidPicture: As in `find_camera_pose`.
        InvalidData: As in `find_camera_pose`.
        Conflict: As in `find_camera_pose`.
        CalibrationRefused: The image is blurred, shows no marker, or shows markers away from their configured poses.
    """
    options = options or PoseOptions()
    hints, lens, detection = _detected(pictures, parameters, layout, options)
    found = search(lens, detection.seen, hints, options)
    return check_of_lens(lens, found, hints, options).lens


def _detected(
    pictures: Sequence[Picture], parameters: CameraParameters, layout: Layout, options: PoseOptions
) -> tuple[Hints, Lens, Detection]:
    """Return prior knowledge, the lens, and the targets detected in images."""
    hints = _hints(options)
    if not 1 <= len(pictures) <= MAX_PICTURES:
        raise InvalidData(
            "1 to {most_pictures} images are needed, not {count}", most_pictures=MAX_PICTURES, count=len(pictures)
        )
    greys = list(one_by_one(pictures)) if len(pictures) > 1 else [grey_of(pictures[0])]
    lens = Lens(parameters, greys[0].shape[1], greys[0].shape[0])
    detection = detect_layout(greys, lens, layout, options.blur_threshold, options.largest_blur)
    _check_still(detection.seen)
    return hints, lens, detection


def _hints(options: PoseOptions) -> Hints:
    """Return prior knowledge.

    Raises:
        InvalidData: An option is invalid.
    """
    expected = gravity = None
    if isinstance(options.expected, Pose):
        check_pose(options.expected, "the expected pose of the camera")
        expected = inverted(options.expected.matrix())
    if isinstance(options.gravity, Position):
        gravity = np.array(tuple(options.gravity))
        length = float(np.linalg.norm(gravity))
        if not (math.isfinite(length) and length > 1e-6):
            raise InvalidData("the direction of gravity must be a non-zero vector", str(tuple(options.gravity)))
        gravity = gravity / length
    for name in ("expected_position", "expected_orientation", "gravity_deviation", "largest_deviation"):
        if not (math.isfinite(getattr(options, name)) and getattr(options, name) > 0):
            raise InvalidData("{name} must be a positive number, not {value}", name=name, value=getattr(options, name))
    if not options.min_distance < options.max_distance:
        raise InvalidData("min_distance must be less than max_distance")
    return Hints(expected, options.expected_position, options.expected_orientation, gravity, options.gravity_deviation)


def _check_still(seen: list[DetectedTarget]) -> None:
    """Require that markers are at the same pixels in all images.

    Raises:
        CalibrationRefused: A marker moved.
    """
    first: dict[tuple[str, int], DetectedTarget] = {}
    for each in seen:
        before = first.setdefault(each.key, each)
        if each.key[0] == "marker" and before is not each:
            moved = float(np.linalg.norm(each.pixels.mean(axis=0) - before.pixels.mean(axis=0)))
            if moved > _STOOD_STILL:
                raise CalibrationRefused(
                    "The camera or {name} moved between picture {picture} and picture {other_picture}. "
                    "Fix both, then try again.",
                    f"by {moved:.1f} px",
                    Reason.IMPLAUSIBLE,
                    name=each.name,
                    picture=before.picture,
                    other_picture=each.picture,
                )


def _result(
    found: PoseCandidate, checked: CheckedPose, layout: Layout, options: PoseOptions, blur: float, pictures: int
) -> CameraPose:
    """Return the result with its verdict, or refuse it."""
    seen, covariance = found.seen, found.covariance
    if np.trace(checked.covariance[:3, :3]) > np.trace(covariance[:3, :3]):
        covariance = checked.covariance
    position = float(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1]))
    orientation = float(np.sqrt(np.linalg.eigvalsh(covariance[3:, 3:])[-1]))
    _check_known(found, checked.lens, position, options)
    origin_from_camera = inverted(found.pose)
    errors = []
    for each, left in zip(seen, found.errors, strict=True):
        distances = np.linalg.norm(left, axis=1)
        to_camera = origin_from_camera[:3, 3] - each.middle
        distance = float(np.linalg.norm(to_camera))
        errors.append(
            MarkerError(
                each.name,
                each.picture,
                len(left),
                float(np.sqrt(np.mean(distances**2))),
                float(distances.max()),
                distance,
                float(np.arccos(np.clip(to_camera @ each.normal / distance, -1, 1))),
                each.key not in found.left_out,
            )
        )
    used = [e for e in errors if e.used]
    residual = math.sqrt(sum(e.residual**2 * e.corners for e in used) / sum(e.corners for e in used))
    places = {each.key for each in seen} - found.left_out
    grade, verdict = _verdict(places, position, orientation, residual, errors, found.parameters.fx, checked, options)
    total = len(layout.markers) + len(layout.boards)
    weights = {each.key: weight_of(found.pose, each, options) for each in seen}
    return CameraPose(
        pose=Pose.from_matrix(origin_from_camera),
        parameters=found.parameters,
        quality=float(np.clip(sum(weights[key] for key in places) / total, 0.0, 1.0)),
        residual=residual,
        markers=errors,
        covariance=[[float(value) for value in row] for row in covariance],
        position_deviation=position,
        orientation_deviation=orientation,
        blur=blur,
        method=options.method,
        pictures=pictures,
        grade=grade,
        verdict=verdict.text,
        lens=checked.lens,
        **verdict.translation(),
    )


def _check_known(found: PoseCandidate, lens: LensCheck, position: float, options: PoseOptions) -> None:
    """Require that the pose is certain enough and agrees with the hints.

    Raises:
        CalibrationRefused: The pose is uncertain or contradicts the hints.
    """
    if math.isfinite(position) and position <= options.largest_deviation:
        return
    if lens.state == LensState.CONTRADICTED:
        raise CalibrationRefused(
            "The markers contradict the lens, which moves the camera by {position:.0f} mm. {verdict}",
            f"factor {lens.factor:.4f}, standard deviation {lens.deviation:.4f}, misfit {lens.misfit:.1f}",
            Reason.WRONG_LENS,
            position=position * 1000,
            verdict=lens.as_message(lens.verdict),
        )
    only = len({each.key for each in found.used}) == 1
    first = found.seen[0]
    raise CalibrationRefused(
        "Only {name} is visible, from nearly straight ahead or far away: the camera's position would be known to "
        "{position:.0f} mm only. What helps: a second marker, a larger one, a view from the side or from nearer, "
        "the direction of gravity, or where the camera roughly is."
        if only
        else "The markers are far away: the camera's position would be known to {position:.0f} mm only. "
        "What helps: a second marker, a larger one, a view from the side or from nearer, the direction of gravity, "
        "or where the camera roughly is.",
        f"standard deviation {position * 1000:.1f} mm, at most {options.largest_deviation * 1000:.1f} mm",
        Reason.UNOBSERVABLE,
        name=item_name(first.name),
        position=position * 1000,
    )


def _verdict(
    places: set[tuple[str, int]],
    position: float,
    orientation: float,
    residual: float,
    errors: list[MarkerError],
    f: float,
    checked: CheckedPose,
    options: PoseOptions,
) -> tuple[Grade, Message]:
    """Return the grade of a pose, and instructions for checks by a technician."""
    markers = sum(kind == "marker" for kind, _ in places)
    boards = len(places) - markers
    seen = Message.of("markers: {markers}, boards: {boards}", markers=markers, boards=boards)
    parts = [
        Message.of(
            "The camera's position is known to {position:.1f} mm and its direction to {direction:.2f}° "
            "(standard deviations; {seen}, residual {residual:.2f} px), if the focal length is right to {focal:.2%}.",
            position=position * 1000,
            direction=math.degrees(orientation),
            seen=seen,
            residual=residual,
            focal=options.focal_deviation,
        ),
        checked.lens.as_message(checked.lens.verdict),
    ]
    confirmed = checked.lens.state == LensState.CONFIRMED
    grade = Grade.GOOD if position <= _GOOD and confirmed and not checked.misfit else Grade.USABLE
    for name in sorted({e.name for e in errors if not e.used}):
        worst = max((e for e in errors if e.name == name), key=lambda e: e.residual)
        parts.append(
            Message.of(
                "Not used, because it is about {distance:.0f} mm from its configured pose: {name}.",
                name=item_name(name),
                distance=worst.residual * worst.distance / f * 1000,
            )
        )
        grade = Grade.USABLE
    if len(places) == 1 and markers == 1:
        parts.append(Message.of("With only one marker, its pose cannot be checked."))
        grade = Grade.USABLE
    elif residual > 0.5:
        off = max(e.residual * e.distance / f for e in errors if e.used)
        parts.append(
            Message.of(
                "The poses of the markers differ from each other by about {distance:.1f} mm.", distance=off * 1000
            )
        )
        grade = Grade.USABLE
    elif checked.misfit and checked.lens.state != LensState.CONTRADICTED:
        parts.append(
            Message.of(
                "The residual is {factor:.0f} times what the sharpness of the edges allows: "
                "check the poses and sizes of the markers, and the lens.",
                factor=checked.lens.misfit,
            )
        )
    return grade, Message.joined(parts)


def draw_camera_pose(picture: Picture, parameters: CameraParameters, layout: Layout, result: CameraPose) -> bytes:
    """Draw the expected markers for a pose onto an image, with their errors and the verdict.

    Args:
        picture: The image.
        parameters: As given to `find_camera_pose`; those of the result are used for drawing.
        layout: Markers and boards.
        result: The result of `find_camera_pose`.

    Returns:
        A PNG file.

    Raises:
        InvalidPicture: As in `find_camera_pose`.
        InvalidData: As in `find_camera_pose`.
        CalibrationRefused: As in `find_camera_pose`.
    """
    grey = grey_of(picture)
    lens = Lens(parameters, grey.shape[1], grey.shape[0])
    seen = detect_layout([grey], lens, layout, 0.0, math.inf).seen
    if isinstance(result.parameters, CameraParameters):
        lens = Lens(result.parameters, grey.shape[1], grey.shape[0])
    camera_from_origin = inverted(result.pose.matrix())
    canvas: Canvas = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR).astype(np.uint8)
    unused = {error.name for error in result.markers if not error.used}
    for outline in _outlines(layout):
        camera = outline @ camera_from_origin[:3, :3].T + camera_from_origin[:3, 3]
        if camera[:, 2].min() > 0:
            pixels = lens.pixels(camera[:, :2] / camera[:, 2:])
            if np.abs(pixels).max() < 10 * lens.width:
                cv2.polylines(canvas, [np.rint(pixels * 16).astype(np.int32)], True, GOOD, 2, cv2.LINE_AA, 4)
    views = []
    for each in seen:
        camera = each.points @ camera_from_origin[:3, :3].T + camera_from_origin[:3, 3]
        expected = lens.pixels(camera[:, :2] / camera[:, 2:])
        views.append((each.name, each.pixels, expected - each.pixels, each.name not in unused))
    return error_picture((lens.width, lens.height), views, result.verdict.split(" (")[0] + ".", canvas)


def _outlines(layout: Layout) -> list[Array]:
    """Return the corners of everything listed, (4, 3) each, in the frame of the origin, m."""
    result = []
    for marker in layout.markers:
        half = (marker.size if isinstance(marker.size, float | int) else layout.size) / 2
        result.append((marker.pose.matrix(), half, half))
    result += [(b.pose.matrix(), b.columns * b.square / 2, b.rows * b.square / 2) for b in layout.boards]
    corners = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
    return [
        np.column_stack((corners * (width, height), np.zeros(4))) @ matrix[:3, :3].T + matrix[:3, 3]
        for matrix, width, height in result
    ]
