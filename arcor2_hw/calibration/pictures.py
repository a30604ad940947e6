"""Pictures as they come: files or grey values, checked before anything is decoded."""

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
"""Least width and height."""

_FORMATS: Final = ("PNG", "JPEG", "BMP", "TIFF", "WEBP")
_ENDS: Final = {"PNG": b"IEND\xaeB`\x82", "JPEG": b"\xff\xd9"}
_MEASURED: Final = (640, 480)
"""Size at which sharpness is measured, by the protocol."""


class InvalidPicture(InvalidData):
    """What was given is no picture, is damaged, or is too large."""

    code = "invalid_picture"


def grey_of(picture: Picture, name: str = "the picture") -> Grey:
    """Give the grey values of a picture, rows × columns. A note on how it should be turned (Exif) is not followed.

    Raises InvalidPicture: none, damaged, colour where grey values were expected, less than SMALLEST on a side, more
    than LARGEST_PIXELS or LARGEST_BYTES.
    """
    if isinstance(picture, np.ndarray):
        if picture.ndim != 2 or picture.dtype != np.uint8:
            raise InvalidPicture(f"{name} has to be grey values of 8 bit, not {picture.dtype} of shape {picture.shape}")
        _check_size(picture.shape[1], picture.shape[0], name)
        return np.ascontiguousarray(picture)
    if not picture:
        raise InvalidPicture(f"{name} is empty")
    if len(picture) > LARGEST_BYTES:
        raise InvalidPicture(f"{name} is too large: {len(picture) / 2**20:.0f} MiB of at most {LARGEST_BYTES >> 20}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(picture), formats=_FORMATS) as header:
                (width, height), kind = header.size, header.format or ""
    except Image.DecompressionBombError as error:
        raise InvalidPicture(f"{name} has too many pixels", str(error)) from error
    except (OSError, ValueError, SyntaxError) as error:
        raise InvalidPicture(
            f"{name} is no picture that can be read (PNG, JPEG, BMP, TIFF, WebP)", str(error)
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
        raise InvalidPicture(f"{name} is damaged, or of a kind that is not read", kind)
    return np.asarray(grey, dtype=np.uint8)


def one_by_one(pictures: Iterable[Picture]) -> Iterator[Grey]:
    """Give the grey values of pictures, all of one size. Raises InvalidPicture, naming the picture."""
    first: tuple[int, ...] = ()
    for index, each in enumerate(pictures):
        grey = grey_of(each, f"picture {index}")
        first = first or grey.shape
        if grey.shape != first:
            raise InvalidPicture(
                f"picture {index} is {grey.shape[1]} × {grey.shape[0]}, the first one {first[1]} × {first[0]}: "
                "the pictures have to be of one camera in one mode"
            )
        yield grey


def sharpness_of(grey: Grey) -> float:
    """Give the variance of the Laplacian at 640 × 480, as the protocol measures blur."""
    small = cv2.resize(grey, _MEASURED)
    return float(cv2.Laplacian(small, cv2.CV_64F).var())


def _check_size(width: int, height: int, name: str) -> None:
    """Raise InvalidPicture for a size that is not taken."""
    if width * height > LARGEST_PIXELS:
        raise InvalidPicture(
            f"{name} is too large: {width} × {height}, at most {LARGEST_PIXELS // 10**6} million pixels"
        )
    if min(width, height) < SMALLEST:
        raise InvalidPicture(f"{name} is too small to show anything: {width} × {height}")
