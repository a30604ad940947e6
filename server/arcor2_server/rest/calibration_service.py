"""The Calibration service over REST (protocol, section 15)."""

import asyncio
from dataclasses import dataclass
from typing import Final, TypeVar

import msgspec

from arcor2_hw.data.base import Data
from arcor2_hw.data.camera import CameraParameters, EstimatedPose, MarkerCorners
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.role import Role
from arcor2_hw.data.texts import check_texts
from arcor2_hw.exceptions import InvalidData
from arcor2_server.rest.field_names import camelized_names, snaked
from arcor2_server.rest.operations import MIB, Upload, operation
from arcor2_server.workspace.calibration import Calibration, RobotView
from arcor2_server.workspace.robots import SceneRobots

T = TypeVar("T")
CALIBRATION = "Calibration"
MAX_IMAGE: Final = 64 * MIB
"""Maximum size of a picture file, bytes."""
COEFFICIENTS: Final = (4, 5, 8, 12)
"""Possible numbers of distortion coefficients."""


class CameraQuery(Data, frozen=True, rename="camel"):
    """Focal lengths and principal point, pixels, and distortion coefficients."""

    fx: float
    fy: float
    cx: float
    cy: float
    dist_coefs: list[float]

    def parameters(self) -> CameraParameters:
        """Return the parameters as CameraParameters. Raise InvalidData for a wrong number of coefficients."""
        if len(self.dist_coefs) not in COEFFICIENTS:
            raise InvalidData("distCoefs needs 4, 5, 8 or 12 numbers, not {count}.", count=len(self.dist_coefs))
        return CameraParameters(self.fx, self.fy, self.cx, self.cy, list(self.dist_coefs))


class CameraPoseQuery(CameraQuery, frozen=True, rename="camel"):
    """Camera parameters, and whether to return the pose of the world in the camera frame instead."""

    inverse: bool = False


class CalibrateRobotArgs(Data, frozen=True):
    """A robot seen by a camera with a known pose. robot_pose: assumed pose of the robot. urdf_uri: names an asset."""

    robot_joints: list[Joint]
    robot_pose: Pose
    camera_pose: Pose
    camera_parameters: CameraParameters
    urdf_uri: str


def read_args(text: str, kind: type[T]) -> T:
    """Decode the part `args` of a multipart body, JSON with names in camelCase or snake_case.

    Raises:
        InvalidData: the text is not JSON of this type.
    """
    try:
        args = msgspec.convert(snaked(msgspec.json.decode(text)), kind)
    except (msgspec.DecodeError, RecursionError) as error:
        raise InvalidData("The part args is wrong: {reason}.", reason=camelized_names(str(error))) from None
    check_texts(args)
    return args


@dataclass(frozen=True, slots=True)
class CalibrationServiceOperations:
    """The Calibration service of ARCOR2 over REST (protocol, section 15)."""

    _calibration: Calibration
    _robots: SceneRobots

    @operation("PUT", "/calibrate/camera", CALIBRATION, Role.TECHNICIAN, file="image", limit=MAX_IMAGE)
    async def calibrate_camera(self, query: CameraPoseQuery, upload: Upload) -> EstimatedPose:
        """Return the pose of a camera from the configured markers in its picture."""
        parameters = query.parameters()
        image = await asyncio.to_thread(upload.file.read)
        return (await self._calibration.camera(parameters, [image])).estimated(inverse=query.inverse)

    @operation("PUT", "/markers/corners", CALIBRATION, Role.TECHNICIAN, file="image", limit=MAX_IMAGE, plain=True)
    async def marker_corners(self, query: CameraQuery, upload: Upload) -> list[MarkerCorners]:
        """Return the corners of the markers in a picture, pixels."""
        parameters = query.parameters()
        image = await asyncio.to_thread(upload.file.read)
        return await self._calibration.markers(parameters, image)

    @operation("PUT", "/calibrate/robot", CALIBRATION, Role.TECHNICIAN, file="image", parts=("args",), limit=MAX_IMAGE)
    async def calibrate_robot(self, upload: Upload) -> Pose:
        """Return the pose of a robot from the depth picture (16 bit, mm) of a camera with a known pose."""
        args = read_args(upload.fields["args"], CalibrateRobotArgs)
        view = RobotView(args.robot_joints, args.robot_pose, args.camera_pose, args.camera_parameters)
        model = self._robots.model_of_uri(args.urdf_uri)
        depth = await asyncio.to_thread(upload.file.read)
        return (await self._calibration.robot(model, view, [depth])).pose
