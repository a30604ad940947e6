"""Depth pictures: read, checked, averaged, filtered and turned into a cloud in the camera's frame."""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.pictures import LARGEST_BYTES, LARGEST_PIXELS, InvalidPicture
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.exceptions import InvalidData

DepthPictures = npt.NDArray[np.uint16]
"""One picture (rows, columns) or several of a standing scene (n, rows, columns): mm, 0 where there is none."""
Floats = npt.NDArray[np.float64]

RANGE: Final = (0.15, 8.0)
"""m within which a depth is taken for one."""
JUMP: Final = 0.02
"""Of the distance: depths of neighbours that differ by more are an edge, where sensors give what is neither side."""
LEAST_POINTS: Final = 500
SAMPLE: Final = 2_000
TRIALS: Final = 150
"""Of planes through three points each."""
_IHDR: Final = 8 + 4 + 4
_PNG: Final = b"\x89PNG\r\n\x1a\n"


def read_depth(picture: bytes) -> DepthPictures:
    """Read a PNG file of 16-bit depth in mm.

    Raises InvalidPicture: no PNG, damaged, colour or 8 bit, more than LARGEST_PIXELS or LARGEST_BYTES.
    """
    if len(picture) > LARGEST_BYTES:
        raise InvalidPicture(f"The depth picture has {len(picture)} bytes; {LARGEST_BYTES} are the most.")
    if picture[:8] != _PNG or len(picture) < _IHDR + 17:
        raise InvalidPicture("The depth picture is no PNG file.")
    width, height = (int.from_bytes(picture[_IHDR + 4 * i : _IHDR + 4 * i + 4], "big") for i in range(2))
    if not 0 < width * height <= LARGEST_PIXELS:
        raise InvalidPicture(f"The depth picture has {width} × {height} pixels; {LARGEST_PIXELS} are the most.")
    bits, kind = picture[_IHDR + 8], picture[_IHDR + 9]
    if (bits, kind) != (16, 0):
        raise InvalidPicture(
            f"A depth picture has one channel of 16 bit in mm; this one has {bits} bit, PNG type {kind}."
        )
    try:
        found = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as e:
        raise InvalidPicture("The depth picture is damaged.", str(e)) from e
    if found is None or found.dtype != np.uint16 or found.shape != (height, width):
        raise InvalidPicture("The depth picture is damaged.")
    return np.asarray(found, dtype=np.uint16)


def mean_depth(pictures: DepthPictures) -> Floats:
    """Give the mean of several pictures, m, 0 where fewer than half of them have a depth or where they disagree.

    Raises InvalidData: not 16 bit, not one picture or several of one size.
    """
    if pictures.dtype != np.uint16 or pictures.ndim not in (2, 3) or not pictures.size:
        raise InvalidData(
            f"A depth picture has rows and columns of 16 bit in mm, not shape {pictures.shape} of {pictures.dtype}."
        )
    if pictures.ndim == 2 or len(pictures) == 1:
        return np.asarray(pictures.reshape(pictures.shape[-2:]), dtype=np.float64) * 1e-3
    total = np.zeros(pictures.shape[1:])
    squares, count = np.zeros_like(total), np.zeros_like(total)
    for picture in pictures:  # one at a time: a thousand pictures need no more memory than two
        z = picture * 1e-3
        total += z
        squares += z * z
        count += picture > 0
    mean = total / np.maximum(count, 1)
    spread = np.sqrt(np.maximum(0.0, squares / np.maximum(count, 1) - mean * mean))
    return np.where((count >= len(pictures) / 2) & (spread <= JUMP * np.maximum(mean, 0.5)), mean, 0.0)


@dataclass(frozen=True)
class DepthView:
    """A filtered depth picture with the rays of its pixels.

    depth: (rows, columns), m, 0 where there is none that could be used. seen: the same before edges were taken out.
    rays: (rows, columns, 3) in the camera's optical frame, z = 1, so that ray times depth is the point.
    """

    depth: Floats
    seen: Floats
    rays: Floats

    def points(self) -> Floats:
        """Give the usable points (n, 3) in the camera's frame."""
        there = self.depth > 0
        return np.asarray(self.rays[there] * self.depth[there][:, None])


def look(pictures: DepthPictures, parameters: CameraParameters) -> DepthView:
    """Average, filter and unproject.

    Raises:
        InvalidData: pictures that are none, or of another size than the lens's parameters are for.
        CalibrationRefused: fewer than LEAST_POINTS have a depth.
    """
    seen = mean_depth(pictures)
    rays = pixel_rays(seen.shape[1], seen.shape[0], parameters)
    seen = np.where((seen >= RANGE[0]) & (seen <= RANGE[1]), seen, 0.0)
    depth = _without_edges(seen)
    if (count := int(np.count_nonzero(depth))) < LEAST_POINTS:
        raise CalibrationRefused(
            f"The depth picture has {count} usable points; {LEAST_POINTS} are the least. Is the camera covered,"
            " too near, or the scene without texture and light?",
            f"{int(np.count_nonzero(seen))} of {seen.size} pixels have a depth",
            Reason.TOO_FEW_POINTS,
        )
    return DepthView(depth, seen, rays)


def pixel_rays(width: int, height: int, parameters: CameraParameters) -> Floats:
    """Give the ray of every pixel, (rows, columns, 3) with z = 1. Raises InvalidData when picture and lens disagree."""
    values = (parameters.fx, parameters.fy, parameters.cx, parameters.cy, *parameters.dist_coefs)
    if not np.isfinite(values).all() or parameters.fx <= 0 or parameters.fy <= 0:
        raise InvalidData(f"fx and fy of a camera are positive and all of its parameters finite, not {values}.")
    if width * height > LARGEST_PIXELS:
        raise InvalidData(f"The depth picture has {width} × {height} pixels; {LARGEST_PIXELS} are the most.")
    if not (0.25 * width < parameters.cx < 0.75 * width and 0.25 * height < parameters.cy < 0.75 * height):
        raise InvalidData(
            f"The depth picture has {width} × {height} pixels, but the camera's parameters are for another size: their"
            f" centre is at {parameters.cx:.0f}, {parameters.cy:.0f}."
        )
    u, v = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    matrix = np.array([[parameters.fx, 0.0, parameters.cx], [0.0, parameters.fy, parameters.cy], [0.0, 0.0, 1.0]])
    pixels = np.stack([u.ravel(), v.ravel()], axis=-1)[:, None]
    flat = cv2.undistortPoints(pixels, matrix, np.asarray(parameters.dist_coefs, dtype=np.float64))
    return np.concatenate([flat[:, 0], np.ones((len(flat), 1))], axis=1).reshape(height, width, 3)


def _without_edges(z: Floats) -> Floats:
    """Take out pixels beside a jump of depth: what a sensor tells there lies between the two sides."""
    kernel = np.ones((3, 3), np.uint8)
    far = cv2.dilate(z, kernel)
    near = cv2.erode(np.where(z > 0, z, 1e3), kernel)
    edge = (far - near > JUMP * z).astype(np.uint8)
    return np.where(cv2.dilate(edge, kernel) > 0, 0.0, z)


def planes(points: Floats, random: np.random.Generator, most: int = 3) -> list[tuple[Floats, float]]:
    """Find large planes in a cloud (n, 3): of each its unit normal and offset, so that normal · point = offset.

    Source: M. Fischler and R. Bolles, "Random sample consensus" (1981). A plane has at least a tenth of the points.
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
    """Give how far from a plane points (n, 3, in the camera's frame) may be and still belong to it, m."""
    return np.asarray(0.006 + 0.005 * points[:, 2] ** 2)
