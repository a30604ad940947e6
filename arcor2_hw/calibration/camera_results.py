"""Options and results of calibrations by pictures: camera pose, hand-eye, intrinsics. Imports no numerics: they travel.

Lengths in m, angles in rad, errors of pictures in pixels; the middle of a pixel has whole coordinates.
"""

from typing import Literal

from arcor2_hw.calibration.results import Grade
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.camera import CameraParameters, EstimatedPose
from arcor2_hw.data.geometry import Pose, Position

# ------------------------------------------------------------------------------------------------ camera pose
PoseMethod = Literal["joint", "averaged"]


class PoseOptions(Data, frozen=True):
    """How a camera's pose is computed, and when the result is refused.

    method: `joint` solves the corners of all markers in all pictures as one problem; `averaged` averages one pose per
    marker with distance and angle as weights.
    blur_threshold: least variance of the Laplacian of the picture at 640 × 480; a picture below it is refused unless
    the markers' edges are sharp. largest_blur: px, width (standard deviation) of a marker's edge from which on the
    picture is refused.
    min_distance, max_distance: m, at which a marker's weight by distance is 1 and 0.
    largest_deviation: m, standard deviation of the position (largest axis) from which on a pose is refused.
    largest_residual: px, of a marker; what lies beyond does not stand where it is said to.
    focal_deviation, centre_deviation, distortion_deviation: how well the intrinsics are known: fx and fy as a part of
    themselves, cx and cy in px, each coefficient as a part of itself (standard deviations).
    expected: where the camera is roughly known to be, in the origin's frame, with its standard deviations
    expected_position (m) and expected_orientation (rad).
    gravity: direction of gravity in the camera's frame, of an accelerometer, of any length; the origin's z is then
    taken to be vertical. gravity_deviation: rad.
    lowest: m, the least z that the camera can have in the origin's frame: 0 for one that hangs above the table.
    """

    method: PoseMethod = "joint"
    blur_threshold: float = 150.0
    largest_blur: float = 2.5
    min_distance: float = 0.3
    max_distance: float = 2.0
    largest_deviation: float = 0.004
    largest_residual: float = 3.0
    focal_deviation: float = 0.0005
    centre_deviation: float = 0.5
    distortion_deviation: float = 0.02
    expected: Pose | Unset = UNSET
    expected_position: float = 0.05
    expected_orientation: float = 0.1
    gravity: Position | Unset = UNSET
    gravity_deviation: float = 0.01
    lowest: float | Unset = UNSET


class MarkerError(Data, frozen=True):
    """How well one marker, or one board, fits the pose that was found.

    name: `marker 3`, `board 1`. picture: index of the picture. corners: how many were measured. residual, largest: px,
    root mean square and largest distance of a corner from where it should be. distance: from the camera, m. angle:
    between the marker's normal and the line to the camera, rad. used: false when it does not stand where it is said to.
    """

    name: str
    picture: int
    corners: int
    residual: float
    largest: float
    distance: float
    angle: float
    used: bool = True


class CameraPose(Data, frozen=True):
    """Where a camera stands, and how well that is known.

    pose: of the camera in the origin's frame. quality: 0..1 as the protocol has it, the mean weight of all configured
    markers and boards. residual: px, root mean square. covariance: 6 × 6, of a small displacement (x, y, z in m) and
    rotation (rotation vector in rad, turned after the pose), both in the origin's frame. position_deviation: m,
    standard deviation along its worst axis. orientation_deviation: rad, likewise. blur: px, standard deviation of the
    edges, 0 where it could not be measured. parameters: the intrinsics with which the pose explains the picture; they
    differ from the given ones by as much as the picture shows them to be off, within what is known of them. verdict:
    one sentence or two for the operator.
    """

    pose: Pose
    quality: float
    residual: float
    markers: list[MarkerError]
    covariance: list[list[float]]
    position_deviation: float
    orientation_deviation: float
    blur: float
    method: PoseMethod
    pictures: int
    grade: Grade
    verdict: str
    parameters: CameraParameters | Unset = UNSET

    def estimated(self, *, inverse: bool = False) -> EstimatedPose:
        """Give it as the protocol has it; with `inverse`, the pose of the origin in the camera's frame."""
        return EstimatedPose(self.pose.inverted() if inverse else self.pose, self.quality)


# ------------------------------------------------------------------------------------------------ hand-eye
Mounting = Literal["eye_in_hand", "eye_to_hand"]


class HandEyeSample(Data, frozen=True):
    """One picture of the target and where the robot's flange was meanwhile, in the robot's base frame."""

    flange: Pose
    picture: bytes


class HandEyeOptions(Data, frozen=True):
    """When a hand-eye calibration is refused.

    smallest_turn: rad, the rotation between two stations that counts as one. smallest_spread: rad, between the axes of
    two such rotations. largest_residual: px, root mean square over all. largest_deviation: m. See PoseOptions for the
    others. robot_position (m), robot_orientation (rad): how exact the flange's poses are, for the weights; how large
    the errors really are is seen in the pictures.
    """

    smallest_turn: float = 0.15
    smallest_spread: float = 0.26
    largest_residual: float = 2.0
    largest_deviation: float = 0.003
    robot_position: float = 0.0005
    robot_orientation: float = 0.0005
    blur_threshold: float = 150.0
    largest_blur: float = 2.5


class HandEyeMethod(Data, frozen=True):
    """What one method gave. rotation (rad) and translation (m): how far the target's pose scatters with it (r.m.s.)."""

    name: str
    pose: Pose
    rotation: float
    translation: float


class HandEyeError(Data, frozen=True):
    """How well one sample fits. residual, largest: px. used: false with `problem` said when it was left out."""

    sample: int
    corners: int
    residual: float
    largest: float
    used: bool = True
    problem: str = ""


class HandEye(Data, frozen=True):
    """Where a camera sits on the flange (eye_in_hand), or in the robot's base frame (eye_to_hand).

    target: pose of the target in the base frame (eye_in_hand) or on the flange (eye_to_hand). methods: what the closed
    forms gave, for comparison; `pose` is refined from the best of them by the reprojection of all corners. covariance:
    as in CameraPose, in the flange's or base frame. picture: PNG, the errors of all corners.
    """

    mounting: Mounting
    pose: Pose
    target: Pose
    residual: float
    samples: list[HandEyeError]
    methods: list[HandEyeMethod]
    covariance: list[list[float]]
    position_deviation: float
    orientation_deviation: float
    grade: Grade
    verdict: str
    picture: bytes


# ------------------------------------------------------------------------------------------------ intrinsics
class IntrinsicsOptions(Data, frozen=True):
    """How intrinsics are computed, and when they are refused.

    coefficients: of the lens model: 4 (k1, k2, p1, p2), 5 (and k3), 8 (rational) or 12 (and thin prism).
    fewest_views: with at least six corners each. smallest_tilt: rad, by which some views must differ in direction.
    smallest_coverage: part of the picture (of 8 × 6 fields) in which there were corners. largest_residual: px, r.m.s.
    """

    coefficients: Literal[4, 5, 8, 12] = 5
    fewest_views: int = 6
    smallest_tilt: float = 0.25
    smallest_coverage: float = 0.4
    largest_residual: float = 1.0
    blur_threshold: float = 150.0


class ViewError(Data, frozen=True):
    """How well one picture fits. residual, largest: px. used: false with `problem` said when it was left out."""

    view: int
    corners: int
    residual: float
    largest: float
    used: bool = True
    problem: str = ""


class Intrinsics(Data, frozen=True):
    """A camera's intrinsics for pictures of width × height.

    deviations: standard deviations of fx, fy, cx, cy (px). focal_deviation, centre_deviation: the same as PoseOptions
    wants them. coverage: part of the picture in which there were corners. picture: PNG, where the corners were and
    their errors.
    """

    parameters: CameraParameters
    width: int
    height: int
    residual: float
    deviations: list[float]
    focal_deviation: float
    centre_deviation: float
    coverage: float
    views: list[ViewError]
    grade: Grade
    verdict: str
    picture: bytes
