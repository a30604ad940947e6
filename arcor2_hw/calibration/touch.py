"""Frames and tools from touched points: base and user frames, the tip of a tool (TCP) and its orientation."""

import math
from collections.abc import Sequence
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.results import Grade, TouchedFrame, TouchedOrientation, TouchedTip
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message

Floats = npt.NDArray[np.float64]

MIN_POINT_DISTANCE: Final = 0.01
"""Minimum distance between points, m; below it, half a millimetre of error rotates the frame by 3°."""
MIN_SINE: Final = math.sin(math.radians(10.0))
"""Minimum sine of the angle that three points must form."""
GOOD_RESIDUAL: Final = 0.001
"""Root mean square residual up to which touched points agree well, m."""
MAX_MISFIT: Final = 0.05
"""Maximum ratio of residual to spread of the points; above it they are different points."""
ORIENTATION_SPREAD: Final = 0.12
"""Minimum singular value, per square root of the count, of the equations of the tip: some 15° about every axis."""
TIP_FITS: Final = 0.0005
TIP_MISFIT: Final = 0.01
"""Root mean square residual above which the touches of the tip do not agree, m."""
ANGLE_GOOD: Final = math.radians(0.25)
"""Standard deviation of a frame's orientation up to which it is good, rad: less than 1° in 4 standard deviations."""
TOUCH_DEVIATION: Final = 0.0005
"""Expected standard deviation of a touched coordinate, m."""
TOUCH_FREEDOM: Final = 4
"""Degrees of freedom that the expected deviation counts for against the residuals of the touched points."""
TURN_FITS: Final = math.radians(0.5)
TURN_MISFIT: Final = math.radians(5.0)
_MOST: Final = 1000
_FARTHEST: Final = 1e4
"""Maximum coordinate, m; larger ones are invalid."""


def frame_by_axes(origin: Position, on_x: Position, in_plane: Sequence[Position]) -> TouchedFrame:
    """Find a frame from its origin, a point on its +x axis, and points in its xy plane on the side of +y.

    The plane is the best fit of all points; the origin is the projection of the first point onto it. One point in the
    plane determines the frame exactly, without any check.

    Args:
        origin: Origin of the frame, touched, m.
        on_x: A point on the +x axis, m.
        in_plane: At least one point, m; the first one is on the +y side of x.

    Raises:
        InvalidData: The list of points in the plane is empty, or a coordinate is not finite.
        CalibrationRefused: The points are on one line, too near each other, or not in one plane.
    """
    points = _points("touched", [origin, on_x, *in_plane], 3)
    along = points[1] - points[0]
    if np.linalg.norm(along) < MIN_POINT_DISTANCE:
        raise _too_near("x")
    aside = points[2] - points[0]
    upward = np.cross(along, aside)
    if np.linalg.norm(aside) < MIN_POINT_DISTANCE:
        raise _too_near("plane")
    if np.linalg.norm(upward) < MIN_SINE * np.linalg.norm(along) * np.linalg.norm(aside):
        raise _on_one_line()
    checked = len(points) > 3
    middle = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - middle, full_matrices=False)
    if checked:
        normal = axes[2] * math.copysign(1.0, float(axes[2] @ upward))
    else:
        normal, middle = upward / np.linalg.norm(upward), points[0]
    heights = (points - middle) @ normal
    x = along - (along @ normal) * normal
    x /= np.linalg.norm(x)
    base_from_frame = np.eye(4)
    base_from_frame[:3, :3] = np.column_stack([x, np.cross(normal, x), normal])
    base_from_frame[:3, 3] = points[0] - heights[0] * normal
    residuals = np.abs(heights) if checked else np.zeros(len(points))
    _refuse_misfit(residuals, points, Message.of("The points are not in one plane"))
    # Tilt follows from all points of the plane, heading only from the two points of the x axis.
    touch = _touch_deviation(residuals, len(points) - 3)
    deviation = touch * max(1.0 / float(spread[1]), math.sqrt(2.0) / float(np.linalg.norm(along)))
    return _frame(
        base_from_frame, residuals, checked, deviation, Message.of("Touch a further point of the plane to check it.")
    )


def frame_by_points(known: Sequence[Position], touched: Sequence[Position]) -> TouchedFrame:
    """Find a frame from at least three points known in it, and the same points as touched: best fit (Kabsch).

    Source: W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta Crystallographica A 32
    (1976), with the sign that keeps the rotation proper.

    Args:
        known: Points in the frame to be found, m.
        touched: The same points as touched, in the same order, m.

    Raises:
        InvalidData: There are fewer than three points, counts differ, or a coordinate is not finite.
        CalibrationRefused: The points are on one line or too near each other, or the two sets have different shapes.
    """
    if len(known) != len(touched):
        raise InvalidData(
            "{count} points are known and {other_count} were touched. Give the same number of both.",
            count=len(known),
            other_count=len(touched),
        )
    ours, theirs = _points("known", known, 3), _points("touched", touched, 3)
    for points in (ours, theirs):
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if spread[0] < MIN_POINT_DISTANCE:
            raise _too_near()
        if spread[1] < MIN_SINE * spread[0]:
            raise _on_one_line()
    a, b = ours - ours.mean(axis=0), theirs - theirs.mean(axis=0)
    u, _, vt = np.linalg.svd(b.T @ a)
    rotation = u @ np.diag([1.0, 1.0, math.copysign(1.0, float(np.linalg.det(u @ vt)))]) @ vt
    errors = b - a @ rotation.T
    residuals = np.linalg.norm(errors, axis=1)
    _refuse_misfit(residuals, ours, Message.of("The touched points have another shape than the known points"))
    base_from_frame = np.eye(4)
    base_from_frame[:3, :3] = rotation
    base_from_frame[:3, 3] = theirs.mean(axis=0) - rotation @ ours.mean(axis=0)
    information = np.eye(3) * np.sum(a * a) - a.T @ a
    touch = _touch_deviation(residuals, 3 * len(ours) - 6)
    deviation = touch / math.sqrt(float(np.linalg.eigvalsh(information)[0]))
    return _frame(base_from_frame, residuals, True, deviation)


def tip_by_touches(flange: Sequence[Pose]) -> TouchedTip:
    """Find the tip of a tool from at least four poses of the flange (base_from_flange) with the tip on one point.

    Raises:
        InvalidData: There are fewer than four poses, or a number is not finite.
        CalibrationRefused: The orientations are too similar or about one axis only, or the touches do not agree.
    """
    origins = _points("flange", [pose.position for pose in flange], 4)
    count = len(origins)
    # rotation · tip + origin = point, for every pose
    equations = np.concatenate([np.hstack([pose.orientation.matrix(), -np.eye(3)]) for pose in flange])
    u, singular, vt = np.linalg.svd(equations, full_matrices=False)
    least = singular / math.sqrt(count)
    if least[4] < ORIENTATION_SPREAD:
        raise CalibrationRefused(
            "The orientations of the tool are too similar. Turn it by 30° or more between touches.",
            f"singular values {np.round(least, 3).tolist()}",
            Reason.DEGENERATE,
        )
    if least[5] < ORIENTATION_SPREAD:
        raise CalibrationRefused(
            "The tool was turned about one axis only, so the position of the tip along this axis is undetermined. "
            "Tilt it in another direction, too.",
            f"singular values {np.round(least, 3).tolist()}",
            Reason.DEGENERATE,
        )
    solution = vt.T @ ((u.T @ -origins.reshape(-1)) / singular)
    errors = (equations @ solution + origins.reshape(-1)).reshape(-1, 3)
    residuals = np.linalg.norm(errors, axis=1)
    residual, worst = _rms(residuals), int(np.argmax(residuals))
    if residual > TIP_MISFIT:
        raise CalibrationRefused(
            "The touches do not agree on one point: they are off by {residual:.1f} mm on average; touch {worst} is "
            "worst. Check that the tip was on the same point every time.",
            f"residuals {np.round(residuals * 1e3, 2).tolist()} mm",
            Reason.NOT_CONVERGED,
            residual=residual * 1000.0,
            worst=worst + 1,
        )
    variance = float(residuals @ residuals) / (3 * count - 6)
    covariance = variance * (vt.T / singular**2 @ vt)[:3, :3]
    deviation = float(np.sqrt(max(0.0, np.linalg.eigvalsh(covariance)[-1])))
    good = residual <= TIP_FITS and deviation <= TIP_FITS
    verdict = Message.of(
        "The tip is known to {deviation:.2f} mm; the {count} touches agree to {residual:.2f} mm."
        if good
        else "The tip is known to {deviation:.2f} mm only: the {count} touches agree to {residual:.2f} mm, "
        "touch {worst} is worst. More touches, or orientations that differ more, improve the result.",
        deviation=deviation * 1e3,
        count=count,
        residual=residual * 1e3,
        worst=worst + 1,
    )
    return TouchedTip(
        position=_position(solution[:3]),
        point=_position(solution[3:]),
        grade=Grade.GOOD if good else Grade.USABLE,
        verdict=verdict.text,
        residuals=residuals.tolist(),
        residual=residual,
        worst=worst,
        deviation=deviation,
        **verdict.translation(),
    )


def orientation_by_alignment(flange: Sequence[Orientation], reference: Orientation) -> TouchedOrientation:
    """Find the orientation of a tool from flange orientations with the tool aligned with a reference frame.

    Args:
        flange: base_from_flange, at least one.
        reference: base_from_reference, the frame that the tool was aligned with.

    Raises:
        InvalidData: The list of orientations is empty.
        CalibrationRefused: The orientations differ by more than measurement errors.
    """
    if not 1 <= len(flange) <= _MOST:
        raise InvalidData(
            "A tool's orientation needs 1 to {most} orientations of the flange, not {count}.",
            most=_MOST,
            count=len(flange),
        )
    tools = [each.inverted() * reference for each in flange]
    quaternions = np.array([tuple(tool) for tool in tools])
    mean = Orientation(*map(float, np.linalg.eigh(quaternions.T @ quaternions)[1][:, -1]))  # Markley's mean
    residuals = np.array([tool.angle_to(mean) for tool in tools])
    residual, worst = _rms(residuals), int(np.argmax(residuals))
    if residuals[worst] > TURN_MISFIT:
        raise CalibrationRefused(
            "The alignments differ by {residual:.1f}°; number {worst} is worst. Check that the tool was aligned "
            "with the same axes every time.",
            f"residuals {np.round(np.degrees(residuals), 2).tolist()} °",
            Reason.NOT_CONVERGED,
            residual=math.degrees(residuals[worst]),
            worst=worst + 1,
        )
    checked = len(tools) > 1
    good = checked and residual <= TURN_FITS
    if checked:
        verdict = Message.of(
            "The {count} alignments agree to {residual:.2f}°.", count=len(tools), residual=math.degrees(residual)
        )
    else:
        verdict = Message.of(
            "The orientation follows from one alignment and cannot be checked. Align the tool once more."
        )
    return TouchedOrientation(
        mean,
        Grade.GOOD if good else Grade.USABLE,
        verdict.text,
        residuals.tolist(),
        residual,
        worst,
        checked,
        **verdict.translation(),
    )


def orientation_by_points(flange: Orientation, tip: Position, along_z: Position, on_x: Position) -> TouchedOrientation:
    """Find the orientation of a tool by moving its tip along the tool's +z and to its +x side without rotation.

    Args:
        flange: base_from_flange, the same for all three.
        tip: Position of the tip, or of the flange, at the start, in the base, m.
        along_z: Position after a move along the tool's +z (working) direction, m.
        on_x: Position after a move from `tip` to the tool's +x side, m. The deviation from a right angle is the
            residual.

    Raises:
        InvalidData: A number is not finite.
        CalibrationRefused: The moves are too short, or along one line.
    """
    start, forward, side = _points("tip", [tip, along_z, on_x], 3)
    z, x = forward - start, side - start
    if min(np.linalg.norm(z), np.linalg.norm(x)) < MIN_POINT_DISTANCE:
        raise _too_near()
    z, x = z / np.linalg.norm(z), x / np.linalg.norm(x)
    off = abs(math.asin(float(np.clip(x @ z, -1.0, 1.0))))
    if math.cos(off) < MIN_SINE:
        raise _on_one_line()
    x -= (x @ z) * z
    x /= np.linalg.norm(x)
    base_from_tool = Orientation.from_matrix(np.column_stack([x, np.cross(z, x), z]))
    verdict = Message.of(
        "The tool's z is the direction of the move. Its x was {off:.1f}° off a right angle and was corrected. "
        "Nothing else checks them.",
        off=math.degrees(off),
    )
    found = flange.inverted() * base_from_tool
    return TouchedOrientation(found, Grade.USABLE, verdict.text, [off], off, 0, False, **verdict.translation())


# ---------------------------------------------------------------------------------------------------- common
def _points(name: str, points: Sequence[Position], least: int) -> Floats:
    if not least <= len(points) <= _MOST:
        raise InvalidData(
            "{least} to {most} {name} points are needed, not {count}.",
            least=least,
            most=_MOST,
            name=name,
            count=len(points),
        )
    found = np.array([tuple(point) for point in points], dtype=np.float64)
    if not np.isfinite(found).all():
        wrong = int(np.argmin(np.isfinite(found).all(axis=1)))
        raise InvalidData("Point {wrong} of the {name} points is not finite.", wrong=wrong + 1, name=name)
    if np.abs(found).max(initial=0.0) > _FARTHEST:
        wrong = int(np.argmax(np.abs(found).max(axis=1)))
        raise InvalidData(
            "Point {wrong} of the {name} points is farther away than {farthest:g} m.",
            wrong=wrong + 1,
            name=name,
            farthest=_FARTHEST,
        )
    return found


def _too_near(kind: Literal["points", "x", "plane"] = "points") -> CalibrationRefused:
    text = (
        "The points are less than {shortest:.0f} mm apart. Take points farther apart."
        if kind == "points"
        else "The point on the x axis and the origin are less than {shortest:.0f} mm apart. Take points farther apart."
        if kind == "x"
        else "The point in the plane and the origin are less than {shortest:.0f} mm apart. Take points farther apart."
    )
    return CalibrationRefused(text, reason=Reason.DEGENERATE, shortest=MIN_POINT_DISTANCE * 1000.0)


def _on_one_line() -> CalibrationRefused:
    return CalibrationRefused(
        "The points are on one line, so the rotation about it is undetermined. Touch a point farther from the line.",
        reason=Reason.DEGENERATE,
    )


def _refuse_misfit(residuals: Floats, points: Floats, message: Message) -> None:
    spread = float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())
    if _rms(residuals) > MAX_MISFIT * spread:
        raise CalibrationRefused(
            "{what}: off by {residual:.1f} mm on average; point {worst} is worst. Check that every point was "
            "touched, in this order.",
            f"residuals {np.round(residuals * 1e3, 2).tolist()} mm",
            Reason.NOT_CONVERGED,
            what=message,
            residual=_rms(residuals) * 1000.0,
            worst=int(np.argmax(residuals)) + 1,
        )


def _touch_deviation(residuals: Floats, freedom: int) -> float:
    """Return the standard deviation of a touched coordinate, m, from residuals and the expected deviation.

    Few points can agree by chance, so the residuals are pooled with the expected deviation.

    Source: A. Gelman et al., "Bayesian data analysis", 3rd ed. (2013), section 2.6: normal distribution with known mean
    and unknown variance, scaled inverse chi-square prior.
    """
    squares = float(residuals @ residuals) + TOUCH_FREEDOM * TOUCH_DEVIATION**2
    return math.sqrt(squares / (freedom + TOUCH_FREEDOM))


def _frame(matrix: Floats, residuals: Floats, checked: bool, deviation: float, *advice: Message) -> TouchedFrame:
    residual, worst = _rms(residuals), int(np.argmax(residuals))
    good = checked and residual <= GOOD_RESIDUAL and deviation <= ANGLE_GOOD
    known = Message.of(
        "The frame's orientation is known to {deviation:.2f}° (standard deviation).", deviation=math.degrees(deviation)
    )
    if not checked:
        parts = [Message.of("The three points determine the frame, but cannot be checked."), *advice]
    elif residual > GOOD_RESIDUAL:
        agree = Message.of(
            "The {count} points agree to {residual:.1f} mm only; point {worst} is {off:.1f} mm off: touch it again.",
            count=len(residuals),
            residual=residual * 1e3,
            worst=worst + 1,
            off=residuals[worst] * 1e3,
        )
        parts = [agree, known]
    else:
        agree = Message.of(
            "The {count} points agree to {residual:.2f} mm.", count=len(residuals), residual=residual * 1e3
        )
        parts = [agree, known]
    if deviation > ANGLE_GOOD:
        parts.append(Message.of("Touch points that are farther apart."))
    verdict = Message.joined(parts)
    return TouchedFrame(
        pose=Pose.from_matrix(matrix),
        grade=Grade.GOOD if good else Grade.USABLE,
        verdict=verdict.text,
        residuals=residuals.tolist(),
        residual=residual,
        worst=worst,
        checked=checked,
        angle_deviation=deviation,
        **verdict.translation(),
    )


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values * values)))


def _position(values: Floats) -> Position:
    return Position(*map(float, values))
