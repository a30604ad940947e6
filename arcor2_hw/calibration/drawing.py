"""Images of errors, in which a technician sees which marker or view does not fit."""

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.lens import Array

Canvas = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]

WHITE: Final[Colour] = (255, 255, 255)
DARK: Final[Colour] = (60, 50, 40)
PALE: Final[Colour] = (225, 220, 215)
FRAME: Final[Colour] = (150, 140, 130)
GOOD: Final[Colour] = (90, 160, 30)
BAD: Final[Colour] = (40, 40, 220)
LINES: Final[tuple[Colour, ...]] = (
    (180, 110, 30),
    (30, 130, 220),
    (90, 160, 30),
    (160, 60, 160),
    (40, 40, 200),
    (120, 120, 20),
)
"""Colours as blue, green, red; distinguishable with red-green colour blindness."""

_WIDTH: Final = 900
_SIDE: Final = 320
_HEAD: Final = 64
_ARROW: Final = 36.0
"""Length of the arrow for the 95th percentile of errors, px."""
_BARS: Final = 40


def png_of(canvas: Canvas) -> bytes:
    """Encode an image as a PNG file."""
    done, data = cv2.imencode(".png", canvas)
    assert done
    return bytes(data.tobytes())


def write(canvas: Canvas, text: str, at: tuple[int, int], colour: Colour = DARK, size: float = 0.5) -> None:
    """Write a line of text; characters that the font lacks (×, °, ±) are replaced."""
    for letter, instead in (("×", "x"), ("°", " deg"), ("±", "+-"), ("–", "-"), ("…", "...")):
        text = text.replace(letter, instead)
    cv2.putText(canvas, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, colour, 1, cv2.LINE_AA)


def arrow(canvas: Canvas, start: Array, end: Array, colour: Colour) -> None:
    """Draw an arrow between two points, px."""
    a, b = (tuple(round(float(v) * 16) for v in p) for p in (start, end))
    cv2.line(canvas, (a[0], a[1]), (b[0], b[1]), colour, 1, cv2.LINE_AA, 4)
    cv2.circle(canvas, (a[0], a[1]), 24, colour, -1, cv2.LINE_AA, 4)


def magnification(errors: Sequence[Array]) -> float:
    """Return the factor by which errors are enlarged, a round number."""
    together = np.concatenate([np.linalg.norm(each, axis=1) for each in errors if len(each)] or [np.zeros(1)])
    typical = max(float(np.percentile(together, 95)), 1e-6)
    wanted = max(_ARROW / typical, 1.0)
    power = 10 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1, 2, 5) if step * power <= wanted))


def error_picture(
    size: tuple[int, int], views: Sequence[tuple[str, Array, Array, bool]], title: str, left: Canvas | None = None
) -> bytes:
    """Draw corners and their errors, and a bar for each view.

    Args:
        size: Width and height of the camera's images, px.
        views: Name, corners (n, 2) in px, errors (n, 2) in px, and whether the view was used.
        title: First line of text.
        left: Background of the size of the images instead of an empty field.

    Returns:
        A PNG file.
    """
    scale = _WIDTH / size[0]
    height = max(round(size[1] * scale), 24 * 4)
    canvas: Canvas = np.full((height + _HEAD, _WIDTH + _SIDE, 3), 255, np.uint8)
    field = canvas[_HEAD:, :_WIDTH]
    if left is not None:
        field[...] = cv2.resize(left, (_WIDTH, height), interpolation=cv2.INTER_AREA)
    else:
        for index in range(1, 8):
            cv2.line(field, (index * _WIDTH // 8, 0), (index * _WIDTH // 8, height), PALE, 1)
            cv2.line(field, (0, index * height // 6), (_WIDTH, index * height // 6), PALE, 1)
    larger = magnification([errors for _, _, errors, used in views if used])
    for index, (_, corners, errors, used) in enumerate(views):
        colour = LINES[index % len(LINES)] if used else FRAME
        for corner, error in zip(corners, errors, strict=True):
            arrow(field, corner * scale, corner * scale + np.clip(error * larger, -200, 200), colour)
    cv2.rectangle(canvas, (0, _HEAD), (_WIDTH - 1, _HEAD + height - 1), FRAME, 1)
    write(canvas, title, (10, 26), size=0.6)
    write(canvas, f"Arrows: errors, enlarged {larger:.0f} times. Grey: not used.", (10, 50))
    _bars(canvas[_HEAD:, _WIDTH:], views)
    write(canvas, "rms error per picture, px", (_WIDTH + 12, 50))
    return png_of(canvas)


def _bars(field: Canvas, views: Sequence[tuple[str, Array, Array, bool]]) -> None:
    """Draw the error of each view as a bar; of many views only the worst."""
    values = [
        (float(np.sqrt(np.mean(np.sum(errors**2, axis=1)))) if len(errors) else 0.0, index)
        for index, (_, _, errors, _) in enumerate(views)
    ]
    if len(values) > _BARS:
        values = sorted(sorted(values, reverse=True)[:_BARS], key=lambda each: each[1])
    most = max([value for value, index in values if views[index][3]] or [1.0]) or 1.0
    step = max(min(field.shape[0] // max(len(values), 1), 26), 4)
    for row, (value, index) in enumerate(values):
        name, _, _, used = views[index]
        top = row * step + 2
        length = int(min(value / most, 1.15) * 150)
        cv2.rectangle(
            field, (110, top), (110 + length, top + step - 3), LINES[index % len(LINES)] if used else FRAME, -1
        )
        if step >= 10:
            write(field, name, (12, top + step - 6), size=0.38)
            write(field, f"{value:.2f}", (116 + length, top + step - 6), size=0.38)
