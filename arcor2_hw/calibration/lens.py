"""A camera's lens for the solvers: pixels to rays and back, by OpenCV's model."""

import math
from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt

from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.exceptions import InvalidData

Array = npt.NDArray[np.float64]

_UNDISTORTING: Final = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-12)
_ROUND_TRIP: Final = 0.01
"""Maximum error of an image corner after conversion to a ray and back, px."""
_NOTHING: Final = np.zeros(3)


class Lens:
    """Intrinsics, validated for images of width × height.

    Raises:
        InvalidData: A number is not finite or not positive, the principal point is not inside images of this size, or
            the distortion cannot be inverted in the corners of the image.
    """

    def __init__(self, parameters: CameraParameters, width: int, height: int) -> None:
        p = parameters
        for name, value in (("fx", p.fx), ("fy", p.fy)):
            if not (math.isfinite(value) and value > 0):
                raise InvalidData(
                    "{name} of the camera must be a positive number of pixels, not {value}", name=name, value=value
                )
        if not all(map(math.isfinite, (p.cx, p.cy, *p.dist_coefs))):
            raise InvalidData("the camera's parameters must be finite numbers")
        if not (0.25 < p.cx / width < 0.75 and 0.25 < p.cy / height < 0.75):
            raise InvalidData(
                "the camera's parameters do not match images of {width} × {height}: the principal point is at "
                "{cx:.0f}, {cy:.0f}",
                width=width,
                height=height,
                cx=p.cx,
                cy=p.cy,
            )
        self.parameters = parameters
        self.width, self.height = width, height
        self.matrix: Array = np.array([[p.fx, 0.0, p.cx], [0.0, p.fy, p.cy], [0.0, 0.0, 1.0]])
        self.coefficients: Array = np.array(p.dist_coefs, dtype=np.float64)
        corners = np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]])
        rays = self.rays(corners)
        miss = float(np.abs(self.pixels(rays) - corners).max())
        # From the middle to the corners, the distorted radius must grow.
        _, slopes = self.pixels_and_slopes(np.concatenate([rays * part for part in np.linspace(0.05, 1.0, 20)]))
        if not (miss < _ROUND_TRIP and np.linalg.det(slopes).min() > 0):
            raise InvalidData(
                "the camera's distortion cannot be inverted in the corners of the image: its coefficients are "
                "wrong, or belong to another lens model",
                f"{p.dist_coefs}, off by {miss:.3g} px",
            )

    def rays(self, pixels: Array) -> Array:
        """Return x and y at distance 1 of the rays of pixels, (n, 2)."""
        points = np.ascontiguousarray(pixels, dtype=np.float64).reshape(-1, 1, 2)
        found: Any = cv2.undistortPoints(points, self.matrix, self.coefficients, criteria=_UNDISTORTING)
        return np.asarray(found, dtype=np.float64).reshape(-1, 2)

    def pixels(self, rays: Array) -> Array:
        """Return the pixels of rays (x and y at distance 1), (n, 2)."""
        points = np.column_stack((rays, np.ones(len(rays))))
        found: Any = cv2.projectPoints(points, _NOTHING, _NOTHING, self.matrix, self.coefficients)[0]
        return np.asarray(found, dtype=np.float64).reshape(-1, 2)

    def pixels_and_slopes(self, rays: Array) -> tuple[Array, Array]:
        """Return the pixels of rays, (n, 2), and their derivatives by x and y of the ray, (n, 2, 2)."""
        points = np.column_stack((rays, np.ones(len(rays))))
        pixels: Any
        pixels, derivatives = cv2.projectPoints(points, _NOTHING, _NOTHING, self.matrix, self.coefficients)[:2]
        by_displacement = np.asarray(derivatives, dtype=np.float64).reshape(len(rays), 2, -1)[:, :, 3:5]
        return np.asarray(pixels, dtype=np.float64).reshape(-1, 2), by_displacement

    def projected(self, points: Array, change: Array) -> Array:
        """Project points in the camera's frame with intrinsics changed by `change` (as `numbers`), (n, 2)."""
        pixels: Any = cv2.projectPoints(points, _NOTHING, _NOTHING, *self._changed(change))[0]
        return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)

    def projected_with_slopes(self, points: Array, change: Array) -> tuple[Array, Array, Array]:
        """Project points like `projected`, and return the derivatives by the points and by the intrinsics."""
        pixels: Any
        pixels, derivatives = cv2.projectPoints(points, _NOTHING, _NOTHING, *self._changed(change))[:2]
        jacobian = np.asarray(derivatives, dtype=np.float64).reshape(len(points), 2, -1)
        return np.asarray(pixels, dtype=np.float64).reshape(-1, 2), jacobian[:, :, 3:6], jacobian[:, :, 6:]

    @property
    def numbers(self) -> Array:
        """Return fx, fy, cx, cy and the coefficients as one vector."""
        p = self.parameters
        return np.array([p.fx, p.fy, p.cx, p.cy, *p.dist_coefs])

    def changed(self, change: Array) -> CameraParameters:
        """Return the intrinsics changed by `change` (as `numbers`)."""
        fx, fy, cx, cy, *coefficients = map(float, self.numbers + change)
        return CameraParameters(fx, fy, cx, cy, coefficients)

    def _changed(self, change: Array) -> tuple[Array, Array]:
        fx, fy, cx, cy = self.numbers[:4] + change[:4]
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]), self.coefficients + change[4:]
