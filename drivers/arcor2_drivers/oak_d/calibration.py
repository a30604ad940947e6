"""Camera parameters from the calibration that depthai reads."""

from typing import TYPE_CHECKING, Any, Final

from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.exceptions import DeviceFault
from arcor2_hw.messages import Message

if TYPE_CHECKING:
    import depthai as dai

SUPPORTED: Final = 12
"""Number of lens coefficients in CameraParameters. The next two would describe a tilted sensor."""
INVALID: Final = "calibration"
"""Fault code of a missing or invalid calibration."""


def parameters(
    who: str | Message, handler: "dai.CalibrationHandler", width: int, height: int, undistorted: bool
) -> CameraParameters:
    """Return the parameters of the colour camera.

    Args:
        who: Name and address of the camera, for errors.
        handler: The calibration.
        width: Width of the images, pixels.
        height: Height of the images, pixels.
        undistorted: Whether the camera removes the distortion from the images.

    Raises:
        DeviceFault: The calibration is missing or invalid.
    """
    import depthai as dai

    socket = dai.CameraBoardSocket.CAM_A
    try:
        matrix = handler.getCameraIntrinsics(socket, width, height)
        coefficients = [0.0] * 4 if undistorted else list(handler.getDistortionCoefficients(socket))
    except RuntimeError as error:
        raise DeviceFault(
            "{device} has no calibration of its colour camera", str(error), INVALID, device=who
        ) from error
    if any(coefficients[SUPPORTED:]):
        raise DeviceFault("{device}: a calibration with a tilted sensor is not supported", "", INVALID, device=who)
    coefficients = coefficients[:SUPPORTED]
    for count in (5, 8):
        if len(coefficients) > count and not any(coefficients[count:]):
            coefficients = coefficients[:count]
            break
    fx, fy, cx, cy = matrix[0][0], matrix[1][1], matrix[0][2], matrix[1][2]
    if not (fx > 0.0 and fy > 0.0 and 0.0 < cx < width and 0.0 < cy < height):
        found = f"focal lengths {fx:g}, {fy:g}, centre {cx:g}, {cy:g}"
        raise DeviceFault("{device}: the calibration is invalid", found, INVALID, device=who)
    return CameraParameters(fx, fy, cx, cy, coefficients)


def handler_of(who: str | Message, eeprom: dict[str, Any]) -> "dai.CalibrationHandler":
    """Return the calibration that is stored in an EEPROM, given as JSON. Raises DeviceFault."""
    import depthai as dai

    try:
        return dai.CalibrationHandler.fromJson(eeprom)
    except (RuntimeError, TypeError, ValueError) as error:
        raise DeviceFault("{device}: the calibration cannot be read", str(error), INVALID, device=who) from error
