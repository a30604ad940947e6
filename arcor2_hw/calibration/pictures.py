"""Reading of images: files or grey values, validated before they are decoded."""

import io
import warnings
from collections.abc import Iterable, Iterator
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image

from arcor2_hw.exceptions import InvalidData

Grey = npt.NDArray[np.uint8]
Picture = bytes | Grey
"""A PNG, JPEG, BMP, TIFF or WebP file, or grey values (rows, columns)."""

LARGEST_PIXELS: Final = 64_000_000
LARGEST_BYTES: Final = 64 * 1024 * 1024
SMALLEST: Final = 64
"""Minimum width and height, px."""

_FORMATS: Final = ("PNG", "JPEG", "BMP", "TIFF", "WEBP")
_ENDS: Final = {"PNG": b"IEND\xaeB`\x82", "JPEG": b"\xff\xd9"}
_MEASURED: Final = (640, 480)
"""Size at which sharpness is measured (protocol), px."""


class InvalidPicture(InvalidData):
    """A file is not an image, is damaged, or is too large."""

    code = "invalid_picture"


def grey_of(picture: Picture, name: str = "the picture") -> Grey:
    """Return the grey values of an image, rows × columns. The orientation in Exif data is ignored.

    Raises:
        InvalidPicture: It is not an image, is damaged, in colour where grey values are expected, smaller than SMALLEST,
            or larger than LARGEST_PIXELS or LARGEST_BYTES.
    """
    if isinstance(picture, np.ndarray):
        if picture.ndim != 2 or picture.dtype != np.uint8:
            raise InvalidPicture(f"{name} must have grey values of 8 bit, not {picture.dtype} of shape {picture.shape}")
        _check_size(picture.shape[1], picture.shape[0], name)
        return np.ascontiguousarray(picture)
    if not picture:
        raise InvalidPicture(f"{name} is empty")
    if len(picture) > LARGEST_BYTES:
        raise InvalidPicture(f"{name} is too large: {len(picture) / 2**20:.0f} MiB, maximum {LARGEST_BYTES >> 20} MiB")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(picture), formats=_FORMATS) as header:
                (width, height), kind = header.size, header.format or ""
    except Image.DecompressionBombError as error:
        raise InvalidPicture(f"{name} has too many pixels", str(error)) from error
    except (OSError, ValueError, SyntaxError) as error:
        raise InvalidPicture(
            f"{name} is not an image in a supported format (PNG, JPEG, BMP, TIFF, WebP)", str(error)
        ) from error
    _check_size(width, height, name)
    end = _ENDS.get(kind)
    if end is not None and end not in picture[-4096:]:
        raise InvalidPicture(f"{name} is damaged: its end is missing", f"{kind}, {len(picture)} bytes")
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        grey = cv2.imdecode(np.frombuffer(picture, np.uint8), flags)
    except cv2.error as error:
        raise InvalidPicture(f"{name} is damaged", str(error)) from error
    if grey is None or grey.shape != (height, width) or grey.dtype != np.uint8:
        raise InvalidPicture(f"{name} is damaged, or of an unsupported kind", kind)
    return np.asarray(grey, dtype=np.uint8)


def one_by_one(pictures: Iterable[Picture]) -> Iterator[Grey]:
    """Yield the grey values of images, all of one size.

    Raises:
        InvalidPicture: An image is invalid or has another size; the message names it.
    """
    first: tuple[int, ...] = ()
    for index, each in enumerate(pictures):
        grey = grey_of(each, f"picture {index}")
        first = first or grey.shape
        if grey.shape != first:
            raise InvalidPicture(
                f"picture {index} is {grey.shape[1]} × {grey.shape[0]}, the first one {first[1]} × {first[0]}: "
                "take all of them with one camera in one mode"
            )
        yield grey


def sharpness_of(grey: Grey) -> float:
    """Return the variance of the Laplacian at 640 × 480, the protocol's measure of sharpness."""
    small = cv2.resize(grey, _MEASURED)
    return float(cv2.Laplacian(small, cv2.CV_64F).var())


def _check_size(width: int, height: int, name: str) -> None:
    """Require a supported size.

    Raises:
        InvalidPicture: The image is too large or too small.
    """
    if width * height > LARGEST_PIXELS:
        raise InvalidPicture(
            f"{name} is too large: {width} × {height}, maximum {LARGEST_PIXELS // 10**6} million pixels"
        )
    if min(width, height) < SMALLEST:
        raise InvalidPicture(f"{name} is too small: {width} × {height}, minimum {SMALLEST} × {SMALLEST}")
