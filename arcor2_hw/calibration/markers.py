"""Detection of markers in images, and measurement of their corners to a hundredth of a pixel."""

from collections import defaultdict
from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.edges import Chart, Measured, chart_of, measure
from arcor2_hw.calibration.layout import MarkerDictionary
from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.pictures import Grey, Picture, grey_of
from arcor2_hw.data.camera import CameraParameters, Corner, MarkerCorners

_COARSE: Final = 0.5
"""Standard deviation of a detected corner where the edges could not be measured, px."""


_SEARCHES: Final = (((29,), 15.0), ((13, 33), 6.0))
"""Windows (px) of the local threshold, and the difference of a marker to its surroundings (grey levels)."""
_MARGIN: Final = 8
"""Margin around a marker that is processed, px."""
_STRAIGHT: Final = 0.1
"""Shift of edges up to which a tone curve is correct, px."""
_LEVELS: Final = np.arange(256) / 255.0
_SRGB: Final = np.where(_LEVELS <= 0.04045, _LEVELS / 12.92, ((_LEVELS + 0.055) / 1.055) ** 2.4)
TONES: Final = (_SRGB.astype(np.float32), _LEVELS.astype(np.float32))
"""Brightness by grey value (IEC 61966-2-1, and linear)."""


def dictionary_number(dictionary: MarkerDictionary) -> int:
    """Return OpenCV's number of a dictionary."""
    prefix = "DICT_" if dictionary[0].isdigit() else "DICT_ARUCO_"
    if dictionary.startswith("apriltag"):
        prefix = "DICT_"
    return int(getattr(cv2.aruco, prefix + dictionary.upper()))


def dictionary_size(dictionary: MarkerDictionary) -> int:
    """Return the number of markers in a dictionary."""
    return len(cv2.aruco.getPredefinedDictionary(dictionary_number(dictionary)).bytesList)


def detect(grey: Grey, dictionary: MarkerDictionary, enough: int = 1000) -> list[tuple[int, Array]]:
    """Detect markers: number and corners (4, 2), px, to about one pixel. Duplicates at one place are merged.

    An image with fewer than `enough` markers is searched again for markers of low contrast.
    """
    family = cv2.aruco.getPredefinedDictionary(dictionary_number(dictionary))
    result: list[tuple[int, Array]] = []
    for windows, offset in _SEARCHES:
        settings = cv2.aruco.DetectorParameters()
        settings.adaptiveThreshWinSizeMin = windows[0]
        settings.adaptiveThreshWinSizeMax = windows[-1]
        settings.adaptiveThreshWinSizeStep = max(windows[-1] - windows[0], 1)
        settings.adaptiveThreshConstant = offset
        settings.minMarkerPerimeterRate = 0.02
        found: Any = cv2.aruco.ArucoDetector(family, settings).detectMarkers(grey)
        corners, numbers = found[0], found[1]
        for number, each in zip(np.ravel(numbers) if numbers is not None else (), corners, strict=True):
            at = np.asarray(each, dtype=np.float64).reshape(4, 2)
            near = float(np.linalg.norm(at[0] - at[2])) / 4
            if not any(n == number and float(np.linalg.norm(c.mean(0) - at.mean(0))) < near for n, c in result):
                result.append((int(number), at))
        if len(result) >= enough:
            break
    return result


def measured(grey: Grey, lens: Lens, dictionary: MarkerDictionary, found: list[tuple[int, Array]]) -> list[Measured]:
    """Measure the corners of detected markers; where edges cannot be measured, the detected corners are used.

    Grey values are converted to brightness by one of two tone curves, sRGB or linear: the one with which the edges of
    the largest marker are where they should be.
    """
    family = dictionary_number(dictionary)
    result: dict[int, Measured] = {}
    tone = TONES[0]
    for index in sorted(range(len(found)), key=lambda i: -float(np.linalg.norm(np.ptp(found[i][1], axis=0)))):
        number, corners = found[index]
        chart = chart_of(family, number)
        fine = _measured(grey, tone, lens, chart, number, corners)
        if not result and (fine is None or abs(fine.shift) > _STRAIGHT):
            other = _measured(grey, TONES[1], lens, chart, number, corners)
            if other is not None and (fine is None or abs(other.shift) < abs(fine.shift)):
                fine, tone = other, TONES[1]
        result[index] = fine or Measured(number, corners, np.eye(8) / _COARSE**2, float("nan"), 0.0, 0.0, 0.0)
    return [result[index] for index in range(len(found))]


def _measured(
    grey: Grey, tone: npt.NDArray[np.float32], lens: Lens, chart: Chart, number: int, corners: Array
) -> Measured | None:
    """Measure one marker in its part of the image."""
    left, top = np.maximum(np.floor(corners.min(axis=0)) - _MARGIN, 0).astype(int)
    right, bottom = np.ceil(corners.max(axis=0)).astype(int) + _MARGIN
    light = cv2.LUT(grey[top:bottom, left:right], tone)
    return measure(np.asarray(light, dtype=np.float32), (float(left), float(top)), lens, chart, number, corners)


def find_marker_corners(
    picture: Picture, parameters: CameraParameters, dictionary: MarkerDictionary = "4x4_50"
) -> list[MarkerCorners]:
    """Return the corners of every marker in an image, configured or not, ordered by id.

    Corners are in px of the distorted image, clockwise from the upper left of the printed marker. A marker that appears
    twice is returned twice.

    Raises:
        InvalidPicture: As in `find_camera_pose`.
        InvalidData: As in `find_camera_pose`.
    """
    grey = grey_of(picture)
    lens = Lens(parameters, grey.shape[1], grey.shape[0])
    by_number: defaultdict[int, list[MarkerCorners]] = defaultdict(list)
    for each in measured(grey, lens, dictionary, detect(grey, dictionary)):
        corners = [Corner(float(x), float(y)) for x, y in each.corners]
        by_number[each.number].append(MarkerCorners(each.number, corners))
    return [each for number in sorted(by_number) for each in by_number[number]]
