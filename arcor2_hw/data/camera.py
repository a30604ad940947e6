"""Cameras: intrinsics and detected markers."""

from arcor2_hw.data.base import Data
from arcor2_hw.data.geometry import Pose


class CameraParameters(Data, frozen=True):
    """Pinhole intrinsics in pixels with 4, 5, 8 or 12 distortion coefficients in OpenCV's order.

    Raises ValueError for another number of coefficients.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    dist_coefs: list[float]

    def __post_init__(self) -> None:
        if len(self.dist_coefs) not in (4, 5, 8, 12):
            raise ValueError(f"dist_coefs needs 4, 5, 8 or 12 numbers, not {len(self.dist_coefs)}")


class EstimatedPose(Data, frozen=True):
    """A pose with its quality, 0 to 1."""

    pose: Pose
    quality: float


class Corner(Data, frozen=True):
    """A point in the image, px."""

    x: float
    y: float


class MarkerCorners(Data, frozen=True):
    """The four corners of one marker."""

    marker_id: int
    corners: list[Corner]
