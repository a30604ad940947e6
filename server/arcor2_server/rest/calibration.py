"""The Calibration service over REST (protocol, section 15); where none is there, each answers 503."""

import asyncio
from typing import Final

import msgspec

from arcor2_hw.data.base import Data
from arcor2_hw.data.camera import CameraParameters, EstimatedPose, MarkerCorners
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData
from arcor2_server.calibration import RobotView
from arcor2_server.rest.naming import camelized_names, snaked
from arcor2_server.rest.operations import MIB, Upload, operation
from arcor2_server.services import Services

CALIBRATION = "Calibration"
MAX_IMAGE: Final = 64 * MIB
COEFFICIENTS: Final = (4, 5, 8, 12)
"""How many distortion coefficients there may be."""


class CameraQuery(Data, frozen=True, rename="camel"):
    """Focal lengths and centre, pixels, and the coefficients of distortion."""

    fx: float
    fy: float
    cx: float
    cy: float
    dist_coefs: list[float]

    def parameters(self) -> CameraParameters:
        """Give them as the rest of the server has them. InvalidData."""
        if len(self.dist_coefs) not in COEFFICIENTS:
            raise InvalidData(f"distCoefs needs 4, 5, 8 or 12 numbers, not {len(self.dist_coefs)}.")
        return CameraParameters(self.fx, self.fy, self.cx, self.cy, list(self.dist_coefs))


class CameraPoseQuery(CameraQuery, frozen=True, rename="camel"):
    """With `inverse` the pose of the origin in the camera's frame is asked for."""

    inverse: bool = False


@operation("PUT", "/calibrate/camera", CALIBRATION, Role.TECHNICIAN, file="image", limit=MAX_IMAGE)
async def calibrate_camera(services: Services, query: CameraPoseQuery, upload: Upload) -> EstimatedPose:
    """Give the pose of the camera, which sees markers whose poses are known."""
    parameters = query.parameters()
    image = await asyncio.to_thread(upload.file.read)
    return await services.calibration.camera_pose(parameters, image, inverse=query.inverse)


@operation("PUT", "/markers/corners", CALIBRATION, Role.TECHNICIAN, file="image", limit=MAX_IMAGE, plain=True)
async def marker_corners(services: Services, query: CameraQuery, upload: Upload) -> list[MarkerCorners]:
    """Give the corners of the markers in a picture, pixels."""
    parameters = query.parameters()
    image = await asyncio.to_thread(upload.file.read)
    return await services.calibration.marker_corners(parameters, image)


@operation("PUT", "/calibrate/robot", CALIBRATION, Role.TECHNICIAN, file="image", parts=("args",), limit=MAX_IMAGE)
async def calibrate_robot(services: Services, upload: Upload) -> Pose:
    """Give the pose of a robot that a depth camera of known pose sees (16 bit, mm)."""
    try:
        view = msgspec.convert(snaked(msgspec.json.decode(upload.fields["args"])), RobotView)
    except (msgspec.DecodeError, RecursionError) as error:
        raise InvalidData(f"The part args is wrong: {camelized_names(str(error))}.") from None
    return await services.calibration.robot_pose(view, await asyncio.to_thread(upload.file.read))
