"""Pictures as they come: files or grey values, checked before anything is decoded."""

from typing import Final

import numpy as np
import numpy.typing as npt

from arcor2_hw.exceptions import InvalidData

Grey = npt.NDArray[np.uint8]
Picture = bytes | Grey
"""A PNG, JPEG, BMP, TIFF or WebP file, or grey values (rows, columns)."""

LARGEST_PIXELS: Final = 64_000_000
LARGEST_BYTES: Final = 64 * 1024 * 1024


class InvalidPicture(InvalidData):
    """What was given is no picture, is damaged, or is too large."""

    code = "invalid_picture"


def grey_of(picture: Picture, name: str = "the picture") -> Grey:
    """Give the grey values of a picture, rows × columns. A note on how it should be turned (Exif) is not followed.

    Raises InvalidPicture: none, damaged, colour where grey values were expected, more than LARGEST_PIXELS or
    LARGEST_BYTES.
    """
    raise NotImplementedError
