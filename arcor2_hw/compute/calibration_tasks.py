"""What the calibration worker is asked. Imports no numerics: the server knows it."""

from typing import ClassVar

from msgspec import field

from arcor2_hw.calibration.camera_results import (
    CameraPose,
    HandEye,
    HandEyeOptions,
    HandEyeSample,
    Intrinsics,
    IntrinsicsOptions,
    Mounting,
    PoseOptions,
)
from arcor2_hw.calibration.layout import CharucoBoard, Layout, MarkerDictionary
from arcor2_hw.calibration.results import RobotPose, TouchedFrame, TouchedOrientation, TouchedTip
from arcor2_hw.collision.description import RobotSource
from arcor2_hw.compute.task import Room, Task
from arcor2_hw.data.camera import CameraParameters, MarkerCorners
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint

_JOBS = "arcor2_hw.compute.calibrating"


class FindCameraPose(Task[CameraPose], frozen=True):
    """Where a camera stands, from pictures of markers and boards."""

    gives: ClassVar = CameraPose
    runs: ClassVar = f"{_JOBS}:camera_pose"
    room: ClassVar = Room.CALIBRATION
    what: ClassVar = "the pose of a camera"

    pictures: list[bytes]
    parameters: CameraParameters
    layout: Layout
    options: PoseOptions = PoseOptions()


class DrawCameraPose(Task[bytes], frozen=True):
    """Where the markers should be with a camera's pose, drawn onto the picture: PNG."""

    gives: ClassVar = bytes
    runs: ClassVar = f"{_JOBS}:drawn_camera_pose"
    room: ClassVar = Room.CALIBRATION
    what: ClassVar = "the picture of a camera's pose"

    picture: bytes
    parameters: CameraParameters
    layout: Layout
    result: CameraPose


class FindMarkers(Task[list[MarkerCorners]], frozen=True):
    """The corners of the markers in a picture."""

    gives: ClassVar = list[MarkerCorners]
    runs: ClassVar = f"{_JOBS}:marker_corners"
    room: ClassVar = Room.CALIBRATION
    what: ClassVar = "the corners of markers"

    picture: bytes
    parameters: CameraParameters
    dictionary: MarkerDictionary = "4x4_50"


class FindRobotPose(Task[RobotPose], frozen=True):
    """Where a robot stands, from depth pictures (PNG, 16 bit, mm). robot.base: where it is assumed to stand.

    within (m), angle_within (rad): by how much that may be off.
    """

    gives: ClassVar = RobotPose
    runs: ClassVar = "arcor2_hw.compute.robots:robot_pose"
    room: ClassVar = Room.CALIBRATION
    within: ClassVar = 60.0
    what: ClassVar = "the pose of a robot"

    robot: RobotSource
    joints: list[Joint]
    depth: list[bytes]
    parameters: CameraParameters
    camera_pose: Pose
    distance: float = 0.08
    angle: float = 0.14


class FindHandEye(Task[HandEye], frozen=True):
    """Where a camera sits on a robot's flange, or beside the robot."""

    gives: ClassVar = HandEye
    runs: ClassVar = f"{_JOBS}:hand_eye"
    room: ClassVar = Room.CALIBRATION
    within: ClassVar = 120.0
    what: ClassVar = "a hand-eye calibration"

    samples: list[HandEyeSample]
    parameters: CameraParameters
    target: Layout
    mounting: Mounting
    options: HandEyeOptions = HandEyeOptions()


class FindIntrinsics(Task[Intrinsics], frozen=True):
    """A camera's intrinsics, from pictures of a ChArUco board."""

    gives: ClassVar = Intrinsics
    runs: ClassVar = f"{_JOBS}:intrinsics"
    room: ClassVar = Room.CALIBRATION
    within: ClassVar = 120.0
    what: ClassVar = "the intrinsics of a camera"

    pictures: list[bytes]
    board: CharucoBoard
    options: IntrinsicsOptions = IntrinsicsOptions()


# ------------------------------------------------------------------------------------------------ by touch
class FrameByAxes(Task[TouchedFrame], frozen=True):
    """A frame from its origin, a point on +x, and points in its xy plane on the side of +y."""

    gives: ClassVar = TouchedFrame
    runs: ClassVar = f"{_JOBS}:frame_by_axes"
    room: ClassVar = Room.CALIBRATION
    what: ClassVar = "a frame by touch"

    origin: Position
    on_x: Position
    in_plane: list[Position]


class FrameByPoints(Task[TouchedFrame], frozen=True):
    """A frame in which points are known, from where they were touched, in the same order."""

    gives: ClassVar = TouchedFrame
    runs: ClassVar = f"{_JOBS}:frame_by_points"
    room: ClassVar = Room.CALIBRATION
    what: ClassVar = "a frame by touch"

    known: list[Position]
    touched: list[Position]


class TipByTouches(Task[TouchedTip], frozen=True):
    """The tip of a tool, from poses of the flange with the tip on one point."""

    gives: ClassVar = TouchedTip
    runs: ClassVar = f"{_JOBS}:tip_by_touches"
    room: ClassVar = Room.CALIBRATION
    what: ClassVar = "the tip of a tool"

    flange: list[Pose]


class OrientationByAlignment(Task[TouchedOrientation], frozen=True):
    """A tool's orientation, from orientations of the flange with the tool's axes along a reference's."""

    gives: ClassVar = TouchedOrientation
    runs: ClassVar = f"{_JOBS}:orientation_by_alignment"
    room: ClassVar = Room.CALIBRATION
    what: ClassVar = "the orientation of a tool"

    flange: list[Orientation]
    reference: Orientation = field(default_factory=Orientation)


class OrientationByPoints(Task[TouchedOrientation], frozen=True):
    """A tool's orientation, from moving its tip along its +z and to its +x side."""

    gives: ClassVar = TouchedOrientation
    runs: ClassVar = f"{_JOBS}:orientation_by_points"
    room: ClassVar = Room.CALIBRATION
    what: ClassVar = "the orientation of a tool"

    flange: Orientation
    tip: Position
    along_z: Position
    on_x: Position


CalibrationTask = (
    FindCameraPose
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
