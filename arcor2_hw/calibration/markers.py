"""Markers in a picture: found, and their corners measured to a few hundredths of a pixel."""

from arcor2_hw.calibration.layout import MarkerDictionary
from arcor2_hw.calibration.pictures import Picture
from arcor2_hw.data.camera import CameraParameters, MarkerCorners


def find_marker_corners(
    picture: Picture, parameters: CameraParameters, dictionary: MarkerDictionary = "4x4_50"
) -> list[MarkerCorners]:
    """Give the corners of every marker in the picture, configured or not, by their ids.

    Corners: px, in the picture as it is (with the lens's distortion), upper left first as the marker is printed, then
    clockwise. An empty list when there is none; an id that is there twice is given twice.

    Raises InvalidPicture, InvalidData as find_camera_pose.
    """
    raise NotImplementedError
