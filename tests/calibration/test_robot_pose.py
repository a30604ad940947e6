"""Robot pose from depth pictures of a simulated sensor, refusals, and invalid input."""

import math

import cv2
import numpy as np
import pytest

from arcor2_hw.calibration.depth import depth_view, mean_depth, read_depth
from arcor2_hw.calibration.pictures import InvalidPicture
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.results import Grade, RobotPose
from arcor2_hw.calibration.robot_pose import RobotPoseOptions, find_robot_pose
from arcor2_hw.calibration.robot_states import JointState, find_robot_pose_of_states
from arcor2_hw.calibration.surface import RobotSurface
from arcor2_hw.compute.calibration_tasks import states_of
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import InvalidData
from tests.calibration.depth_sensor import Block, Capsule, Floats, Sensor, arm, looking, shift, tool, triangles, turn
from tests.calibration.workplace import States, View, configured_parameters, drawn, states, surface_of_arm

JOINTS = [0.3, -1.3, 1.4, -1.2, -1.5, 0.2]
EYE = looking(np.array([0.0, 0.0, 0.4]), np.array([1.0, 0.7, 0.9]))
ASSUMED = shift(0.03, -0.02, 0.03) @ turn(np.array([0.2, 0.3, 1.0]), math.radians(4.5))


def seen(shapes: list[Block | Capsule], eye: Floats = EYE, joints: list[float] = JOINTS) -> View:
    sensor = Sensor(shapes=shapes, wall=-2.0)
    picture = sensor.take(eye, np.random.default_rng(3))
    poses = (Pose.from_matrix(eye), Pose.from_matrix(ASSUMED), Pose())
    return View(surface_of_arm(joints), picture, configured_parameters(sensor), *poses)


@pytest.fixture(scope="module")
def plain() -> View:
    return seen([*arm(JOINTS), *tool(JOINTS)])


def solve(view: View, surface: RobotSurface | None = None, assumed: Pose | None = None):  # type: ignore[no-untyped-def]
    return find_robot_pose(surface or view.surface, view.depth, view.parameters, view.camera, assumed or view.assumed)


def refused(view: View, **changes: object) -> CalibrationRefused:
    with pytest.raises(CalibrationRefused) as caught:
        solve(view, **changes)  # type: ignore[arg-type]
    return caught.value


# ------------------------------------------------------------------------------------------------ results
@pytest.mark.parametrize("seed", [1, 24])
def test_an_arm_is_found_from_50_mm_and_5_degrees_off(seed: int) -> None:
    view = drawn(seed)
    found = solve(view)
    distance, angle = view.error(found.pose)
    assert distance < 0.003
    assert angle < math.radians(0.6)
    assert distance < 6.0 * found.position_deviation
    assert angle < 6.0 * found.orientation_deviation
    assert found.moved == pytest.approx(0.05, abs=0.004)
    assert math.degrees(found.turned) == pytest.approx(5.0, abs=0.7)
    assert found.fitness > 0.75
    assert found.agreed >= 2


def test_the_same_picture_gives_the_same_result(plain: View) -> None:
    first, second = solve(plain), solve(plain)
    assert first.pose == second.pose
    assert first.grade is Grade.USABLE
    assert "confirms" in first.verdict
    assert "One joint state does not check the joints" in first.verdict


@pytest.fixture(scope="module")
def three() -> States:
    return states(0)


def of_states(view: States, surfaces: list[RobotSurface]) -> RobotPose:
    given = [JointState(surface, depth) for surface, depth in zip(surfaces, view.depths, strict=True)]
    return find_robot_pose_of_states(given, view.parameters, view.camera, view.assumed)


def test_joint_states_that_agree_are_good(three: States) -> None:
    found = of_states(three, three.off(0, 0.0))
    assert found.grade is Grade.GOOD
    distance = found.pose.position.distance_to(three.true.position)
    assert distance < min(0.003, 6.0 * found.position_deviation)
    assert "The poses of 3 joint states differ by up to" in found.verdict


def test_a_wrong_joint_is_refused_by_comparing_joint_states(three: States) -> None:
    """Each state alone fits with a stated deviation of half a millimetre, but is off by centimetres."""
    with pytest.raises(CalibrationRefused, match="zero positions") as caught:
        of_states(three, three.off(1, math.radians(2.0)))
    assert caught.value.reason is Reason.IMPLAUSIBLE


def test_the_number_of_joint_states_is_checked(three: States) -> None:
    with pytest.raises(InvalidData, match="not 0"):
        find_robot_pose_of_states([], three.parameters, three.camera, three.assumed)
    assert [len(each.depth) for each in states_of([[], []], [b""] * 6)] == [3, 3]
    for images in (0, 5):
        with pytest.raises(InvalidData, match=f"not {images} in total"):
            states_of([[], []], [b""] * images)


def test_averaged_pictures_reduce_the_error(plain: View) -> None:
    sensor = Sensor(shapes=[*arm(JOINTS), *tool(JOINTS)], wall=-2.0, pictures=1, noise=0.004, fixed_noise=0.0)
    rng = np.random.default_rng(5)
    exact = sensor.exact(EYE)
    stack = np.stack([sensor.noisy(exact, rng) for _ in range(5)])
    single = depth_view(stack[0], plain.parameters)
    mean = depth_view(stack, plain.parameters)
    inner = (single.depth > 0) & (mean.depth > 0) & (exact < 2.0)
    assert np.std((mean.depth - exact)[inner]) < 0.6 * np.std((single.depth - exact)[inner])


def test_half_occlusion_is_reported_and_the_pose_stays_correct() -> None:
    view = seen([*arm(JOINTS), *tool(JOINTS), Block(shift(0.4, 0.28, 0.35), (0.08, 0.08, 0.7))])
    found = solve(view)
    assert view.error(found.pose)[0] < 0.004
    assert found.occluded > 0.12
    assert "hidden" in found.verdict


# ------------------------------------------------------------------------------------------------ refusals
def test_rotation_of_a_round_body_is_undetermined() -> None:
    body = Capsule(np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.0, 0.8]), 0.08)
    surface = RobotSurface.of_links([(*triangles(body), np.eye(4))], "the post")
    error = refused(seen([body]), surface=surface)
    assert error.reason in (Reason.UNOBSERVABLE, Reason.AMBIGUOUS)
    assert "the post" in str(error)


@pytest.mark.parametrize(
    "shapes", [[], [Block(shift(0, 0, 0.3), (0.3, 0.3, 0.6))]], ids=["nothing", "a cupboard in its place"]
)
def test_a_view_without_the_robot_is_refused(shapes: list[Block | Capsule]) -> None:
    assert refused(seen(shapes)).reason in (Reason.NOT_CONVERGED, Reason.NO_OVERLAP)


def test_wrong_joint_values_are_refused(plain: View) -> None:
    bent = list(JOINTS)
    bent[2] += math.radians(12.0)
    assert refused(plain, surface=surface_of_arm(bent)).reason is Reason.NOT_CONVERGED


def test_a_slightly_wrong_joint_lowers_the_grade(plain: View) -> None:
    """One degree of the elbow moves the base by a centimetre: too little to refuse, but the grade is lower."""
    bent = list(JOINTS)
    bent[2] += math.radians(1.0)
    found = solve(plain, surface=surface_of_arm(bent))
    assert found.grade is Grade.USABLE
    assert "joints" in found.verdict


def test_a_robot_far_from_its_assumed_pose_is_refused(plain: View) -> None:
    beside = refused(plain, assumed=Pose(Position(0.3, 0.0, 0.0)))
    assert beside.reason in (Reason.NOT_CONVERGED, Reason.NO_OVERLAP)
    error = refused(plain, assumed=Pose(Position(-3.0, 0.0, 0.0)))
    assert error.reason is Reason.NO_OVERLAP


def test_a_covered_camera_is_refused(plain: View) -> None:
    error = refused(View(**{**vars(plain), "depth": np.zeros_like(plain.depth)}))
    assert error.reason is Reason.TOO_FEW_POINTS
    ten = np.zeros_like(plain.depth)
    ten[100, 100:110] = 1000
    assert "usable points" in str(refused(View(**{**vars(plain), "depth": ten})))


# ------------------------------------------------------------------------------------------------ bad input
def test_a_picture_size_other_than_of_the_intrinsics_is_named(plain: View) -> None:
    for depth in (plain.depth[::2, ::2], np.zeros((720, 1280), np.uint16)):
        with pytest.raises(InvalidData, match="another size"):
            depth_view(depth, plain.parameters)


@pytest.mark.parametrize(
    "depth",
    [np.zeros((360, 640), np.uint8), np.zeros((360, 640)), np.zeros((2, 3, 4, 5), np.uint16), np.zeros(7, np.uint16)],
    ids=["8 bit", "metres", "four axes", "a row"],
)
def test_data_that_is_not_a_depth_picture_is_named(depth: np.ndarray) -> None:
    with pytest.raises(InvalidData, match="16 bit"):
        mean_depth(depth)


def test_invalid_intrinsics_and_options_are_named(plain: View) -> None:
    for fx in (0.0, -456.0, math.nan):
        with pytest.raises(InvalidData, match="positive"):
            depth_view(plain.depth, CameraParameters(fx, 456.0, 320.0, 180.0, [0.0] * 5))
    with pytest.raises(InvalidData, match="angle_within"):
        RobotPoseOptions(angle_within=0.0)


def test_depth_files_are_read_and_other_files_refused() -> None:
    depth = np.arange(48, dtype=np.uint16).reshape(6, 8) * 100
    encoded = cv2.imencode(".png", depth)[1].tobytes()
    np.testing.assert_array_equal(read_depth(encoded), depth)
    eight = cv2.imencode(".png", depth.astype(np.uint8))[1].tobytes()
    bomb = bytearray(encoded)
    bomb[16:24] = (60_000).to_bytes(4, "big") * 2
    wrong = {b"": "not a PNG", b"hello": "not a PNG", eight: "8 bit", bytes(bomb): "maximum", encoded[:60]: "damaged"}
    for content, reason in wrong.items():
        with pytest.raises(InvalidPicture, match=reason):
            read_depth(content)


def test_an_invalid_surface_is_named() -> None:
    corners, one = np.eye(3), np.array([[0, 1, 2]])
    for vertices, faces, reason in (
        (np.zeros((0, 3)), one, "no vertices"),
        (corners, np.zeros((0, 3), np.int64), "no triangles"),
        (corners * np.nan, one, "not finite"),
        (corners, one + 1, "missing vertex"),
    ):
        with pytest.raises(InvalidData, match=reason):
            RobotSurface(vertices, faces)
    with pytest.raises(InvalidData, match="no links"):
        RobotSurface.of_links([])
