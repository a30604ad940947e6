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

MAX_PIXELS: Final = 64_000_000
MAX_BYTES: Final = 64 * 1024 * 1024
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
            or larger than MAX_PIXELS or MAX_BYTES.
    """
    if isinstance(picture, np.ndarray):
        if picture.ndim != 2 or picture.dtype != np.uint8:
            raise InvalidPicture(
                "{name} must have grey values of 8 bit, not {dtype} of shape {shape}",
                name=name,
                dtype=picture.dtype,
                shape=picture.shape,
            )
        _check_size(picture.shape[1], picture.shape[0], name)
        return np.ascontiguousarray(picture)
    if not picture:
        raise InvalidPicture("{name} is empty", name=name)
    if len(picture) > MAX_BYTES:
        raise InvalidPicture(
            "{name} is too large: {count:.0f} MiB, maximum {largest_bytes} MiB",
            name=name,
            count=len(picture) / 2**20,
            largest_bytes=MAX_BYTES >> 20,
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(picture), formats=_FORMATS) as header:
                (width, height), kind = header.size, header.format or ""
    except Image.DecompressionBombError as error:
        raise InvalidPicture("{name} has too many pixels", str(error), name=name) from error
    except (OSError, ValueError, SyntaxError) as error:
        raise InvalidPicture(
            "{name} is not an image in a supported format (PNG, JPEG, BMP, TIFF, WebP)", str(error), name=name
        ) from error
    _check_size(width, height, name)
    end = _ENDS.get(kind)
    if end is not None and end not in picture[-4096:]:
        raise InvalidPicture("{name} is damaged: its end is missing", f"{kind}, {len(picture)} bytes", name=name)
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        grey = cv2.imdecode(np.frombuffer(picture, np.uint8), flags)
    except cv2.error as error:
        raise InvalidPicture("{name} is damaged", str(error), name=name) from error
    if grey is None or grey.shape != (height, width) or grey.dtype != np.uint8:
        raise InvalidPicture("{name} is damaged, or of an unsupported kind", kind, name=name)
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
                "picture {index} is {width} × {height}, the first one {first_width} × {first_height}: "
                "take all of them with one camera in one mode",
                index=index,
                width=grey.shape[1],
                height=grey.shape[0],
                first_width=first[1],
                first_height=first[0],
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
    if width * height > MAX_PIXELS:
        raise InvalidPicture(
            "{name} is too large: {width} × {height}, maximum {largest_pixels} million pixels",
            name=name,
            width=width,
            height=height,
            largest_pixels=MAX_PIXELS // 10**6,
        )
    if min(width, height) < SMALLEST:
        raise InvalidPicture(
            "{name} is too small: {width} × {height}, minimum {smallest} × {smallest}",
            name=name,
            width=width,
            height=height,
            smallest=SMALLEST,
        )
