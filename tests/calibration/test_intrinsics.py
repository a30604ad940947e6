"""Intrinsics from pictures of a board through a known lens, and refusals."""

import functools
import math
from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from arcor2_hw.calibration.camera_results import Intrinsics, IntrinsicsOptions
from arcor2_hw.calibration.intrinsics import coverage_of, find_intrinsics
from arcor2_hw.calibration.layout import CharucoBoard
from arcor2_hw.calibration.pictures import InvalidPicture
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.exceptions import InvalidData
from benchmarks import rendering
from benchmarks.rendering import Lens

LENS = Lens(600.0, 597.0, 326.0, 233.0, (0.09, -0.15, 0.0008, -0.0006, 0.04), 640, 480)
BOARD = CharucoBoard(7, 5, 0.04, 0.03)
COUNT = 12


def take(index: int, tilt: float) -> npt.NDArray[np.uint8]:
    random = np.random.default_rng([9, index])
    azimuth = index * 2.4
    eye = random.uniform(0.3, 0.38) * np.array(
        [math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)]
    )
    aside = 0.07 * np.array([math.cos(index * 1.3), 0.7 * math.sin(index * 1.3), 0.0])
    camera = rendering.looking_at(eye + aside, aside, 0.4 * index)
    plates = [rendering.table(random, 2.0), rendering.charuco(7, 5, 0.005, np.eye(4))]
    return rendering.render(LENS, camera, plates, random, subpixels=2)


@functools.cache
def tilted() -> list[npt.NDArray[np.uint8]]:
    return [take(index, 0.15 + 0.5 * (index % 4) / 3) for index in range(COUNT)]


@functools.cache
def ahead() -> list[npt.NDArray[np.uint8]]:
    return [take(index, 0.02) for index in range(8)]


@functools.cache
def found() -> Intrinsics:
    return find_intrinsics(tilted(), BOARD)


def refused(act: Callable[[], object]) -> CalibrationRefused:
    with pytest.raises(CalibrationRefused) as caught:
        act()
    return caught.value


def test_intrinsics_match_ground_truth() -> None:
    p = found().parameters
    assert p.fx == pytest.approx(LENS.fx, abs=max(4 * found().deviations[0], 0.6))
    assert p.fy == pytest.approx(LENS.fy, abs=max(4 * found().deviations[1], 0.6))
    assert p.cx == pytest.approx(LENS.cx, abs=max(4 * found().deviations[2], 0.6))
    assert p.cy == pytest.approx(LENS.cy, abs=max(4 * found().deviations[3], 0.6))
    assert max(found().deviations) < 1.0
    assert len(p.dist_coefs) == 5
    assert found().residual < 0.15
    assert (found().width, found().height) == (640, 480)
    assert "known to" in found().verdict


def test_rays_match_ground_truth_where_the_board_was_seen() -> None:
    """Coefficients may compensate each other; the relevant result is the ray of each pixel."""
    p = found().parameters
    matrix = np.array([[p.fx, 0, p.cx], [0, p.fy, p.cy], [0, 0, 1.0]])
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 9), np.linspace(-0.3, 0.3, 7))
    points = np.column_stack((x.ravel(), y.ravel(), np.ones(x.size)))
    got = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.array(p.dist_coefs))[0].reshape(-1, 2)
    u, v = rendering.distorted(x.ravel(), y.ravel(), LENS.coefficients)
    true = np.column_stack((u * LENS.fx + LENS.cx, v * LENS.fy + LENS.cy))
    # A shift of the middle is equivalent to a rotation of the camera, not a property of the lens.
    left = (got - true) - (got - true).mean(axis=0)
    assert np.abs(left).max() < 0.6


@pytest.mark.parametrize("coefficients", [4, 8])
def test_other_distortion_models_are_fitted(coefficients: int) -> None:
    other = find_intrinsics(tilted(), BOARD, IntrinsicsOptions(coefficients=coefficients))  # type: ignore[arg-type]
    assert len(other.parameters.dist_coefs) == coefficients
    assert other.parameters.fx == pytest.approx(LENS.fx, abs=4.0)


def test_the_result_lists_views_and_picture_size() -> None:
    steps: list[tuple[int, int]] = []
    blank = np.full((480, 640), 90, np.uint8)
    result = find_intrinsics([blank, *tilted()], BOARD, progress=lambda done, of: steps.append((done, of)))
    assert steps[-1] == (COUNT + 1, COUNT + 1)
    assert not result.views[0].used
    assert "not visible" in result.views[0].problem
    assert all(view.corners >= 6 and view.residual < 0.3 for view in result.views[1:])
    assert "Pictures that were not used: 1." in result.verdict
    assert cv2.imdecode(np.frombuffer(result.picture, np.uint8), cv2.IMREAD_COLOR).std() > 5


def test_an_outlier_view_is_excluded() -> None:
    wrong = tilted()[3]
    stretched = cv2.warpAffine(wrong, np.array([[1.0, 0.0, 0.0], [0.0, 1.06, -12.0]]), (640, 480)).astype(np.uint8)
    pictures = [*tilted()[:3], stretched, *tilted()[4:]]
    result = find_intrinsics(pictures, BOARD)
    assert [view.view for view in result.views if not view.used] == [3]
    assert result.parameters.fx == pytest.approx(LENS.fx, abs=2.0)


def test_coverage_counts_grid_cells() -> None:
    assert coverage_of([np.array([[10.0, 10.0], [20.0, 20.0], [630.0, 470.0]])], (640, 480)) == pytest.approx(2 / 48)


# ------------------------------------------------------------------------------------------------ refusals
def test_too_few_views_are_refused() -> None:
    error = refused(lambda: find_intrinsics(tilted()[:5], BOARD))
    assert error.reason == Reason.TOO_FEW_POINTS
    assert "5 pictures only" in str(error)
    blank = np.full((480, 640), 90, np.uint8)
    assert refused(lambda: find_intrinsics([blank] * 8, BOARD)).reason == Reason.NO_MARKER
    with pytest.raises(InvalidData):
        find_intrinsics([], BOARD)


def test_similar_views_are_refused() -> None:
    options = IntrinsicsOptions(smallest_coverage=0.1)
    assert refused(lambda: find_intrinsics(ahead(), BOARD, options)).reason == Reason.DEGENERATE
    assert refused(lambda: find_intrinsics([tilted()[0]] * 8, BOARD, options)).reason == Reason.DEGENERATE


def test_poor_coverage_of_the_picture_is_refused() -> None:
    error = refused(lambda: find_intrinsics(tilted(), BOARD, IntrinsicsOptions(smallest_coverage=0.999)))
    assert error.reason == Reason.TOO_FEW_POINTS
    assert "corners" in str(error)


def test_pictures_of_two_cameras_are_refused() -> None:
    half = np.ascontiguousarray(tilted()[1][::2, ::2])
    with pytest.raises(InvalidPicture, match="picture 1"):
        find_intrinsics([tilted()[0], half], BOARD)
