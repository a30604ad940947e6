"""Frames and tools from touched points with known ground truth and noise, and refusals."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from arcor2_hw.calibration import touch
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.results import Grade
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import InvalidData

lengths = st.floats(-2, 2)
orientations = (
    st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(v * v for v in q) > 1e-2).map(lambda q: Orientation(*q))
)
poses = st.builds(Pose, st.builds(Position, lengths, lengths, lengths), orientations)
POSE = Pose(Position(0.4, -0.2, 0.1), Orientation.from_rotation_vector(0.3, -0.2, 1.1))
CORNERS = [Position(0, 0, 0), Position(0.3, 0, 0), Position(0.3, 0.2, 0), Position(0, 0.2, 0), Position(0.1, 0.1, 0.15)]


def place(frame: Pose, point: Position) -> Position:
    return frame.position + point.rotated(frame.orientation)


def off(found: Pose, true: Pose) -> tuple[float, float]:
    return found.position.distance_to(true.position), found.orientation.angle_to(true.orientation)


def shaken(points: list[Position], sigma: float, seed: int) -> list[Position]:
    noise = np.random.default_rng(seed).normal(0.0, sigma, (len(points), 3))
    return [point + Position(*map(float, by)) for point, by in zip(points, noise, strict=True)]


# ------------------------------------------------------------------------------------------------ frames
@given(poses, st.floats(0.05, 1.0), st.floats(-0.5, 0.5), st.floats(0.2, 1.0))
def test_three_points_give_a_frame_marked_as_unchecked(frame: Pose, along: float, x: float, y: float) -> None:
    on_x, aside = place(frame, Position(along, 0, 0)), place(frame, Position(x, y, 0))
    found = touch.frame_by_axes(frame.position, on_x, [aside])
    assert off(found.pose, frame) == pytest.approx((0, 0), abs=1e-6)
    assert (found.checked, found.grade) == (False, Grade.USABLE)
    assert "cannot be checked" in found.verdict


def test_more_points_of_the_plane_reduce_and_measure_the_error() -> None:
    grid = [Position(0, 0, 0), Position(0.4, 0, 0), *(Position(0.1 * i, 0.1 * j, 0) for i in range(5) for j in (1, 2))]
    tilts = []
    for seed in range(40):
        origin, on_x, *rest = shaken([place(POSE, point) for point in grid], 0.0005, seed)
        found = touch.frame_by_axes(origin, on_x, rest)
        z, true = Position(0, 0, 1).rotated(found.pose.orientation), Position(0, 0, 1).rotated(POSE.orientation)
        tilts.append(math.asin(min(1.0, z.distance_to(true))) / found.angle_deviation)
        assert found.checked
        assert found.grade is Grade.GOOD
        assert found.residual < 0.001
    assert 0.3 < np.median(tilts) < 2.0  # the stated deviation matches the actual one


@pytest.mark.parametrize("by", ["axes", "points"])
def test_four_points_near_each_other_are_not_good(by: str) -> None:
    """Four points within 30 mm agree to half a millimetre, but the frame is rotated by a degree."""
    near = [Position(0, 0, 0), Position(0.03, 0, 0), Position(0.03, 0.03, 0), Position(0, 0.03, 0)]
    turned = 0
    for seed in range(20):
        points = shaken([place(POSE, point) for point in near], 0.0005, seed)
        if by == "axes":
            found = touch.frame_by_axes(points[0], points[1], points[2:])
        else:
            found = touch.frame_by_points(near, points)
        turned += off(found.pose, POSE)[1] > math.radians(1.0)
        assert found.grade is Grade.USABLE
        assert found.angle_deviation > math.radians(0.25)
        assert "farther apart" in found.verdict
    assert turned > 5


def test_a_wrongly_touched_point_is_named() -> None:
    points = [place(POSE, point) for point in CORNERS]
    points[3] += Position(0.0, 0.0, 0.006)
    found = touch.frame_by_points(CORNERS, points)
    assert found.worst == 3
    assert found.grade is Grade.USABLE
    assert "point 4" in found.verdict


@given(poses, st.integers(0, 1000))
def test_known_points_give_their_frame(frame: Pose, seed: int) -> None:
    known = shaken(CORNERS, 0.03, seed)
    found = touch.frame_by_points(known, [place(frame, point) for point in known])
    assert off(found.pose, frame) == pytest.approx((0, 0), abs=1e-6)
    assert found.residual < 1e-9


def test_stated_deviation_of_known_points_matches_the_errors() -> None:
    ratios = []
    for seed in range(60):
        found = touch.frame_by_points(CORNERS, shaken([place(POSE, point) for point in CORNERS], 0.0005, seed))
        ratios.append(found.pose.orientation.angle_to(POSE.orientation) / found.angle_deviation)
    assert 0.5 < np.median(ratios) < 2.5


@pytest.mark.parametrize(
    "points",
    [
        [Position(0, 0, 0), Position(0.2, 0, 0), Position(0.4, 0, 0)],
        [Position(0, 0, 0), Position(0.2, 0, 0), Position(0.4, 0.01, 0)],
        [Position(0, 0, 0), Position(0.005, 0, 0), Position(0, 0.2, 0)],
        [Position(0, 0, 0), Position(0.2, 0, 0), Position(0, 0.005, 0)],
        [Position(0.1, 0, 0)] * 3,
    ],
    ids=["line", "nearly", "x too near", "plane too near", "same"],
)
def test_degenerate_points_are_refused(points: list[Position]) -> None:
    with pytest.raises(CalibrationRefused) as refused:
        touch.frame_by_axes(points[0], points[1], points[2:])
    assert refused.value.reason is Reason.DEGENERATE


def test_collinear_or_reordered_known_points_are_refused() -> None:
    line = [Position(0.1 * i, 0, 0) for i in range(5)]
    with pytest.raises(CalibrationRefused, match="one line"):
        touch.frame_by_points(line, [place(POSE, point) for point in line])
    with pytest.raises(CalibrationRefused, match="order") as refused:
        touch.frame_by_points(CORNERS, [place(POSE, point) for point in CORNERS[::-1]])
    assert refused.value.reason is Reason.NOT_CONVERGED


def test_a_mirrored_set_of_points_is_refused() -> None:
    """Without its sign correction, Kabsch's method would return a reflection with the residual zero."""
    with pytest.raises(CalibrationRefused):
        touch.frame_by_points(CORNERS, [Position(p.x, p.y, -3 * p.z) for p in CORNERS])


def test_invalid_input_is_named() -> None:
    with pytest.raises(InvalidData, match="3 points are known and 2"):
        touch.frame_by_points(CORNERS[:3], CORNERS[:2])
    with pytest.raises(InvalidData, match="Point 2 of the touched"):
        touch.frame_by_axes(CORNERS[0], Position(math.nan, 0, 0), CORNERS[2:3])
    with pytest.raises(InvalidData, match="not 2"):
        touch.frame_by_axes(CORNERS[0], CORNERS[1], [])
    with pytest.raises(InvalidData, match="not 3"):
        touch.tip_by_touches([POSE] * 3)
    with pytest.raises(InvalidData, match="not 0"):
        touch.orientation_by_alignment([], Orientation())


# ------------------------------------------------------------------------------------------------ tools
TIP, POINT = Position(0.01, -0.02, 0.17), Position(0.5, 0.1, 0.05)
DOWN = Orientation(1.0, 0.0, 0.0, 0.0)


def touching(turns: list[Orientation], tip: Position = TIP) -> list[Pose]:
    return [Pose(POINT - tip.rotated(turn), turn) for turn in turns]


def tilted(*angles: tuple[float, float, float]) -> list[Orientation]:
    return [DOWN * Orientation.from_rotation_vector(*map(math.radians, each)) for each in angles]


FOUR = tilted((0, 0, 0), (30, 0, 0), (-10, 30, 0), (0, -25, 60))


@given(st.builds(Position, *[st.floats(-0.3, 0.3)] * 3))
def test_four_touches_give_the_tool_tip(tip: Position) -> None:
    found = touch.tip_by_touches(touching(FOUR, tip))
    assert found.position.distance_to(tip) < 1e-9
    assert found.point.distance_to(POINT) < 1e-9
    assert found.grade is Grade.GOOD


def test_stated_deviation_of_touches_matches_the_errors() -> None:
    turns = [*FOUR, *tilted((-30, 10, 20), (15, 15, -40))]
    ratios = []
    for seed in range(60):
        exact = touching(turns)
        moved = shaken([pose.position for pose in exact], 0.0003, seed)
        found = touch.tip_by_touches([Pose(p, pose.orientation) for p, pose in zip(moved, exact, strict=True)])
        ratios.append(found.position.distance_to(TIP) / found.deviation)
    assert 0.4 < np.median(ratios) < 2.0


def test_orientations_that_do_not_determine_the_tip_are_refused() -> None:
    about_z = tilted((0, 0, 0), (0, 0, 40), (0, 0, 90), (0, 0, 170))
    with pytest.raises(CalibrationRefused, match="one axis only") as refused:
        touch.tip_by_touches(touching(about_z))
    assert refused.value.reason is Reason.DEGENERATE
    with pytest.raises(CalibrationRefused, match="too similar"):
        touch.tip_by_touches(touching(tilted((0, 0, 0), (3, 0, 0), (0, 3, 0), (0, 0, 3))))
    with pytest.raises(CalibrationRefused, match="too similar"):
        touch.tip_by_touches(touching([DOWN] * 6))


def test_an_outlier_touch_is_refused_and_named() -> None:
    exact = touching([*FOUR, *tilted((-30, 10, 20), (15, 15, -40), (-20, -20, 0))])
    exact[4] = Pose(exact[4].position + Position(0.06, 0.0, 0.0), exact[4].orientation)
    with pytest.raises(CalibrationRefused, match="touch 5 is worst"):
        touch.tip_by_touches(exact)


@given(orientations, orientations)
def test_alignments_do_not_depend_on_the_quaternion_sign(tool: Orientation, reference: Orientation) -> None:
    flange = reference * tool.inverted()
    turned = [flange, Orientation(-flange.x, -flange.y, -flange.z, -flange.w)]
    found = touch.orientation_by_alignment(turned, reference)
    assert found.orientation.angle_to(tool) < 1e-6
    assert found.checked
    assert found.residual < 1e-6


def test_differing_alignments_are_refused_and_a_single_one_is_unchecked() -> None:
    assert not touch.orientation_by_alignment(FOUR[:1], DOWN).checked
    with pytest.raises(CalibrationRefused, match="differ"):
        touch.orientation_by_alignment(FOUR, DOWN)


@given(orientations, orientations)
def test_moves_along_the_tool_axes_give_its_orientation(flange: Orientation, tool: Orientation) -> None:
    base_from_tool = flange * tool
    along_z = POINT + Position(0, 0, 0.1).rotated(base_from_tool)
    on_x = POINT + Position(0.1, 0, 0.02).rotated(base_from_tool)
    found = touch.orientation_by_points(flange, POINT, along_z, on_x)
    assert found.orientation.angle_to(tool) < 1e-6
    assert found.residual == pytest.approx(math.atan2(0.02, 0.1))


def test_moves_that_determine_no_axes_are_refused() -> None:
    with pytest.raises(CalibrationRefused, match="one line"):
        touch.orientation_by_points(DOWN, Position(), Position(0, 0, 0.1), Position(0.001, 0, 0.2))
    with pytest.raises(CalibrationRefused, match="less than"):
        touch.orientation_by_points(DOWN, Position(), Position(0, 0, 0.002), Position(0.1, 0, 0))


def test_points_beyond_any_robots_reach_are_refused() -> None:
    far = [Position(0, 0, 0), Position(1e200, 0, 0), Position(0, 1, 0)]
    with pytest.raises(InvalidData, match="Point 2 of the touched points is farther"):
        touch.frame_by_axes(far[0], far[1], far[2:])
    with pytest.raises(InvalidData, match="farther"):
        touch.tip_by_touches([Pose(point) for point in [*far, Position()]])
