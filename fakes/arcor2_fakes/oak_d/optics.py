"""The lens of the colour camera: intrinsics, distortion, JSON of the EEPROM, and the ray of every pixel.

Source of the distortion: OpenCV's documentation of the camera model (k1, k2, p1, p2, k3 and the rational terms). Source
of the EEPROM's JSON: the format that the CalibrationHandler of depthai writes, version 7.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]
NEAREST: Final = 0.05
"""Distance below which a solid may fill the image, m."""
MARGIN: Final = 6.0
"""Largest displacement of an edge beyond its corners by distortion, pixels."""


class Lens:
    """A pinhole camera with distortion, for images of width × height."""

    def __init__(self, width: int, height: int) -> None:
        scale = width / 1280.0
        self.width, self.height = width, height
        self.fx, self.fy = 912.5 * scale, 912.1 * scale
        self.cx, self.cy = 642.3 * scale, 357.8 * scale + (height - 720.0 * scale) / 2.0
        self.distortion: Final = (0.08, -0.14, 0.0004, -0.0006, 0.05)

    def rays(self) -> Floats:
        """Return the direction (x, y, 1) of the ray of every pixel in the optical frame, height × width × 3."""
        import cv2  # not when the fake starts

        pixels = np.indices((self.height, self.width), np.float32)[::-1].reshape(2, -1).T
        camera = np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])
        directions = cv2.undistortPoints(pixels, camera, np.array(self.distortion))
        rays = cv2.convertPointsToHomogeneous(directions).reshape(self.height, self.width, 3)
        return np.asarray(rays, np.float32)

    def bounds(self, camera_from_solid: npt.NDArray[np.float64], vertices: Floats) -> tuple[slice, slice] | None:
        """Return the rows and columns in which a solid is visible; None when it is not."""
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        corners = np.array(
            [[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i, j, k in np.ndindex(2, 2, 2)]
        )
        points = corners @ camera_from_solid[:3, :3].T + camera_from_solid[:3, 3]
        if points[:, 2].max() <= NEAREST:
            return None
        if points[:, 2].min() <= NEAREST:
            return slice(0, self.height), slice(0, self.width)
        k1, k2, p1, p2, k3 = self.distortion
        x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
        r2 = np.minimum(x * x + y * y, 1.0)  # beyond, the polynomial is invalid and outside of the image
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        u = self.fx * (x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)) + self.cx
        v = self.fy * (y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y) + self.cy
        left, right = (int(np.clip(each, 0, self.width)) for each in (u.min() - MARGIN, u.max() + MARGIN))
        top, bottom = (int(np.clip(each, 0, self.height)) for each in (v.min() - MARGIN, v.max() + MARGIN))
        return None if left >= right or top >= bottom else (slice(top, bottom), slice(left, right))

    def eeprom(self, serial: str) -> dict[str, Any]:
        """Return the calibration in the format of the EEPROM."""
        nowhere = {"x": 0.0, "y": 0.0, "z": 0.0}
        alone = {
            "lengthUnit": 1,
            "rotationMatrix": [],
            "specTranslation": nowhere,
            "toCameraSocket": -1,
            "toDeviceId": "",
            "translation": nowhere,
        }
        color = {
            "cameraType": 0,
            "distortionCoeff": [*self.distortion, *([0.0] * 9)],
            "extrinsics": alone,
            "height": self.height,
            "intrinsicMatrix": [[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]],
            "lensPosition": 0,
            "specHfovDeg": 69.0,
            "width": self.width,
        }
        return {
            "batchName": "",
            "batchTime": 0,
            "boardConf": "",
            "boardCustom": "",
            "boardName": "FAKE",
            "boardOptions": 0,
            "boardRev": "",
            "cameraData": [[0, color]],
            "deviceName": "OAK-D",
            "hardwareConf": "",
            "housingExtrinsics": alone,
            "imuExtrinsics": alone,
            "miscellaneousData": [],
            "productName": f"OAK-D {serial}",
            "stereoEnableDistortionCorrection": False,
            "stereoRectificationData": {
                "leftCameraSocket": -1,
                "rectifiedRotationLeft": [],
                "rectifiedRotationRight": [],
                "rightCameraSocket": -1,
            },
            "stereoUseSpecTranslation": True,
            "version": 7,
            "verticalCameraSocket": -1,
        }
