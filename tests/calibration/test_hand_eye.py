"""Hand-eye calibration: closed forms, rendered pictures, and refusals."""

import functools
import math
import re
from collections.abc import Callable

import cv2
import numpy as np
import pytest

from arcor2_hw.calibration.camera_results import HandEye, HandEyeSample, Mounting
from arcor2_hw.calibration.hand_eye import find_hand_eye
from arcor2_hw.calibration.hand_eye_methods import METHODS, Method
from arcor2_hw.calibration.layout import CharucoBoard, Layout
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.calibration.results import Grade
from arcor2_hw.calibration.rigid import inverted, motion, turned
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import InvalidData
from benchmarks import rendering
from benchmarks.rendering import Array, Lens

LENS = Lens(600.0, 599.0, 322.0, 237.0, (0.06, -0.1, 0.0005, -0.0004, 0.02), 640, 480)
GIVEN = CameraParameters(600.0, 599.0, 322.0, 237.0, list(LENS.coefficients))
TARGET = Layout(boards=[CharucoBoard(7, 5, 0.04, 0.03)])
FLANGE_FROM_CAMERA = motion(turned(np.array([0.1, -0.2, 1.4])), np.array([0.06, -0.03, 0.05]))
BASE_FROM_BOARD = motion(turned(np.array([0.02, 0.03, 0.7])), np.array([0.45, 0.1, 0.02]))
BASE_FROM_CAMERA = rendering.looking_at(np.array([0.9, 0.2, 0.5]), np.array([0.5, 0.0, 0.3]), 0.1)
FLANGE_FROM_BOARD = motion(turned(np.array([0.1, 0.2, -0.4])), np.array([0.02, 0.05, 0.03]))
COUNT = 10


def eyes(count: int = COUNT) -> list[Array]:
    """Board from camera: from all sides."""
    random = np.random.default_rng(7)
    result = []
    for index in range(count):
        azimuth, tilt = index * 2.4, random.uniform(0.1, 0.7)
        eye = random.uniform(0.35, 0.5) * np.array(
            [math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)]
        )
        result.append(rendering.looking_at(eye, np.append(random.uniform(-0.03, 0.03, 2), 0.0), random.uniform(-1, 1)))
    return result


@functools.cache
def pictures() -> list[bytes]:
    """Settings of a board at the origin of the picture's world."""
    result = []
    for index, camera in enumerate(eyes()):
        random = np.random.default_rng([3, index])
        plates = [rendering.table(random, 2.0), rendering.charuco(7, 5, 0.005, np.eye(4))]
        result.append(cv2.imencode(".png", rendering.render(LENS, camera, plates, random, subpixels=2))[1].tobytes())
    return result


def flanges(mounting: Mounting) -> list[Array]:
    if mounting == "eye_in_hand":
        return [BASE_FROM_BOARD @ eye @ inverted(FLANGE_FROM_CAMERA) for eye in eyes()]
    return [BASE_FROM_CAMERA @ inverted(eye) @ inverted(FLANGE_FROM_BOARD) for eye in eyes()]


def samples(mounting: Mounting, noise: float = 0.0) -> list[HandEyeSample]:
    random = np.random.default_rng(5)
    result = []
    for flange, picture in zip(flanges(mounting), pictures(), strict=True):
        off = motion(turned(noise * random.normal(size=3)), noise * 0.3 * random.normal(size=3))
        result.append(HandEyeSample(Pose.from_matrix(flange @ off), picture))
    return result


def off(found: Pose, true: Array) -> tuple[float, float]:
    error = Pose.from_matrix(true).inverted() * found
    return math.hypot(*error.position), error.orientation.angle_to(Pose().orientation)


@functools.cache
def in_hand() -> HandEye:
    return find_hand_eye(samples("eye_in_hand"), GIVEN, TARGET, "eye_in_hand")


# ------------------------------------------------------------------------------------------------ closed forms
@pytest.mark.parametrize("name", METHODS)
def test_closed_form_solvers_are_exact_for_exact_motions(name: str) -> None:
    method: Method = METHODS[name]
    random = np.random.default_rng(1)
    for _ in range(20):
        mount = motion(turned(random.normal(size=3)), random.normal(size=3))
        world = motion(turned(random.normal(size=3)), random.normal(size=3))
        hands = [motion(turned(random.normal(size=3)), random.normal(size=3)) for _ in range(5)]
        seen = [inverted(hand @ mount) @ world for hand in hands]
        rotation, position = method(
            [h[:3, :3] for h in hands],
            [h[:3, 3] for h in hands],
            [s[:3, :3] for s in seen],
            [s[:3, 3] for s in seen],
            0.1,
        )
        assert np.abs(rotation - mount[:3, :3]).max() < 1e-9
        assert np.abs(position - mount[:3, 3]).max() < 1e-8


# ------------------------------------------------------------------------------------------------ pictures
def test_eye_in_hand_matches_ground_truth() -> None:
    found = in_hand()
    distance, angle = off(found.pose, FLANGE_FROM_CAMERA)
    assert distance < 0.0005
    assert angle < 0.001
    assert off(found.target, BASE_FROM_BOARD)[0] < 0.0005
    assert found.residual < 0.2
    assert [method.name for method in found.methods] == ["Park", "Daniilidis"]
    assert all(method.translation < 0.005 for method in found.methods)
    assert len(found.samples) == COUNT
    assert all(sample.used for sample in found.samples)
    picture = cv2.imdecode(np.frombuffer(found.picture, np.uint8), cv2.IMREAD_COLOR)
    assert picture.std() > 5


def test_eye_to_hand_matches_ground_truth() -> None:
    found = find_hand_eye(samples("eye_to_hand"), GIVEN, TARGET, "eye_to_hand")
    assert off(found.pose, BASE_FROM_CAMERA)[0] < 0.0005
    assert off(found.target, FLANGE_FROM_BOARD)[0] < 0.0005


def test_an_inexact_robot_increases_residual_and_deviation() -> None:
    steps: list[tuple[int, int]] = []
    found = find_hand_eye(
        samples("eye_in_hand", 0.001), GIVEN, TARGET, "eye_in_hand", progress=lambda done, of: steps.append((done, of))
    )
    distance, angle = off(found.pose, FLANGE_FROM_CAMERA)
    assert found.residual > 2 * in_hand().residual
    assert found.position_deviation > 1.5 * in_hand().position_deviation
    # Errors of the hand pose move all corners of a picture together. As errors of single corners they would turn the
    # camera
    # by 0.01 rad here.
    assert angle < 0.002
    assert distance < 0.001
    assert distance < 4 * found.position_deviation
    assert angle < 4 * found.orientation_deviation
    assert steps == [(i + 1, COUNT) for i in range(COUNT)]


def test_a_sample_taken_during_motion_is_excluded() -> None:
    spoiled = samples("eye_in_hand")
    moved = spoiled[4].flange * Pose(Position(0.01, 0.0, 0.01))
    spoiled[4] = HandEyeSample(moved, spoiled[4].picture)
    found = find_hand_eye(spoiled, GIVEN, TARGET, "eye_in_hand")
    assert [sample.sample for sample in found.samples if not sample.used] == [4]
    assert "contradicts" in found.samples[4].problem
    assert off(found.pose, FLANGE_FROM_CAMERA)[0] < 0.0006


def test_a_picture_without_the_target_is_excluded_and_reported() -> None:
    spoiled = samples("eye_in_hand")
    empty = cv2.imencode(".png", np.full((480, 640), 90, np.uint8))[1].tobytes()
    spoiled[0] = HandEyeSample(spoiled[0].flange, empty)
    found = find_hand_eye(spoiled, GIVEN, TARGET, "eye_in_hand")
    assert not found.samples[0].used
    assert found.samples[0].problem
    assert "1 of 10" in found.verdict


# ------------------------------------------------------------------------------------------------ refusals
def refused(act: Callable[[], object]) -> CalibrationRefused:
    with pytest.raises(CalibrationRefused) as caught:
        act()
    return caught.value


def test_rotations_about_one_axis_are_refused() -> None:
    turns = [motion(turned(np.array([0.0, 0.0, 0.3 * i])), np.array([0.1 * i, 0.0, 0.0])) for i in range(COUNT)]
    taken = [HandEyeSample(Pose.from_matrix(turn), each) for turn, each in zip(turns, pictures(), strict=True)]
    assert refused(lambda: find_hand_eye(taken, GIVEN, TARGET, "eye_in_hand")).reason == Reason.DEGENERATE


def test_poses_without_rotation_are_refused() -> None:
    taken = [HandEyeSample(Pose(Position(0.01 * i)), each) for i, each in enumerate(pictures())]
    error = refused(lambda: find_hand_eye(taken, GIVEN, TARGET, "eye_in_hand"))
    assert error.reason == Reason.DEGENERATE
    assert "hardly turned" in str(error)


def test_poses_of_other_pictures_are_refused() -> None:
    """In another order, or with the other mounting."""
    good = samples("eye_in_hand")
    mixed = [HandEyeSample(good[(i + 3) % COUNT].flange, each.picture) for i, each in enumerate(good)]
    for taken, mounting in ((mixed, "eye_in_hand"), (good, "eye_to_hand")):
        error = refused(lambda taken=taken, mounting=mounting: find_hand_eye(taken, GIVEN, TARGET, mounting))  # type: ignore[misc]
        assert error.reason == Reason.IMPLAUSIBLE


def test_too_few_samples_are_refused() -> None:
    with pytest.raises(InvalidData, match="3 to"):
        find_hand_eye(samples("eye_in_hand")[:2], GIVEN, TARGET, "eye_in_hand")
    empty = cv2.imencode(".png", np.full((480, 640), 90, np.uint8))[1].tobytes()
    taken = [HandEyeSample(each.flange, empty) for each in samples("eye_in_hand")[:4]]
    assert refused(lambda: find_hand_eye(taken, GIVEN, TARGET, "eye_in_hand")).reason == Reason.NO_MARKER


def test_a_pose_with_nan_is_named() -> None:
    taken = samples("eye_in_hand")
    taken[2] = HandEyeSample(Pose(Position(math.inf)), taken[2].picture)
    with pytest.raises(InvalidData, match="sample 2"):
        find_hand_eye(taken, GIVEN, TARGET, "eye_in_hand")


# ------------------------------------------------------------------------------------------------ goodness of fit
@pytest.mark.parametrize("mounting", ["eye_in_hand", "eye_to_hand"])
@pytest.mark.parametrize("size", [0.99, 1.03])
def test_a_target_of_another_size_is_refused(mounting: Mounting, size: float) -> None:
    """One percent of the size moves the camera by 4 mm; the corners alone fit as well as the right size."""
    target = Layout(boards=[CharucoBoard(7, 5, 0.04 * size, 0.03 * size)])
    error = refused(lambda: find_hand_eye(samples(mounting), GIVEN, target, mounting))
    assert error.reason == Reason.IMPLAUSIBLE
    wrong = f"{abs(1 / size - 1):.1%} {'smaller' if size > 1 else 'larger'}"
    assert f"The target seems {wrong}" in str(error)


def test_a_target_half_a_percent_off_is_not_good() -> None:
    target = Layout(boards=[CharucoBoard(7, 5, 0.0402, 0.03015)])
    found = find_hand_eye(samples("eye_in_hand"), GIVEN, target, "eye_in_hand")
    assert found.grade == Grade.USABLE
    assert "The target seems 0.5% smaller" in found.verdict
    assert off(found.pose, FLANGE_FROM_CAMERA)[0] < 3 * found.position_deviation


def test_a_focal_length_off_is_refused() -> None:
    shown = CameraParameters(606.0, 605.0, 322.0, 237.0, list(LENS.coefficients))
    error = refused(lambda: find_hand_eye(samples("eye_in_hand"), shown, TARGET, "eye_in_hand"))
    assert "The focal length seems 1.0% smaller" in str(error)


def test_the_verdict_states_the_effect_of_a_size_that_is_not_confirmed() -> None:
    """A robot error of 0.5 mm hides that a target is 1 % too large; the verdict states how far the camera moves."""
    noisy = samples("eye_in_hand", 1.7e-3)
    right, larger = (
        find_hand_eye(noisy, GIVEN, Layout(boards=[CharucoBoard(7, 5, 0.04 * size, 0.03 * size)]), "eye_in_hand")
        for size in (1.0, 1.01)
    )
    assert larger.grade == Grade.USABLE
    moved = 1000 * right.pose.position.distance_to(larger.pose.position)
    assert moved > 2000 * larger.position_deviation
    for found in (right, larger):
        stated = re.search(r"1 % of the size moves the camera by ([\d.]+) mm", found.verdict)
        assert stated is not None
        assert float(stated[1]) == pytest.approx(moved, rel=0.1)


def test_a_result_with_an_exact_robot_is_good() -> None:
    assert in_hand().grade == Grade.GOOD
    assert "confirm the size of the target" in in_hand().verdict
