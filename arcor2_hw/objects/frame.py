"""Frame: colour and depth of one instant, with all that makes points in space of them; and what a picture says of it.

Lens model: OpenCV's, coefficients k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4.
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
"""Under which a picture carries its PictureNote; as a text chunk when the picture travels as PNG."""
UNDISTORTING: Final = 10
"""Iterations; each leaves a tenth of the error with a lens as it is in use."""


class PictureNote(Data, frozen=True):
    """How a picture was taken: the lens, the camera's pose in the world (optical frame), when, by which camera."""

    parameters: CameraParameters
    pose: Pose
    stamp: Timestamp
    camera: str
    exposure: float | Unset = UNSET

    def put_on(self, picture: "Image.Image") -> "Image.Image":
        """Write it on a picture; gives the picture."""
        picture.info[KEY] = msgspec.json.encode(self).decode()
        return picture

    @classmethod
    def of(cls, picture: "Image.Image") -> "PictureNote":
        """Read it from a picture. Raises InvalidData for one that does not say how it was taken."""
        text = picture.info.get(KEY)
        if not isinstance(text, str):
            raise InvalidData("the picture does not say how it was taken: it needs one as a camera's depth_image gives")
        try:
            return msgspec.json.decode(text, type=cls)
        except (msgspec.MsgspecError, ValueError) as error:
            raise InvalidData(f"what the picture says of how it was taken is not readable: {error}") from error


@dataclass(frozen=True, eq=False)
class Frame:
    """Colour and depth of one instant.

    color: height × width × 3, uint8, R, G, B. depth: height × width, uint16, mm along the optical axis in the colour
    camera's view, 0 = invalid; None when there is none. monotonic: when the exposure ended on this computer's monotonic
    clock, s. exposure: s, None when the camera does not tell.
    """

    color: "npt.NDArray[np.uint8]"
    depth: "npt.NDArray[np.uint16] | None"
    note: PictureNote
    monotonic: float
    exposure: float | None = None

    @property
    def stamp(self) -> Timestamp:
        """Give when the exposure ended (UTC)."""
        return self.note.stamp


def rays(parameters: CameraParameters, width: int, height: int) -> "npt.NDArray[np.float32]":
    """Give, for every pixel, x and y of its ray at 1 m along the optical axis: height × width × 2, read-only."""
    p = parameters
    return _rays(p.fx, p.fy, p.cx, p.cy, tuple(p.dist_coefs), width, height)


@functools.lru_cache(maxsize=4)
def _rays(
    fx: float, fy: float, cx: float, cy: float, coefficients: tuple[float, ...], width: int, height: int
) -> "npt.NDArray[np.float32]":
    import numpy as np  # 0.1 s that those who have no camera do without

    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = (*coefficients, *(0.0,) * (12 - len(coefficients)))
    v, u = np.indices((height, width), dtype=np.float32)
    seen_x, seen_y = (u - np.float32(cx)) / np.float32(fx), (v - np.float32(cy)) / np.float32(fy)
    x, y = seen_x.copy(), seen_y.copy()
    for _ in range(UNDISTORTING if any(coefficients) else 0):
        r2 = x * x + y * y
        factor = (1 + r2 * (k4 + r2 * (k5 + r2 * k6))) / (1 + r2 * (k1 + r2 * (k2 + r2 * k3)))
        sideways = 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2)
        upright = p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4)
        x, y = (seen_x - sideways) * factor, (seen_y - upright) * factor
    found = np.stack([x, y], axis=-1).astype(np.float32)
    found.setflags(write=False)
    return found


def cloud(depth: "npt.NDArray[np.uint16]", parameters: CameraParameters) -> "npt.NDArray[np.float32]":
    """Give the point of every pixel in the optical frame, m: height × width × 3, NaN where depth is invalid."""
    import numpy as np

    height, width = depth.shape
    z = np.where(depth > 0, depth, np.nan).astype(np.float32) * np.float32(0.001)
    return np.concatenate([rays(parameters, width, height) * z[..., None], z[..., None]], axis=-1)
