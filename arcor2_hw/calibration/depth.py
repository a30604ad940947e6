"""Depth images: reading, validation, averaging, filtering, and conversion to a point cloud in the camera's frame."""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.pictures import MAX_BYTES, MAX_PIXELS, InvalidPicture
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.exceptions import InvalidData

DepthPictures = npt.NDArray[np.uint16]
"""One depth image (rows, columns), or several of a static scene (n, rows, columns): mm, 0 where invalid."""
Floats = npt.NDArray[np.float64]

RANGE: Final = (0.15, 8.0)
"""Range of valid depths, m."""
JUMP: Final = 0.02
"""Relative difference between neighbouring depths that counts as an edge, where sensors return values in between."""
MIN_POINTS: Final = 500
SAMPLE: Final = 2_000
TRIALS: Final = 150
"""Number of random planes through three points that are tried."""
_IHDR: Final = 8 + 4 + 4
_PNG: Final = b"\x89PNG\r\n\x1a\n"


def read_depth(picture: bytes) -> DepthPictures:
    """Read a PNG file of 16-bit depth in mm.

    Raises:
        InvalidPicture: It is not a PNG file, damaged, in colour, 8 bit, or larger than MAX_PIXELS or MAX_BYTES.
    """
    if len(picture) > MAX_BYTES:
        raise InvalidPicture(
            "The depth image has {count} bytes; the maximum is {largest_bytes}.",
            count=len(picture),
            largest_bytes=MAX_BYTES,
        )
    if picture[:8] != _PNG or len(picture) < _IHDR + 17:
        raise InvalidPicture("The depth image is not a PNG file.")
    width, height = (int.from_bytes(picture[_IHDR + 4 * i : _IHDR + 4 * i + 4], "big") for i in range(2))
    if not 0 < width * height <= MAX_PIXELS:
        raise InvalidPicture(
            "The depth image has {width} × {height} pixels; the maximum is {largest_pixels}.",
            width=width,
            height=height,
            largest_pixels=MAX_PIXELS,
        )
    bits, kind = picture[_IHDR + 8], picture[_IHDR + 9]
    if (bits, kind) != (16, 0):
        raise InvalidPicture(
            "A depth image needs one channel of 16 bit in mm; this one has {bits} bit, PNG type {type}.",
            bits=bits,
            type=kind,
        )
    try:
        found = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as e:
        raise InvalidPicture("The depth image is damaged.", str(e)) from e
    if found is None or found.dtype != np.uint16 or found.shape != (height, width):
        raise InvalidPicture("The depth image is damaged.")
    return np.asarray(found, dtype=np.uint16)


def mean_depth(pictures: DepthPictures) -> Floats:
    """Return the mean of several depth images, m; 0 where fewer than half of them have a value, or where they disagree.

    Raises:
        InvalidData: The images are not 16 bit, or not of one size.
    """
    if pictures.dtype != np.uint16 or pictures.ndim not in (2, 3) or not pictures.size:
        raise InvalidData(
            "A depth image needs rows and columns of 16 bit in mm, not shape {shape} of {dtype}.",
            shape=pictures.shape,
            dtype=pictures.dtype,
        )
    if pictures.ndim == 2 or len(pictures) == 1:
        return np.asarray(pictures.reshape(pictures.shape[-2:]), dtype=np.float64) * 1e-3
    total = np.zeros(pictures.shape[1:])
    squares, count = np.zeros_like(total), np.zeros_like(total)
    for picture in pictures:  # one at a time, so that memory does not grow with the number of images
        z = picture * 1e-3
        total += z
        squares += z * z
        count += picture > 0
    mean = total / np.maximum(count, 1)
    spread = np.sqrt(np.maximum(0.0, squares / np.maximum(count, 1) - mean * mean))
    return np.where((count >= len(pictures) / 2) & (spread <= JUMP * np.maximum(mean, 0.5)), mean, 0.0)


@dataclass(frozen=True)
class DepthView:
    """A filtered depth image with the rays of its pixels.

    Attributes:
        depth: (rows, columns), m, 0 where not usable.
        seen: The depth before edges were removed.
        rays: (rows, columns, 3) in the camera's optical frame with z = 1, so that ray times depth is the point.
    """

    depth: Floats
    seen: Floats
    rays: Floats

    def points(self) -> Floats:
        """Return the usable points (n, 3) in the camera's frame."""
        there = self.depth > 0
        return np.asarray(self.rays[there] * self.depth[there][:, None])


def depth_view(pictures: DepthPictures, parameters: CameraParameters) -> DepthView:
    """Average, filter and unproject depth images.

    Raises:
        InvalidData: An image is invalid, or its size does not match the parameters of the lens.
        CalibrationRefused: Fewer than MIN_POINTS pixels are usable.
    """
    seen = mean_depth(pictures)
    rays = pixel_rays(seen.shape[1], seen.shape[0], parameters)
    seen = np.where((seen >= RANGE[0]) & (seen <= RANGE[1]), seen, 0.0)
    depth = _without_edges(seen)
    if (count := int(np.count_nonzero(depth))) < MIN_POINTS:
        raise CalibrationRefused(
            "The depth image has {count} usable points, but at least {least_points} are needed. Check that "
            "the camera is not covered or too near, and that the scene has texture and light.",
            f"{int(np.count_nonzero(seen))} of {seen.size} pixels have a depth",
            Reason.TOO_FEW_POINTS,
            count=count,
            least_points=MIN_POINTS,
        )
    return DepthView(depth, seen, rays)


def pixel_rays(width: int, height: int, parameters: CameraParameters) -> Floats:
    """Return the ray of every pixel, (rows, columns, 3) with z = 1.

    Raises:
        InvalidData: The size of the image does not match the parameters of the lens.
    """
    values = (parameters.fx, parameters.fy, parameters.cx, parameters.cy, *parameters.dist_coefs)
    if not np.isfinite(values).all() or parameters.fx <= 0 or parameters.fy <= 0:
        raise InvalidData(
            "fx and fy of a camera must be positive and all parameters finite, not {values}.", values=values
        )
    if width * height > MAX_PIXELS:
        raise InvalidData(
            "The depth image has {width} × {height} pixels; the maximum is {largest_pixels}.",
            width=width,
            height=height,
            largest_pixels=MAX_PIXELS,
        )
    if not (0.25 * width < parameters.cx < 0.75 * width and 0.25 * height < parameters.cy < 0.75 * height):
        raise InvalidData(
            "The depth image has {width} × {height} pixels, but the camera's parameters are for another "
            "size: their centre is at {cx:.0f}, {cy:.0f}.",
            width=width,
            height=height,
            cx=parameters.cx,
            cy=parameters.cy,
        )
    u, v = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    matrix = np.array([[parameters.fx, 0.0, parameters.cx], [0.0, parameters.fy, parameters.cy], [0.0, 0.0, 1.0]])
    pixels = np.stack([u.ravel(), v.ravel()], axis=-1)[:, None]
    flat = cv2.undistortPoints(pixels, matrix, np.asarray(parameters.dist_coefs, dtype=np.float64))
    return np.concatenate([flat[:, 0], np.ones((len(flat), 1))], axis=1).reshape(height, width, 3)


def _without_edges(z: Floats) -> Floats:
    """Remove pixels next to a jump of depth, where a sensor returns values between both sides."""
    kernel = np.ones((3, 3), np.uint8)
    far = cv2.dilate(z, kernel)
    near = cv2.erode(np.where(z > 0, z, 1e3), kernel)
    edge = (far - near > JUMP * z).astype(np.uint8)
    return np.where(cv2.dilate(edge, kernel) > 0, 0.0, z)


def planes(points: Floats, random: np.random.Generator, most: int = 3) -> list[tuple[Floats, float]]:
    """Find large planes in a point cloud (n, 3).

    Returns:
        For each plane its unit normal and offset, so that normal · point = offset. A plane has at least 10 % of the
        points.

    Source: M. Fischler and R. Bolles, "Random sample consensus" (1981).
    """
    rest = points[random.permutation(len(points))[:SAMPLE]]
    least = max(len(rest) // 10, 50)
    found: list[tuple[Floats, float]] = []
    while len(found) < most and len(rest) >= least:
        corners = rest[random.integers(0, len(rest), (TRIALS, 3))]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        normals = normals[lengths > 1e-9] / lengths[lengths > 1e-9][:, None]
        offsets = np.einsum("ij,ij->i", normals, corners[lengths > 1e-9][:, 0])
        if not len(normals):
            break
        thickness = plane_thickness(rest)
        counts = (np.abs(normals @ rest.T - offsets[:, None]) < thickness).sum(axis=1)
        best = int(np.argmax(counts))
        if counts[best] < least:
            break
        on = np.abs(rest @ normals[best] - offsets[best]) < thickness
        middle = rest[on].mean(axis=0)
        normal = np.linalg.svd(rest[on] - middle, full_matrices=False)[2][2]
        found.append((normal, float(normal @ middle)))
        rest = rest[np.abs(rest @ normal - normal @ middle) >= 1.5 * thickness]
    return found


def plane_thickness(points: Floats) -> Floats:
    """Return the distance from a plane within which points (n, 3, in the camera's frame) belong to it, m."""
    return np.asarray(0.006 + 0.005 * points[:, 2] ** 2)
