"""Frame: colour and depth images of one instant, with everything needed to compute points in space.

Lens model: that of OpenCV with the coefficients k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4.
"""

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import msgspec

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import InvalidData

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    from PIL import Image

KEY: Final = "arcor2_view"
"""Key of the PictureNote in an image; a text chunk of a PNG file."""
UNDISTORT_ITERATIONS: Final = 10
"""Number of iterations; each reduces the error of a typical lens by a factor of ten."""


class PictureNote(Data, frozen=True):
    """Data about an image: lens parameters, pose of the camera's optical frame in the world, time and camera."""

    parameters: CameraParameters
    pose: Pose
    stamp: Timestamp
    camera: str
    exposure: float | Unset = UNSET

    def put_on(self, picture: "Image.Image") -> "Image.Image":
        """Write the note into an image and return the image."""
        picture.info[KEY] = msgspec.json.encode(self).decode()
        return picture

    @classmethod
    def of(cls, picture: "Image.Image") -> "PictureNote":
        """Read the note of an image.

        Raises:
            InvalidData: The image has no valid note.
        """
        text = picture.info.get(KEY)
        if not isinstance(text, str):
            raise InvalidData("the image has no camera data. Use an image from depth_image of a camera.")
        try:
            return msgspec.json.decode(text, type=cls)
        except (msgspec.MsgspecError, ValueError) as error:
            raise InvalidData("the camera data of the image is not valid: {reason}", reason=error) from error


@dataclass(frozen=True, eq=False)
class Frame:
    """Colour and depth images of one instant.

    Attributes:
        color: height × width × 3, uint8, R, G, B.
        depth: height × width, uint16, mm along the optical axis in the view of the colour camera, 0 = invalid, or None.
        monotonic: End of the exposure on this computer's monotonic clock, s.
        exposure: Exposure time, s; None when unknown.
    """

    color: "npt.NDArray[np.uint8]"
    depth: "npt.NDArray[np.uint16] | None"
    note: PictureNote
    monotonic: float
    exposure: float | None = None

    @property
    def stamp(self) -> Timestamp:
        """Return the end of the exposure (UTC)."""
        return self.note.stamp


def rays(parameters: CameraParameters, width: int, height: int) -> "npt.NDArray[np.float32]":
    """Return x and y of the ray of every pixel at 1 m along the optical axis: height × width × 2, read-only."""
    p = parameters
    return _rays(p.fx, p.fy, p.cx, p.cy, tuple(p.dist_coefs), width, height)


@functools.lru_cache(maxsize=4)
def _rays(
    fx: float, fy: float, cx: float, cy: float, coefficients: tuple[float, ...], width: int, height: int
) -> "npt.NDArray[np.float32]":
    import numpy as np  # imported here because it takes 0.1 s

    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = (*coefficients, *(0.0,) * (12 - len(coefficients)))
    v, u = np.indices((height, width), dtype=np.float32)
    distorted_x, distorted_y = (u - np.float32(cx)) / np.float32(fx), (v - np.float32(cy)) / np.float32(fy)
    x, y = distorted_x.copy(), distorted_y.copy()
    for _ in range(UNDISTORT_ITERATIONS if any(coefficients) else 0):
        r2 = x * x + y * y
        factor = (1 + r2 * (k4 + r2 * (k5 + r2 * k6))) / (1 + r2 * (k1 + r2 * (k2 + r2 * k3)))
        tangential_x = 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2)
        tangential_y = p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4)
        x, y = (distorted_x - tangential_x) * factor, (distorted_y - tangential_y) * factor
    found = np.stack([x, y], axis=-1).astype(np.float32)
    found.setflags(write=False)
    return found


def cloud(depth: "npt.NDArray[np.uint16]", parameters: CameraParameters) -> "npt.NDArray[np.float32]":
    """Return the point of every pixel in the optical frame, m: height × width × 3, NaN where depth is invalid."""
    import numpy as np

    height, width = depth.shape
    z = np.where(depth > 0, depth, np.nan).astype(np.float32) * np.float32(0.001)
    return np.concatenate([rays(parameters, width, height) * z[..., None], z[..., None]], axis=-1)
