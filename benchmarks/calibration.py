"""Errors of camera poses computed from rendered pictures with known truth.

The solver receives inaccurate intrinsics, drawn anew for each picture: fx and fy are off by 0.05 %, cx and cy by
0.5 px, every distortion coefficient by 2 % of its value (standard deviations).
"""

import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.camera_pose import find_camera_pose
from arcor2_hw.calibration.camera_results import CameraPose, PoseOptions
from arcor2_hw.calibration.layout import CharucoBoard, Layout, Marker
from arcor2_hw.calibration.refusals import CalibrationRefused
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose
from benchmarks import rendering
from benchmarks.metrics import Metric, Report, median, percentile
from benchmarks.rendering import Array, Exposure, Lens, Plate

SEED: Final = 20261121
PICTURES: Final = 200
LONG: Final = 2000
LENS: Final = Lens(870.0, 868.0, 645.0, 355.0, (0.08, -0.16, 0.0006, -0.0004, 0.05))
SIZE: Final = 0.1
FOCAL, CENTRE, DISTORTION = 0.0005, 0.5, 0.02
MAX_DEVIATIONS: Final = 3.0
"""Position error, in standard deviations of the result, above which the verdict is wrong."""
CALLS: Final = 3
"""Number of times each picture is solved; the shortest time counts, to exclude the load of the machine."""


@dataclass(frozen=True, eq=False)
class View:
    """Scene, camera pose and exposure of a picture."""

    world_from_camera: Array
    plates: list[Plate]
    layout: Layout
    exposure: Exposure


@dataclass
class ErrorStatistics:
    """Errors in mm and degrees, times in s, reasons of refusals, number of wrong verdicts.

    opencv: times in which OpenCV decodes the pictures and detects their markers.
    """

    position: list[float] = field(default_factory=list)
    orientation: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    opencv: list[float] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    wrong: int = 0

    def note(self) -> str:
        """Return the note: seed, refusals and wrong verdicts."""
        reasons = ", ".join(f"{self.refused.count(each)} {each}" for each in sorted(set(self.refused)))
        return (
            f"seed {SEED}; refused {len(self.refused)}{f' ({reasons})' if reasons else ''}, wrong verdicts {self.wrong}"
        )


# ------------------------------------------------------------------------------------------------ views
def on_table(x: float, y: float, turn: float) -> Array:
    """Return world_from_plate of a plate on the table."""
    pose = np.eye(4)
    pose[:2, :2] = [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
    pose[:2, 3] = x, y
    return pose


def camera_over(random: np.random.Generator, near: float = 0.5, far: float = 1.6) -> Array:
    """Return a random world_from_camera: distance from `near` to `far` (m), tilt 0 to 60°, any roll."""
    distance, tilt, azimuth = (
        random.uniform(near, far),
        math.radians(random.uniform(0, 60)),
        random.uniform(0, math.tau),
    )
    eye = distance * np.array([math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)])
    target = np.append(random.uniform(-0.03, 0.03, 2), 0.0)
    return rendering.looking_at(eye, target, random.uniform(0, math.tau))


def is_visible(plate: Plate, world_from_camera: Array, lens: Lens) -> bool:
    """Return whether the whole plate is in the picture."""
    width, height = plate.size
    corners = np.array([[x * width / 2, y * height / 2, 0.0, 1.0] for x in (-1, 1) for y in (-1, 1)])
    x, y, z, _ = np.linalg.inv(world_from_camera) @ plate.world_from_plate @ corners.T
    u, v = rendering.distorted(x / z, y / z, lens.coefficients)
    u, v = u * lens.fx + lens.cx, v * lens.fy + lens.cy
    return bool(z.min() > 0 and u.min() > 8 and v.min() > 8 and u.max() < lens.width - 9 and v.max() < lens.height - 9)


def markers_view(random: np.random.Generator, count: int, background: Plate) -> View:
    """Return a view of one marker, or of several around the center, all within the picture."""
    while True:
        camera = camera_over(random)
        numbers = random.choice(50, count, replace=False)
        start = random.uniform(0, math.tau)
        places = []
        for index in range(count):
            angle, radius = start + index * math.tau / count, random.uniform(0.10, 0.14) if count > 1 else 0.03
            places.append(on_table(radius * math.cos(angle), radius * math.sin(angle), random.uniform(0, math.tau)))
        plates = [rendering.marker(int(n), SIZE, place) for n, place in zip(numbers, places, strict=True)]
        if all(is_visible(plate, camera, LENS) for plate in plates):
            break
    listed = [Marker(int(n), Pose.from_matrix(place)) for n, place in zip(numbers, places, strict=True)]
    return View(camera, [background, *plates], Layout(listed, size=SIZE), exposure_of(random))


def board_view(random: np.random.Generator, background: Plate) -> View:
    """Return a view of a ChArUco board of 7 × 5 squares of 30 mm, 0.4 to 1 m away."""
    cell = 0.03 / 8
    while True:
        camera, place = (
            camera_over(random, 0.4, 1.0),
            on_table(random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05), random.uniform(0, math.tau)),
        )
        plate = rendering.charuco(7, 5, cell, place)
        if is_visible(plate, camera, LENS):
            break
    board = CharucoBoard(7, 5, cell * 8, cell * 6, pose=Pose.from_matrix(place))
    return View(camera, [background, plate], Layout(boards=[board]), exposure_of(random))


def exposure_of(random: np.random.Generator) -> Exposure:
    """Return random blur, noise and light as in a factory hall."""
    return Exposure(
        random.uniform(0.6, 1.2), random.uniform(1.5, 3.0), random.uniform(0.7, 1.05), random.uniform(0, 0.4)
    )


def inaccurate_intrinsics(random: np.random.Generator, factor: float = 1.0) -> CameraParameters:
    """Return the camera's intrinsics with measurement errors."""
    f = 1 + factor * FOCAL * random.normal(size=2)
    c = factor * CENTRE * random.normal(size=2)
    distorted = [k * (1 + factor * DISTORTION * random.normal()) for k in LENS.coefficients]
    return CameraParameters(LENS.fx * f[0], LENS.fy * f[1], LENS.cx + c[0], LENS.cy + c[1], distorted)


def picture_of(view: View, random: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Render the picture."""
    return rendering.render(LENS, view.world_from_camera, view.plates, random, view.exposure)


def errors_of(pose: Pose, world_from_camera: Array) -> tuple[float, float]:
    """Return the position error, mm, and the orientation error, degrees."""
    off = pose.inverted() * Pose.from_matrix(world_from_camera)
    return math.hypot(*off.position) * 1e3, math.degrees(off.orientation.angle_to(Pose().orientation))


# ------------------------------------------------------------------------------------------------ metrics
def measure(
    make: Callable[[np.random.Generator, Plate], View], pictures: int, limit: float, options: PoseOptions, factor: float
) -> ErrorStatistics:
    """Compute camera poses from JPEG files; an error of more than `limit` mm is a wrong verdict."""
    tally = ErrorStatistics()
    for index in range(pictures):
        random = np.random.default_rng([SEED, index])
        if index % 20 == 0:
            background = rendering.table(random)
        view = make(random, background)
        done, data = cv2.imencode(".jpg", picture_of(view, random), [cv2.IMWRITE_JPEG_QUALITY, 95])
        assert done
        file, parameters = data.tobytes(), inaccurate_intrinsics(random, factor)
        seconds, result = _timed(file, parameters, view.layout, options)
        tally.seconds.append(seconds)
        tally.opencv.append(_timed_opencv(file))
        if isinstance(result, CalibrationRefused):
            tally.refused.append(result.reason.value)
            continue
        position, orientation = errors_of(result.pose, view.world_from_camera)
        tally.position.append(position)
        tally.orientation.append(orientation)
        known = 1e3 * math.sqrt(sum(result.covariance[axis][axis] for axis in range(3)))
        tally.wrong += position > limit or position > MAX_DEVIATIONS * known
    return tally


def _timed(
    file: bytes, parameters: CameraParameters, layout: Layout, options: PoseOptions
) -> tuple[float, CameraPose | CalibrationRefused]:
    """Solve a picture `CALLS` times; return the shortest time, s, and the result or refusal."""
    best = math.inf
    result: CameraPose | CalibrationRefused | None = None
    for _ in range(CALLS):
        began = time.perf_counter()
        try:
            result = find_camera_pose([file], parameters, layout, options)
        except CalibrationRefused as refused:
            result = refused
        best = min(best, time.perf_counter() - began)
    assert result is not None
    return best, result


def _timed_opencv(file: bytes) -> float:
    """Decode a picture and detect its markers with OpenCV alone, `CALLS` times; return the shortest time, s."""
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    best = math.inf
    for _ in range(CALLS):
        began = time.perf_counter()
        image = cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_GRAYSCALE)
        assert image is not None
        detector.detectMarkers(image)
        best = min(best, time.perf_counter() - began)
    return best


async def run(report: Report, long: bool) -> None:
    """Measure camera poses on 200 pictures of each kind, or on 2,000 if `long`."""
    pictures = LONG if long else PICTURES
    sys.stderr.write(f"calibration: seed {SEED}, {pictures} pictures of each kind\n")
    options = PoseOptions(focal_deviation=FOCAL, centre_deviation=CENTRE, distortion_deviation=DISTORTION)
    kinds: list[tuple[str, Callable[[np.random.Generator, Plate], View], float]] = [
        ("three", lambda random, table: markers_view(random, 3, table), 3.0),
        ("one", lambda random, table: markers_view(random, 1, table), 10.0),
        ("board", board_view, 10.0),
    ]
    for name, make, limit in kinds:
        tally = measure(make, pictures, limit, options, 1.0)
        prefix, count = f"camera_pose_{name}", len(tally.position)
        report.add(Metric(f"{prefix}_mm", median(tally.position), count, tally.note()))
        report.add(
            Metric(f"{prefix}_p99_mm", percentile(tally.position, 99), count, f"worst {max(tally.position):.2f}")
        )
        far = f"99th percentile {percentile(tally.orientation, 99):.3f}"
        report.add(Metric(f"{prefix}_deg", median(tally.orientation), count, far))
        slow = f"99th percentile {percentile(tally.seconds, 99) * 1e3:.1f}; including the decoding of the JPEG file"
        report.add(Metric(f"{prefix}_ms", median(tally.seconds) * 1e3, len(tally.seconds), slow))
        if name == "three":
            ratios = [ours / theirs for ours, theirs in zip(tally.seconds, tally.opencv, strict=True)]
            report.add(Metric(f"{prefix}_per_opencv", median(ratios), len(ratios)))
        report.add(Metric(f"{prefix}_wrong", 100 * tally.wrong / pictures, pictures))
        report.add(Metric(f"{prefix}_refused", 100 * len(tally.refused) / pictures, pictures))
