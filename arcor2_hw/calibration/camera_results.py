"""Options and results of calibrations by images: camera pose, hand-eye, intrinsics. Imports no numerics.

Lengths are in m, angles in rad, image errors in px. The centre of a pixel has integer coordinates.
"""

import enum
from typing import Literal

from arcor2_hw.calibration.results import Grade
from arcor2_hw.data.base import UNSET, Data, TranslatableData, Unset
from arcor2_hw.data.camera import CameraParameters, EstimatedPose
from arcor2_hw.data.geometry import Pose, Position

# ------------------------------------------------------------------------------------------------ camera pose
PoseMethod = Literal["joint", "averaged"]


class PoseOptions(Data, frozen=True):
    """Options for computing the pose of a camera, and limits for refusing the result.

    Attributes:
        method: `joint` solves the corners of all markers in all images as one problem; `averaged` averages one pose per
            marker, weighted by distance and angle.
        blur_threshold: Minimum variance of the Laplacian of the image at 640 × 480. An image below it is refused unless
            the edges of the markers are sharp.
        largest_blur: Width (standard deviation) of the edges of markers above which an image is refused, px.
        min_distance: Distance up to which a marker has full weight, m.
        max_distance: Distance above which a marker has no weight, m.
        largest_deviation: Maximum standard deviation of the position (largest axis), m.
        largest_residual: Residual of a marker above which it is not at its configured place, px.
        focal_deviation: Standard deviation of fx and fy as a fraction.
        centre_deviation: Standard deviation of cx and cy, px.
        distortion_deviation: Standard deviation of each distortion coefficient as a fraction.
        expected: Approximate pose of the camera in the frame of the origin.
        expected_position: Standard deviation of its position, m.
        expected_orientation: Standard deviation of its orientation, rad.
        gravity: Direction of gravity in the camera's frame, of any length, from an accelerometer. The origin's z is
            then taken as vertical.
        gravity_deviation: Standard deviation of that direction, rad.
        lowest: Minimum z of the camera in the frame of the origin, m; 0 for a camera above the table.
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
    """Error of one marker or board with respect to the pose.

    Attributes:
        name: `marker 3` or `board 1`.
        picture: Index of the image.
        corners: Number of measured corners.
        residual: Root mean square distance of a corner from its expected place, px.
        largest: Largest such distance, px.
        distance: Distance from the camera, m.
        angle: Angle between the marker's normal and the line to the camera, rad.
        used: Whether it was used; false when it is not at its configured place.
    """

    name: str
    picture: int
    corners: int
    residual: float
    largest: float
    distance: float
    angle: float
    used: bool = True


class LensState(enum.StrEnum):
    """Whether the markers of a view agree with the lens."""

    CONFIRMED = "confirmed"
    """The focal length fits the markers."""
    UNCHECKED = "unchecked"
    """The view does not determine the focal length."""
    CONTRADICTED = "contradicted"
    """Another focal length fits the markers better."""


class LensCheck(TranslatableData, frozen=True):
    """Comparison of a lens with the markers of a view.

    Attributes:
        factor: Focal length that fits the markers best, as a multiple of the given one.
        deviation: Standard deviation of `factor`.
        misfit: Ratio of the residuals to the measured noise of corners, about 1 when everything fits.
        misfit_with_factor: The same with the focal length that fits best.
        parameters: The given intrinsics with the focal length that fits best.
        verdict: One or two sentences for the technician.
    """

    state: LensState
    factor: float
    deviation: float
    misfit: float
    misfit_with_factor: float
    parameters: CameraParameters
    verdict: str


class CameraPose(TranslatableData, frozen=True):
    """The pose of a camera with its uncertainty.

    Attributes:
        pose: Pose of the camera in the frame of the origin.
        quality: Mean weight of all configured markers and boards, 0 to 1 (protocol).
        residual: Root mean square error of the corners, px.
        covariance: 6 × 6, of a small displacement (x, y, z in m) and rotation (rotation vector in rad, applied after
            the pose), both in the frame of the origin.
        position_deviation: Standard deviation along the worst axis, m.
        orientation_deviation: Standard deviation about the worst axis, rad.
        blur: Standard deviation of edges, px; 0 where it could not be measured.
        parameters: Intrinsics that explain the image best within their standard deviations.
        lens: Comparison of the lens with the markers.
        verdict: A few sentences for the operator.
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
    lens: LensCheck | Unset = UNSET

    def estimated(self, *, inverse: bool = False) -> EstimatedPose:
        """Return the result in the form of the protocol. `inverse`: pose of the origin in the camera's frame."""
        return EstimatedPose(self.pose.inverted() if inverse else self.pose, self.quality)


# ------------------------------------------------------------------------------------------------ hand-eye
Mounting = Literal["eye_in_hand", "eye_to_hand"]


class HandEyeSample(Data, frozen=True):
    """One image of the target, and the pose of the robot's flange in the robot's base frame when it was taken."""

    flange: Pose
    picture: bytes


class HandEyeOptions(Data, frozen=True):
    """Limits for refusing a hand-eye calibration. See PoseOptions for options not listed here.

    Attributes:
        smallest_turn: Minimum rotation between two stations that counts, rad.
        smallest_spread: Minimum angle between the axes of two such rotations, rad.
        largest_residual: Maximum root mean square error over all corners, px.
        largest_deviation: Maximum standard deviation of the position, m.
        robot_position: Expected standard deviation of flange positions, m, used as a weight.
        robot_orientation: Expected standard deviation of flange orientations, rad, used as a weight.
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
    """The result of one method, and the scatter of the target's pose with it: rotation (rad), translation (m)."""

    name: str
    pose: Pose
    rotation: float
    translation: float


class HandEyeError(TranslatableData, frozen=True):
    """Error of one sample.

    Attributes:
        residual: Root mean square error of the corners, px.
        largest: Largest error of a corner, px.
        used: Whether it was used.
        problem: Reason why it was not used. `key` and `values` translate it.
    """

    sample: int
    corners: int
    residual: float
    largest: float
    used: bool = True
    problem: str = ""


class HandEye(TranslatableData, frozen=True):
    """The pose of a camera on the flange (eye_in_hand), or in the robot's base frame (eye_to_hand).

    `key` and `values` translate the verdict.

    Attributes:
        target: Pose of the target in the base frame (eye_in_hand) or on the flange (eye_to_hand).
        methods: Results of closed-form methods, for comparison. `pose` is the best of them, refined by reprojection.
        covariance: As in CameraPose, in the frame of the flange or base.
        picture: PNG file with the errors of all corners.
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
    """Options for computing intrinsics, and limits for refusing them.

    Attributes:
        coefficients: Number of distortion coefficients: 4 (k1, k2, p1, p2), 5 (and k3), 8 (rational), 12 (and thin
            prism).
        fewest_views: Minimum number of images with at least six corners.
        smallest_tilt: Minimum angle between the directions of some views, rad.
        smallest_coverage: Minimum fraction of the image, in 8 × 6 fields, that has corners.
        largest_residual: Maximum root mean square error, px.
    """

    coefficients: Literal[4, 5, 8, 12] = 5
    fewest_views: int = 6
    smallest_tilt: float = 0.25
    smallest_coverage: float = 0.4
    largest_residual: float = 1.0
    blur_threshold: float = 150.0


class ViewError(TranslatableData, frozen=True):
    """Error of one image.

    Attributes:
        residual: Root mean square error of the corners, px.
        largest: Largest error of a corner, px.
        used: Whether it was used.
        problem: Reason why it was not used. `key` and `values` translate it.
    """

    view: int
    corners: int
    residual: float
    largest: float
    used: bool = True
    problem: str = ""


class Intrinsics(TranslatableData, frozen=True):
    """The intrinsics of a camera for images of width × height. `key` and `values` translate the verdict.

    Attributes:
        deviations: Standard deviations of fx, fy, cx, cy, px.
        focal_deviation: The same, as PoseOptions needs it.
        centre_deviation: The same, as PoseOptions needs it.
        coverage: Fraction of the image that has corners.
        picture: PNG file with all corners and their errors.
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
