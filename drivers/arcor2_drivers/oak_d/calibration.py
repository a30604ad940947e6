"""The calibration as depthai keeps it, into the parameters of a camera."""

from typing import TYPE_CHECKING, Any, Final

from arcor2_hw.data.camera import CameraParameters

if TYPE_CHECKING:
    import depthai as dai

KEPT: Final = 12
"""Coefficients of the lens that can be told; the two after them are the tilt of the sensor."""


class BadCalibration(Exception):
    """The device has no calibration that makes sense."""


def parameters(handler: "dai.CalibrationHandler", width: int, height: int, undistorted: bool) -> CameraParameters:
    """Return the colour camera's parameters for pictures of a size. Raises BadCalibration.

    undistorted: the pictures have been freed from distortion, by the device.
    """
    import depthai as dai

    socket = dai.CameraBoardSocket.CAM_A
    try:
        matrix = handler.getCameraIntrinsics(socket, width, height)
        coefficients = [0.0] * 4 if undistorted else list(handler.getDistortionCoefficients(socket))
    except RuntimeError as error:
        raise BadCalibration(f"the calibration of the colour camera is not there: {error}") from error
    if any(coefficients[KEPT:]):
        raise BadCalibration("the lens is calibrated with a tilted sensor, which the 12 coefficients do not cover")
    coefficients = coefficients[:KEPT]
    for count in (5, 8):
        if len(coefficients) > count and not any(coefficients[count:]):
            coefficients = coefficients[:count]
            break
    fx, fy, cx, cy = matrix[0][0], matrix[1][1], matrix[0][2], matrix[1][2]
    if not (fx > 0.0 and fy > 0.0 and 0.0 < cx < width and 0.0 < cy < height):
        raise BadCalibration(f"focal lengths {fx:g}, {fy:g} and centre {cx:g}, {cy:g} are no camera's")
    return CameraParameters(fx, fy, cx, cy, coefficients)


def handler_of(eeprom: dict[str, Any]) -> "dai.CalibrationHandler":
    """Read the EEPROM's JSON. Raises BadCalibration."""
    import depthai as dai

    try:
        return dai.CalibrationHandler.fromJson(eeprom)
    except (RuntimeError, TypeError, ValueError) as error:
        raise BadCalibration(f"the calibration is not readable: {error}") from error
