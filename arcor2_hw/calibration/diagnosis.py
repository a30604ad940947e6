"""The reason why an image has no usable marker: empty image, blur, mirroring, glare, or hidden markers."""

import math
from collections.abc import Mapping
from typing import Final

import cv2
import numpy as np

from arcor2_hw.calibration.layout import Layout, MarkerDictionary
from arcor2_hw.calibration.markers import detect
from arcor2_hw.calibration.pictures import Grey, sharpness_of
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.messages import Message

_UNIFORM: Final = 12.0
"""Contrast (99th percentile) below which an image shows nothing, grey levels."""
_DARK, _LIGHT = 40.0, 235.0
"""Mean grey levels below and above which a uniform image is dark or overexposed."""
_SATURATED: Final = 250
_GLARE: Final = 0.005
"""Fraction of an image in saturated areas above which it has glare."""
_SPOT: Final = 9
"""Side of the smallest saturated area that counts, px."""
_WINDOW: Final = 25
"""Side of the window in which the contrast of an edge is taken, px."""
_SMOOTHING: Final = 1.0
"""Standard deviation of the smoothing against noise, px."""
_STRONG: Final = 0.6
"""Contrast of edges that are judged, as a fraction of the largest (99th percentile)."""
_STEEP: Final = 1.0
"""Minimum gradient of an edge, grey levels per px."""
_NEAR: Final = 7
"""Side of the window in which only the steepest pixel is judged, px."""
_DIRECTIONS: Final = 4
_FEWEST: Final = 10
"""Number of edge pixels below which a direction is not judged."""


def contrast_of(grey: Grey) -> float:
    """Return the contrast of an image within small windows, 99th percentile, grey levels."""
    return float(np.percentile(_contrasts(cv2.GaussianBlur(grey, (0, 0), _SMOOTHING).astype(np.float32)), 99))


def edge_width(grey: Grey) -> float:
    """Return the width of the sharpest strong edges, px (standard deviation); infinite without edges.

    Edges are judged by direction, and the widest direction counts, because motion blurs only edges that it crosses.
    A step of height c with the width s has the gradient c / (s √2π).
    """
    smooth = cv2.GaussianBlur(grey, (0, 0), _SMOOTHING).astype(np.float32)
    x, y = (cv2.Scharr(smooth, cv2.CV_32F, *order) / 32 for order in ((1, 0), (0, 1)))
    steepness, contrast = np.hypot(x, y), _contrasts(smooth)
    strong = (contrast > max(_UNIFORM, _STRONG * float(np.percentile(contrast, 99)))) & (steepness >= _STEEP)
    strong &= steepness >= cv2.dilate(steepness, np.ones((_NEAR, _NEAR), np.uint8))
    directions = np.floor(np.arctan2(y, x) / math.pi * _DIRECTIONS + 0.5).astype(int) % _DIRECTIONS
    widths = []
    for direction in range(_DIRECTIONS):
        chosen = strong & (directions == direction)
        if np.count_nonzero(chosen) >= _FEWEST:
            ratio = contrast[chosen] / np.maximum(steepness[chosen], 1e-3) / math.sqrt(math.tau)
            widths.append(float(np.percentile(ratio, 10)))
    return math.sqrt(max(max(widths) ** 2 - _SMOOTHING**2, 0.0)) if widths else math.inf


def check_visible(grey: Grey, name: Message, blur_threshold: float, largest_blur: float) -> None:
    """Require that an image without markers shows something, sharply.

    Raises:
        CalibrationRefused: It is dark, overexposed, covered or blurred.
    """
    if (sharpness := sharpness_of(grey)) >= blur_threshold:
        return
    if (contrast := contrast_of(grey)) < _UNIFORM:
        mean = float(grey.mean())
        if mean < _DARK:
            reason, text = Reason.COVERED, "{name} is dark. Uncover the lens, and check the light and the exposure."
        elif mean > _LIGHT:
            reason, text = Reason.OVEREXPOSED, "{name} is overexposed. Reduce the light or the exposure time."
        else:
            reason, text = Reason.COVERED, "{name} shows nothing. Uncover the lens, and check where the camera looks."
        raise CalibrationRefused(text, f"mean grey level {mean:.0f}, contrast {contrast:.0f}", reason, name=name)
    if (width := edge_width(grey)) > largest_blur:
        raise CalibrationRefused(
            "{name} is blurred: its edges are {width:.1f} px wide. Check the focus, and hold the camera still.",
            f"at most {largest_blur:.1f} px; variance of the Laplacian {sharpness:.0f}",
            Reason.BLURRED,
            name=name,
            width=width,
        )


def check_not_mirrored(grey: Grey, wanted: Mapping[MarkerDictionary, set[int]]) -> None:
    """Require that the mirror image does not show more of the wanted markers than the image.

    Raises:
        CalibrationRefused: It does.
    """
    mirrored = np.ascontiguousarray(grey[:, ::-1])
    for dictionary, numbers in wanted.items():
        found, direct = (sorted({n for n, _ in detect(each, dictionary)} & numbers) for each in (mirrored, grey))
        if len(found) > len(direct):
            raise CalibrationRefused(
                "The picture is mirrored: its mirror image shows marker {numbers}. Switch off "
                "mirroring in the settings of the camera, and look at the markers directly.",
                reason=Reason.MIRRORED,
                numbers=", ".join(map(str, found)),
            )


def glare_of(grey: Grey) -> float:
    """Return the fraction of an image in saturated areas, or 0 when they are small."""
    saturated = (grey >= _SATURATED).astype(np.uint8)
    spots = cv2.morphologyEx(saturated, cv2.MORPH_OPEN, np.ones((_SPOT, _SPOT), np.uint8))
    share = float(np.mean(spots))
    return share if share > _GLARE else 0.0


def wanted_markers(layout: Layout) -> dict[MarkerDictionary, set[int]]:
    """Return the numbers of all markers of a layout by dictionary, including those of boards."""
    wanted: dict[MarkerDictionary, set[int]] = {layout.dictionary: {each.marker_id for each in layout.markers}}
    for board in layout.boards:
        numbers = range(board.first_id, board.first_id + board.columns * board.rows // 2)
        wanted.setdefault(board.dictionary, set()).update(numbers)
    return wanted


def _contrasts(smooth: np.ndarray) -> np.ndarray:
    window = np.ones((_WINDOW, _WINDOW), np.uint8)
    return np.asarray(cv2.dilate(smooth, window) - cv2.erode(smooth, window))
