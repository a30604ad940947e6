"""Camera poses from rendered pictures with known ground truth, and refusals."""

import functools
import math
from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from arcor2_hw.calibration import lens as measuring
from arcor2_hw.calibration.camera_pose import check_lens, draw_camera_pose, find_camera_pose
from arcor2_hw.calibration.camera_results import CameraPose, LensCheck, LensState, PoseMethod, PoseOptions
from arcor2_hw.calibration.edges import chart_of, measure
from arcor2_hw.calibration.layout import CharucoBoard, Layout, Marker
from arcor2_hw.calibration.markers import detect, find_marker_corners
from arcor2_hw.calibration.pictures import InvalidPicture
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.results import Grade
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import Arcor2Error, Conflict, InvalidData
from benchmarks import rendering
from benchmarks.rendering import Array, Exposure, Lens

Grey = npt.NDArray[np.uint8]

LENS = Lens(600.0, 599.0, 322.0, 237.0, (0.06, -0.1, 0.0005, -0.0004, 0.02), 640, 480)
GIVEN = CameraParameters(600.0, 599.0, 322.0, 237.0, list(LENS.coefficients))
SIZE = 0.1
ORIGIN = np.zeros(3)
USUAL = Exposure()


def flat(x: float, y: float, turn: float = 0.0) -> Array:
    pose = np.eye(4)
    pose[:2, :2] = [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
    pose[:2, 3] = x, y
    return pose


# One of the boards leans against a wall, facing -y.
WALL = np.array([[1.0, 0, 0, 0.0], [0, 0, -1.0, 0.2], [0, 1.0, 0, 0.08], [0, 0, 0, 1.0]])
PLACES = {3: flat(-0.12, -0.02, 0.4), 17: flat(0.12, -0.05, -1.0), 42: flat(0.0, 0.08, 2.5), 9: WALL}
ASLANT = rendering.looking_at(np.array([0.25, -0.6, 0.5]), ORIGIN, 0.2)
AHEAD = rendering.looking_at(np.array([0.0, 0.004, 1.3]), ORIGIN, 0.0)


@functools.cache
def background() -> rendering.Plate:
    return rendering.table(np.random.default_rng(1), side=3.0)


def picture(camera: Array, places: dict[int, Array], exposure: Exposure = USUAL, seed: int = 2) -> Grey:
    plates = [rendering.marker(number, SIZE, place) for number, place in places.items()]
    return rendering.render(LENS, camera, [background(), *plates], np.random.default_rng(seed), exposure)


def layout(places: dict[int, Array]) -> Layout:
    return Layout([Marker(number, Pose.from_matrix(place)) for number, place in places.items()], size=SIZE)


def file(grey: Grey, kind: str = ".png") -> bytes:
    return bytes(cv2.imencode(kind, grey)[1].tobytes())


def off(found: CameraPose, camera: Array) -> tuple[float, float]:
    """Millimetres and degrees."""
    error = found.pose.inverted() * Pose.from_matrix(camera)
    return math.hypot(*error.position) * 1e3, math.degrees(error.orientation.angle_to(Orientation()))


@functools.cache
def all_seen() -> Grey:
    return picture(ASLANT, PLACES)


@functools.cache
def one_ahead() -> Grey:
    return picture(AHEAD, {3: flat(0, 0)})


# ------------------------------------------------------------------------------------------------ poses
@pytest.mark.parametrize(("method", "millimetres"), [("joint", 0.8), ("averaged", 3.0)])
def test_camera_pose_matches_ground_truth(method: PoseMethod, millimetres: float) -> None:
    found = find_camera_pose([all_seen()], GIVEN, layout(PLACES), PoseOptions(method=method))
    distance, angle = off(found, ASLANT)
    assert distance < millimetres
    assert angle < 0.15
    assert len(found.markers) == 4
    assert found.method == method
    assert 0.3 < found.quality < 1.0
    assert found.blur == pytest.approx(0.85, abs=0.2)
    assert "markers: 4" in found.verdict


def test_errors_match_the_stated_deviation() -> None:
    """Over several views, errors divided by the stated deviation have a standard deviation of about one."""
    squares = []
    for seed in range(8):
        random = np.random.default_rng(100 + seed)
        eye = np.array([random.uniform(-0.3, 0.3), -random.uniform(0.3, 0.6), random.uniform(0.4, 0.7)])
        camera = rendering.looking_at(eye, ORIGIN, random.uniform(-0.3, 0.3))
        grey = picture(camera, {3: PLACES[3], 42: PLACES[42]}, Exposure(noise=3.0), seed)
        shown = CameraParameters(
            LENS.fx * (1 + 0.0005 * random.normal()),
            LENS.fy * (1 + 0.0005 * random.normal()),
            LENS.cx + 0.5 * random.normal(),
            LENS.cy + 0.5 * random.normal(),
            [k * (1 + 0.02 * random.normal()) for k in LENS.coefficients],
        )
        found = find_camera_pose([grey], shown, layout({3: PLACES[3], 42: PLACES[42]}))
        error = np.array(tuple(found.pose.position)) - camera[:3, 3]
        covariance = np.array(found.covariance)
        turned = found.pose.orientation * Pose.from_matrix(camera).orientation.inverted()
        vector = np.array([*error, *turned.rotation_vector()])
        squares.append(vector @ np.linalg.solve(covariance, vector) / 6)
    assert 0.3 < np.mean(squares) < 2.5


def test_inverse_gives_the_origin_in_camera_coordinates() -> None:
    found = find_camera_pose([all_seen()], GIVEN, layout(PLACES))
    there, back = found.estimated(), found.estimated(inverse=True)
    assert there.quality == back.quality == found.quality
    assert (there.pose * back.pose).position.distance_to(Position()) < 1e-12
    # The origin is in front of the camera, in the middle of the picture.
    assert back.pose.position.z == pytest.approx(math.hypot(0.25, 0.6, 0.5), abs=0.002)


@pytest.mark.parametrize("kind", [".png", ".jpg", ".bmp", ".tiff", ".webp"])
def test_all_image_formats_are_read(kind: str) -> None:
    found = find_camera_pose([file(all_seen(), kind)], GIVEN, layout(PLACES))
    assert off(found, ASLANT)[0] < 2.0


@pytest.mark.parametrize("srgb", [True, False])
def test_tone_curves_do_not_change_the_marker_size(srgb: bool) -> None:
    """With the wrong tone curve a blurred marker looks smaller, and its camera seems farther away."""
    grey = picture(ASLANT, {17: flat(0, 0)}, Exposure(blur=1.3, srgb=srgb))
    found = find_camera_pose([grey], GIVEN, layout({17: flat(0, 0)}), PoseOptions(focal_deviation=1e-5))
    eye = np.array(tuple(found.pose.position))
    assert np.linalg.norm(eye) / np.linalg.norm(ASLANT[:3, 3]) == pytest.approx(1.0, abs=0.0015)


def test_a_moved_marker_is_excluded_and_named() -> None:
    listed = PLACES | {42: flat(0.0, 0.09, 2.5)}
    found = find_camera_pose([all_seen()], GIVEN, layout(listed))
    assert off(found, ASLANT)[0] < 1.0
    assert [error.name for error in found.markers if not error.used] == ["marker 42"]
    assert found.grade == Grade.USABLE
    assert "marker 42" in found.verdict
    stated = float(found.verdict.split("about ")[1].split(" mm")[0])
    assert 6 <= stated <= 14


# ------------------------------------------------------------------------------------------------ lens
def with_focal_length(factor: float) -> CameraParameters:
    return with_parameters(fx=600.0 * factor, fy=599.0 * factor, dist_coefs=list(LENS.coefficients))


def test_a_lens_that_fits_is_confirmed_by_the_markers() -> None:
    found = find_camera_pose([all_seen()], GIVEN, layout(PLACES))
    assert isinstance(found.lens, LensCheck)
    assert found.lens.state == LensState.CONFIRMED
    assert found.lens.factor == pytest.approx(1.0, abs=4 * found.lens.deviation)
    assert found.lens.misfit < 2.0
    assert found.grade == Grade.GOOD
    assert "if the focal length is right to 0.05%" in found.verdict


@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_a_wrong_focal_length_is_refused_and_measured_by_the_lens_check(factor: float) -> None:
    shown = with_focal_length(factor)
    error = refused(lambda: find_camera_pose([all_seen()], shown, layout(PLACES)))
    assert error.reason == Reason.WRONG_LENS
    assert f"% {'smaller' if factor > 1 else 'larger'} (± 0.1%)" in str(error)
    check = check_lens([all_seen()], shown, layout(PLACES))
    assert check.state == LensState.CONTRADICTED
    assert check.misfit > 3 * check.misfit_with_factor
    assert check.factor * factor == pytest.approx(1.0, abs=4 * check.deviation)
    assert check.parameters.fx == pytest.approx(600.0, rel=0.004)
    assert off(find_camera_pose([all_seen()], check.parameters, layout(PLACES)), ASLANT)[0] < 1.5


@pytest.mark.parametrize("factor", [0.98, 1.0, 1.02])
def test_a_view_that_does_not_check_the_lens_is_not_good(factor: float) -> None:
    """From straight above, a changed focal length cannot be distinguished from a changed distance."""
    places = {number: place for number, place in PLACES.items() if number != 9}
    camera = rendering.looking_at(np.array([0.0, 0.004, 0.7]), ORIGIN, 0.0)
    found = find_camera_pose([picture(camera, places)], with_focal_length(factor), layout(places))
    assert isinstance(found.lens, LensCheck)
    assert found.lens.state == LensState.UNCHECKED
    assert found.grade == Grade.USABLE
    assert "an error of 1 % moves the camera by 7 mm" in found.verdict


def test_markers_off_their_poses_are_not_good() -> None:
    listed = {number: place.copy() for number, place in PLACES.items()}
    listed[3][0, 3] += 0.0006
    listed[42][1, 3] -= 0.0006
    found = find_camera_pose([all_seen()], GIVEN, layout(listed))
    assert found.residual < 0.5
    assert found.grade == Grade.USABLE
    assert "check the poses and sizes" in found.verdict
    assert off(found, ASLANT)[0] < 4000 * found.position_deviation


def test_several_pictures_are_averaged() -> None:
    noisy = [picture(ASLANT, {3: PLACES[3]}, Exposure(noise=12.0), seed) for seed in range(6)]
    options = PoseOptions(largest_deviation=1.0, focal_deviation=1e-6, centre_deviation=1e-6, distortion_deviation=0.0)
    alone = [find_camera_pose([each], GIVEN, layout({3: PLACES[3]}), options) for each in noisy]
    together = find_camera_pose(noisy, GIVEN, layout({3: PLACES[3]}), options)
    assert together.pictures == 6
    assert together.position_deviation < 0.6 * np.mean([each.position_deviation for each in alone])
    assert off(together, ASLANT)[0] < max(off(each, ASLANT)[0] for each in alone)


def test_pose_from_a_board() -> None:
    board = CharucoBoard(7, 5, 0.04, 0.03, pose=Pose.from_matrix(flat(0.02, 0.01, 0.3)))
    camera = rendering.looking_at(np.array([0.1, -0.25, 0.35]), ORIGIN, 0.2)
    plate = rendering.charuco(7, 5, 0.005, flat(0.02, 0.01, 0.3))
    grey = rendering.render(LENS, camera, [background(), plate], np.random.default_rng(3), subpixels=2)
    found = find_camera_pose([grey], GIVEN, Layout(boards=[board]))
    assert off(found, camera)[0] < 1.0
    assert found.markers[0].name == "board 0"
    assert found.position_deviation < 0.001
    assert 0.5 < found.blur < 2.0
    drawn = draw_camera_pose(grey, GIVEN, Layout(boards=[board]), found)
    assert cv2.imdecode(np.frombuffer(drawn, np.uint8), cv2.IMREAD_COLOR).shape[1] > 640


def test_corners_are_returned_by_marker_id() -> None:
    places = {7: flat(-0.1, 0), 3: flat(0.1, 0)}
    camera = rendering.looking_at(np.array([0.0, -1e-9, 0.6]), ORIGIN, 0.0)
    found = find_marker_corners(picture(camera, places), GIVEN)
    assert [each.marker_id for each in found] == [3, 7]
    # Viewed from above with y up in the picture: the first corner is the upper left one, then clockwise.
    upper_left, upper_right, lower_right, lower_left = found[0].corners
    assert upper_left.x == pytest.approx(LENS.cx + 0.05 / 0.6 * 600, abs=1.0)
    assert upper_left.y == pytest.approx(LENS.cy - 0.05 / 0.6 * 599, abs=1.0)
    assert upper_right.x > upper_left.x + 50
    assert lower_right.y > upper_right.y + 50
    assert lower_left.x == pytest.approx(upper_left.x, abs=0.3)


# ------------------------------------------------------------------------------------------------ refusals
def refused(act: Callable[[], object]) -> CalibrationRefused:
    with pytest.raises(CalibrationRefused) as caught:
        act()
    return caught.value


def test_a_single_frontal_marker_is_refused_with_working_advice() -> None:
    places = {3: flat(0, 0)}
    error = refused(lambda: find_camera_pose([one_ahead()], GIVEN, layout(places)))
    assert error.reason in {Reason.AMBIGUOUS, Reason.UNOBSERVABLE}
    assert "a second marker" in str(error)
    down = AHEAD[:3, :3].T @ np.array([0.0, 0.0, -9.81])
    options = PoseOptions(gravity=Position(*map(float, down)), gravity_deviation=0.001)
    assert off(find_camera_pose([one_ahead()], GIVEN, layout(places), options), AHEAD)[0] < 5.0
    near = Pose.from_matrix(AHEAD)
    near.position.x += 0.004
    options = PoseOptions(expected=near, expected_position=0.003)
    assert off(find_camera_pose([one_ahead()], GIVEN, layout(places), options), AHEAD)[0] < 8.0


def test_contradicting_markers_are_refused() -> None:
    listed = {3: PLACES[3], 17: flat(0.12, 0.1)}
    error = refused(lambda: find_camera_pose([all_seen()], GIVEN, layout(listed)))
    assert error.reason == Reason.IMPLAUSIBLE
    assert "marker 17, marker 3" in str(error)


def test_a_duplicate_marker_is_refused() -> None:
    grey = all_seen().copy()
    corners = find_marker_corners(grey, GIVEN)[0].corners
    left, top = (int(min(getattr(c, axis) for c in corners)) - 12 for axis in "xy")
    part = grey[top : top + 90, left : left + 110].copy()
    grey[380 : 380 + part.shape[0], 20 : 20 + part.shape[1]] = part
    error = refused(lambda: find_camera_pose([grey], GIVEN, layout(PLACES)))
    assert error.reason == Reason.IMPLAUSIBLE
    assert "marker 3 2 times" in str(error)


def test_a_camera_that_moved_between_pictures_is_refused() -> None:
    moved = ASLANT.copy()
    moved[0, 3] += 0.005
    error = refused(lambda: find_camera_pose([all_seen(), picture(moved, PLACES)], GIVEN, layout(PLACES)))
    assert error.reason == Reason.IMPLAUSIBLE
    assert "between picture 0 and picture 1" in str(error)


def test_a_picture_without_configured_markers_is_refused_naming_others() -> None:
    error = refused(lambda: find_camera_pose([all_seen()], GIVEN, layout({5: flat(0, 0), 6: flat(1, 0)})))
    assert error.reason == Reason.NO_MARKER
    assert "marker 5, marker 6" in str(error)
    assert "3, 9, 17, 42" in str(error)
    assert refused(lambda: find_camera_pose([all_seen()], GIVEN, Layout())).reason == Reason.NO_MARKER


def test_edges_of_a_false_detection_are_not_measured() -> None:
    """A false detection is not measured."""
    grey = all_seen()
    lens = measuring.Lens(GIVEN, 640, 480)
    (number, corners), *_ = detect(grey, "4x4_50")
    light = (grey / 255.0).astype(np.float32)
    assert measure(light, (0.0, 0.0), lens, chart_of(0, number), number, corners) is not None
    for other in {0, 1, 2, 4, 5, 30} - {number}:
        assert measure(light, (0.0, 0.0), lens, chart_of(0, other), other, corners) is None


@pytest.mark.parametrize("count", [4, 5, 8, 12])
def test_slopes_of_a_lens_match_small_displacements(count: int) -> None:
    coefficients = [0.06, -0.1, 0.0005, -0.0004, 0.02, 0.03, -0.02, 0.01, 2e-4, 1e-4, 3e-4, -1e-4][:count]
    lens = measuring.Lens(CameraParameters(600.0, 599.0, 322.0, 237.0, coefficients), 640, 480)
    rays = np.random.default_rng(1).uniform(-0.4, 0.4, (50, 2))
    pixels, slopes = lens.pixels_and_slopes(rays)
    assert np.allclose(pixels, lens.pixels(rays), atol=1e-9)
    for axis, step in enumerate(1e-6 * np.eye(2)):
        difference = (lens.pixels(rays + step) - lens.pixels(rays - step)) / 2e-6
        assert np.allclose(slopes[:, :, axis], difference, atol=1e-4)


def test_a_board_that_is_mostly_hidden_is_refused() -> None:
    board = Layout(boards=[CharucoBoard(7, 5, 0.04, 0.03)])
    error = refused(lambda: find_camera_pose([one_ahead()], GIVEN, board))
    assert error.reason == Reason.NO_MARKER
    assert "Too little is visible of a board of 7 × 5 squares" in str(error)


def reason_of(grey: Grey) -> Reason:
    return refused(lambda: find_camera_pose([grey], GIVEN, layout(PLACES))).reason


def in_motion(grey: Grey, length: int, angle: float) -> Grey:
    """Move during the exposure, by a length in px."""
    at = np.linspace(-0.5, 0.5, 4 * length) * length
    shifts = [np.array([[1.0, 0, d * math.cos(angle)], [0, 1.0, d * math.sin(angle)]]) for d in at]
    size = grey.shape[::-1]
    moved = [cv2.warpAffine(grey, shift, size, borderMode=cv2.BORDER_REPLICATE).astype(float) for shift in shifts]
    return np.rint(np.mean(moved, axis=0)).astype(np.uint8)


def test_a_blurred_picture_is_refused() -> None:
    assert reason_of(cv2.GaussianBlur(all_seen(), (0, 0), 5.0).astype(np.uint8)) == Reason.BLURRED


@pytest.mark.parametrize("degrees", [0, 30, 90, 135])
@pytest.mark.parametrize("length", [9, 20])
def test_motion_in_one_direction_is_refused_as_blur(degrees: int, length: int) -> None:
    assert reason_of(in_motion(all_seen(), length, math.radians(degrees))) == Reason.BLURRED


def spots(grey: Grey, radius: int, level: int) -> Grey:
    """Cover the middle of every marker."""
    covered = grey.copy()
    for each in find_marker_corners(grey, GIVEN):
        x, y = (sum(getattr(corner, axis) for corner in each.corners) / 4 for axis in "xy")
        cv2.circle(covered, (round(x), round(y)), radius, level, -1, cv2.LINE_AA)
    return covered


@pytest.mark.parametrize(
    ("change", "reason", "problem"),
    [
        (lambda grey: spots(grey, 30, 90), Reason.NO_MARKER, "not covered"),
        (lambda grey: spots(grey, 30, 255), Reason.OVEREXPOSED, "glare"),
        (lambda grey: grey[:, ::-1].copy(), Reason.MIRRORED, "mirror image"),
        (lambda grey: np.full_like(grey, 120), Reason.COVERED, "Uncover the lens"),
        (lambda grey: grey // 50, Reason.COVERED, "is dark"),
        (lambda grey: np.full_like(grey, 255), Reason.OVEREXPOSED, "is overexposed"),
    ],
    ids=["covered markers", "glare", "mirrored", "covered lens", "dark", "too much light"],
)
def test_a_refusal_names_the_reason(change: Callable[[Grey], Grey], reason: Reason, problem: str) -> None:
    error = refused(lambda: find_camera_pose([change(all_seen())], GIVEN, layout(PLACES)))
    assert error.reason == reason
    assert problem in str(error)


def test_a_camera_below_the_markers_is_refused() -> None:
    options = PoseOptions(lowest=0.8)
    assert refused(lambda: find_camera_pose([all_seen()], GIVEN, layout(PLACES), options)).reason == Reason.IMPLAUSIBLE


# ------------------------------------------------------------------------------------------------ bad input
def with_parameters(**changes: object) -> CameraParameters:
    return CameraParameters(**({"fx": 600.0, "fy": 599.0, "cx": 322.0, "cy": 237.0, "dist_coefs": [0.0] * 5} | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("parameters", "problem"),
    [
        (with_parameters(fx=0.0), "fx"),
        (with_parameters(fy=-1.0), "fy"),
        (with_parameters(fx=math.nan), "fx"),
        (with_parameters(cx=math.inf), "finite"),
        (with_parameters(cx=960.0, cy=540.0), "640 × 480"),
        (with_parameters(dist_coefs=[0.0, math.nan, 0.0, 0.0]), "finite"),
        (with_parameters(dist_coefs=[-5.0, 8.0, 0.0, 0.0, 0.0]), "distortion"),
    ],
)
def test_invalid_camera_parameters_are_named(parameters: CameraParameters, problem: str) -> None:
    with pytest.raises(InvalidData, match=problem):
        find_camera_pose([all_seen()], parameters, layout(PLACES))


@pytest.mark.parametrize("count", [0, 3, 6, 14])
def test_a_wrong_number_of_distortion_coefficients_is_refused(count: int) -> None:
    with pytest.raises(ValueError, match=str(count)):
        with_parameters(dist_coefs=[0.0] * count)


def damaged() -> dict[str, object]:
    png, jpeg = file(all_seen()), file(all_seen(), ".jpg")
    bomb = bytearray(png)
    bomb[16:24] = (60_000).to_bytes(4, "big") * 2
    return {
        "empty": b"",
        "text": b"no picture at all",
        "half a PNG": png[: len(png) // 2],
        "half a JPEG": jpeg[: len(jpeg) // 2],
        "a bomb": bytes(bomb),
        "too long": b"\x89PNG\r\n\x1a\n" + bytes(65 << 20),
        "colour": np.zeros((480, 640, 3), np.uint8),
        "16 bit": np.zeros((480, 640), np.uint16),
        "tiny": np.zeros((8, 8), np.uint8),
    }


@pytest.mark.parametrize("kind", damaged())
def test_data_that_is_not_a_picture_is_refused(kind: str) -> None:
    with pytest.raises(InvalidPicture):
        find_camera_pose([damaged()[kind]], GIVEN, layout(PLACES))  # type: ignore[list-item]


def test_pictures_of_different_sizes_are_refused() -> None:
    with pytest.raises(InvalidPicture, match="picture 1 is 320 × 240"):
        find_camera_pose([all_seen(), np.ascontiguousarray(all_seen()[::2, ::2])], GIVEN, layout(PLACES))


HERE = Pose()
NOWHERE = Pose(Position(math.nan, 0.0, 0.0))


@pytest.mark.parametrize(
    ("wrong", "error", "problem"),
    [
        (Layout([Marker(3, HERE), Marker(4, HERE), Marker(3, HERE)]), Conflict, "marker 3 is listed twice"),
        (Layout([Marker(50, HERE)]), InvalidData, "marker 50 is not in"),
        (Layout([Marker(-1, HERE)]), InvalidData, "marker -1 is not in"),
        (Layout([Marker(3, HERE, size=0.0)]), InvalidData, "size of marker 3"),
        (Layout([Marker(3, NOWHERE)]), InvalidData, "pose of marker 3"),
        (Layout([Marker(3, HERE)], boards=[CharucoBoard(7, 5, 0.04, 0.03)]), Conflict, "marker 3 of board 0"),
        (Layout(boards=[CharucoBoard(7, 5, 0.03, 0.04)]), InvalidData, "smaller than its square"),
        (Layout(boards=[CharucoBoard(20, 20, 0.04, 0.03)]), InvalidData, "4x4_50"),
        (Layout(boards=[CharucoBoard(1, 5, 0.04, 0.03)]), InvalidData, "1 × 5"),
    ],
)
def test_an_invalid_marker_layout_is_named(wrong: Layout, error: type[Arcor2Error], problem: str) -> None:
    with pytest.raises(error, match=problem):
        find_camera_pose([all_seen()], GIVEN, wrong)
