"""Where a camera stands, from what it sees of markers and boards of known size and place."""

from collections.abc import Sequence

from arcor2_hw.calibration.camera_results import CameraPose, PoseOptions
from arcor2_hw.calibration.layout import Layout
from arcor2_hw.calibration.pictures import Picture
from arcor2_hw.data.camera import CameraParameters


def find_camera_pose(
    pictures: Sequence[Picture], parameters: CameraParameters, layout: Layout, options: PoseOptions | None = None
) -> CameraPose:
    """Find the pose of a camera in the origin's frame.

    Args:
        pictures: one, or several that the same camera took from the same place; their noise is averaged.
        parameters: of the lens, for the size of the pictures.
        layout: the markers and boards that may be in sight; others in the picture do not matter.
        options: method, hints and limits.

    Raises:
        InvalidPicture: a picture that is none, is damaged or too large; pictures of different sizes.
        InvalidData: parameters that are none; a marker that is listed twice, or is not in its dictionary.
        CalibrationRefused: blurred; no marker; ambiguous (one marker seen from the front: the text says what helps);
            implausible (a marker twice in the picture, or elsewhere than it is said to be; the camera moved between
            the pictures); not converged.
    """
    raise NotImplementedError


def draw_camera_pose(picture: Picture, parameters: CameraParameters, layout: Layout, result: CameraPose) -> bytes:
    """Draw where the markers should be with that pose onto the picture: PNG."""
    raise NotImplementedError
