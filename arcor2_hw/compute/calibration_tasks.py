"""Tasks of the calibration worker. Imports no numerics, so that the server can use it."""

from collections.abc import Sequence
from typing import ClassVar, Generic

from msgspec import field

from arcor2_hw.calibration.camera_results import (
    CameraPose,
    HandEye,
    HandEyeOptions,
    HandEyeSample,
    Intrinsics,
    IntrinsicsOptions,
    LensCheck,
    Mounting,
    PoseOptions,
)
from arcor2_hw.calibration.layout import CharucoBoard, Layout, MarkerDictionary
from arcor2_hw.calibration.results import RobotPose, TouchedFrame, TouchedOrientation, TouchedTip
from arcor2_hw.collision.description import RobotSource
from arcor2_hw.compute.task import R, Task, WorkerKind
from arcor2_hw.data.base import Data
from arcor2_hw.data.camera import CameraParameters, MarkerCorners
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message

_FUNCTIONS = "arcor2_hw.compute.calibration_functions"


class _MarkerView(Task[R], Generic[R], frozen=True):
    """A task on images of markers and boards, taken by a camera from one pose."""

    worker: ClassVar = WorkerKind.CALIBRATION

    pictures: list[bytes]
    parameters: CameraParameters
    layout: Layout
    options: PoseOptions = PoseOptions()


class FindCameraPose(_MarkerView[CameraPose], frozen=True):
    """Find the pose of a camera from images of markers and boards."""

    result_type: ClassVar = CameraPose
    function: ClassVar = f"{_FUNCTIONS}:camera_pose"
    label: ClassVar = Message.of("the pose of a camera")


class CheckLens(_MarkerView[LensCheck], frozen=True):
    """Check the focal length of a camera by images of markers of known pose."""

    result_type: ClassVar = LensCheck
    function: ClassVar = f"{_FUNCTIONS}:lens_check"
    label: ClassVar = Message.of("the check of a lens")


class DrawCameraPose(Task[bytes], frozen=True):
    """Draw the expected markers for a camera pose onto an image; the result is a PNG file."""

    result_type: ClassVar = bytes
    function: ClassVar = f"{_FUNCTIONS}:drawn_camera_pose"
    worker: ClassVar = WorkerKind.CALIBRATION
    label: ClassVar = Message.of("the image of a camera's pose")

    picture: bytes
    parameters: CameraParameters
    layout: Layout
    result: CameraPose


class FindMarkers(Task[list[MarkerCorners]], frozen=True):
    """Find the corners of the markers in an image."""

    result_type: ClassVar = list[MarkerCorners]
    function: ClassVar = f"{_FUNCTIONS}:marker_corners"
    worker: ClassVar = WorkerKind.CALIBRATION
    label: ClassVar = Message.of("the corners of markers")

    picture: bytes
    parameters: CameraParameters
    dictionary: MarkerDictionary = "4x4_50"


class RobotState(Data, frozen=True):
    """Joint values of a robot, and depth images (PNG, 16 bit, mm) with these values."""

    joints: list[Joint]
    depth: list[bytes]


def states_of(joints: Sequence[list[Joint]], depth: Sequence[bytes]) -> list[RobotState]:
    """Return joint states, each with an equal part of the depth images in their order.

    Raises:
        InvalidData: The images cannot be divided equally.
    """
    share, rest = divmod(len(depth), len(joints))
    if rest or not share:
        raise InvalidData(
            "{count} joint states need an equal number of depth images each, not {images} in total.",
            count=len(joints),
            images=len(depth),
        )
    return [RobotState(each, list(depth[i * share : (i + 1) * share])) for i, each in enumerate(joints)]


class FindRobotPose(Task[RobotPose], frozen=True):
    """Find the pose of a robot from depth images.

    Attributes:
        robot: Model of the robot; its base is the assumed pose.
        joints: Joint values in the images.
        depth: Depth images, PNG, 16 bit, mm.
        parameters: Camera parameters.
        camera_pose: Pose of the camera in the world.
        distance: Maximum position error of the assumed pose, m.
        angle: Maximum orientation error of the assumed pose, rad.
        other_states: Further joint states, which check the joints and the model.
    """

    result_type: ClassVar = RobotPose
    function: ClassVar = "arcor2_hw.compute.calibration_functions:robot_pose"
    worker: ClassVar = WorkerKind.CALIBRATION
    timeout: ClassVar = 180.0
    label: ClassVar = Message.of("the pose of a robot")

    robot: RobotSource
    joints: list[Joint]
    depth: list[bytes]
    parameters: CameraParameters
    camera_pose: Pose
    distance: float = 0.08
    angle: float = 0.14
    other_states: list[RobotState] = field(default_factory=list)


class FindHandEye(Task[HandEye], frozen=True):
    """Find the pose of a camera on a robot's flange, or next to the robot."""

    result_type: ClassVar = HandEye
    function: ClassVar = f"{_FUNCTIONS}:hand_eye"
    worker: ClassVar = WorkerKind.CALIBRATION
    timeout: ClassVar = 120.0
    label: ClassVar = Message.of("a hand-eye calibration")

    samples: list[HandEyeSample]
    parameters: CameraParameters
    target: Layout
    mounting: Mounting
    options: HandEyeOptions = HandEyeOptions()


class FindIntrinsics(Task[Intrinsics], frozen=True):
    """Find the intrinsic parameters of a camera from images of a ChArUco board."""

    result_type: ClassVar = Intrinsics
    function: ClassVar = f"{_FUNCTIONS}:intrinsics"
    worker: ClassVar = WorkerKind.CALIBRATION
    timeout: ClassVar = 120.0
    label: ClassVar = Message.of("the intrinsics of a camera")

    pictures: list[bytes]
    board: CharucoBoard
    options: IntrinsicsOptions = IntrinsicsOptions()


# ------------------------------------------------------------------------------------------------ by touch
class FrameByAxes(Task[TouchedFrame], frozen=True):
    """Compute a frame from its origin, a point on +x, and points in the xy plane on the side of +y."""

    result_type: ClassVar = TouchedFrame
    function: ClassVar = f"{_FUNCTIONS}:frame_by_axes"
    worker: ClassVar = WorkerKind.CALIBRATION
    label: ClassVar = Message.of("a frame by touch")

    origin: Position
    on_x: Position
    in_plane: list[Position]


class FrameByPoints(Task[TouchedFrame], frozen=True):
    """Compute a frame from points known in it and the same points as touched, in the same order."""

    result_type: ClassVar = TouchedFrame
    function: ClassVar = f"{_FUNCTIONS}:frame_by_points"
    worker: ClassVar = WorkerKind.CALIBRATION
    label: ClassVar = Message.of("a frame by touch")

    known: list[Position]
    touched: list[Position]


class TipByTouches(Task[TouchedTip], frozen=True):
    """Compute the tip of a tool from flange poses with the tip on one point."""

    result_type: ClassVar = TouchedTip
    function: ClassVar = f"{_FUNCTIONS}:tip_by_touches"
    worker: ClassVar = WorkerKind.CALIBRATION
    label: ClassVar = Message.of("the tip of a tool")

    flange: list[Pose]


class OrientationByAlignment(Task[TouchedOrientation], frozen=True):
    """Compute the orientation of a tool from flange orientations with the tool aligned with a reference frame."""

    result_type: ClassVar = TouchedOrientation
    function: ClassVar = f"{_FUNCTIONS}:orientation_by_alignment"
    worker: ClassVar = WorkerKind.CALIBRATION
    label: ClassVar = Message.of("the orientation of a tool")

    flange: list[Orientation]
    reference: Orientation = field(default_factory=Orientation)


class OrientationByPoints(Task[TouchedOrientation], frozen=True):
    """Compute the orientation of a tool from motions of its tip along +z and to its +x side."""

    result_type: ClassVar = TouchedOrientation
    function: ClassVar = f"{_FUNCTIONS}:orientation_by_points"
    worker: ClassVar = WorkerKind.CALIBRATION
    label: ClassVar = Message.of("the orientation of a tool")

    flange: Orientation
    tip: Position
    along_z: Position
    on_x: Position


CalibrationTask = (
    FindCameraPose
    | CheckLens
    | DrawCameraPose
    | FindMarkers
    | FindHandEye
    | FindRobotPose
    | FindIntrinsics
    | FrameByAxes
    | FrameByPoints
    | TipByTouches
    | OrientationByAlignment
    | OrientationByPoints
)
