"""What computes poses from pictures: the one interface to the calibration service, and what is running of it."""

from typing import Final, Protocol

from arcor2_hw.data.base import Data
from arcor2_hw.data.camera import CameraParameters, EstimatedPose, MarkerCorners
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.rpc.registry import RequestRefused


class CalibrationUnavailable(Arcor2Error):
    """Nothing computes calibrations at this server."""

    code = "calibration_unavailable"


class RobotView(Data, frozen=True):
    """A robot as a camera of known pose sees it. robot_pose: where it is taken to stand. urdf: its package's file."""

    robot_joints: list[Joint]
    robot_pose: Pose
    camera_pose: Pose
    camera_parameters: CameraParameters
    urdf_uri: str


class Calibration(Protocol):
    """Computes poses from the files of pictures. Raises Arcor2Error: no marker seen, no picture, no service."""

    async def camera_pose(self, parameters: CameraParameters, image: bytes, *, inverse: bool = False) -> EstimatedPose:
        """Give the pose of the camera in the origin frame; with `inverse`, of the origin in the camera's frame."""

    async def marker_corners(self, parameters: CameraParameters, image: bytes) -> list[MarkerCorners]:
        """Give the corners of every marker in the picture."""

    async def robot_pose(self, view: RobotView, depth: bytes) -> Pose:
        """Give the pose of a robot in the world from a depth picture (16 bit, mm)."""


_UNAVAILABLE: Final = "No calibration service is there: poses cannot be computed from pictures."


class NoCalibration:
    """Stands where no calibration service is."""

    async def camera_pose(self, *_: object, **__: object) -> EstimatedPose:
        """Raise CalibrationUnavailable."""
        raise CalibrationUnavailable(_UNAVAILABLE)

    async def marker_corners(self, *_: object) -> list[MarkerCorners]:
        """Raise CalibrationUnavailable."""
        raise CalibrationUnavailable(_UNAVAILABLE)

    async def robot_pose(self, *_: object) -> Pose:
        """Raise CalibrationUnavailable."""
        raise CalibrationUnavailable(_UNAVAILABLE)


class RunningCalibrations:
    """The cameras and robots that are being calibrated, each at most once at a time."""

    def __init__(self) -> None:
        self._objects: set[str] = set()

    def begin(self, object_id: str, name: str) -> None:
        """Count an object as being calibrated; RequestRefused while it is already."""
        if object_id in self._objects:
            raise RequestRefused(f"{name} is being calibrated already.")
        self._objects.add(object_id)

    def end(self, object_id: str) -> None:
        """Count an object no longer."""
        self._objects.discard(object_id)
