"""What pictures show of a layout: from files to corners of known place, or a refusal that says what is missing."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from arcor2_hw.calibration.boards import CORNER_DEVIATION, board_of, check_layout, measured_board, seen_of_board
from arcor2_hw.calibration.edges import Measured
from arcor2_hw.calibration.layout import Layout, MarkerDictionary
from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.markers import detect, measured
from arcor2_hw.calibration.pictures import Grey, sharpness_of
from arcor2_hw.calibration.pose_problem import Seen
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason

_RESOLVED: Final = 0.25
"""Part of a cell's width that an edge may be wide (standard deviation); what is wider cannot be measured there."""
_SHARP: Final = 1.4
"""px, that any edge may be wide."""


@dataclass(frozen=True)
class Sighting:
    """What is seen, and how sharp it is. blur: px, standard deviation of the markers' edges, NaN without markers."""

    seen: list[Seen]
    blur: float


def sight_of(greys: Sequence[Grey], lens: Lens, layout: Layout, blur_threshold: float, largest_blur: float) -> Sighting:
    """Find what of a layout is in the pictures.

    Raises CalibrationRefused: nothing of it is (NO_MARKER), pictures are blurred (BLURRED), a marker is there twice
    (IMPLAUSIBLE); InvalidData, Conflict for a layout that cannot be.
    """
    check_layout(layout)
    if not layout.markers and not layout.boards:
        raise CalibrationRefused("No marker is configured: say which ones stand where.", reason=Reason.NO_MARKER)
    seen: list[Seen] = []
    blurs: list[float] = []
    others: set[int] = set()
    for picture, grey in enumerate(greys):
        name = "The picture" if len(greys) == 1 else f"Picture {picture}"
        here, widths, strangers = _in_picture(grey, picture, lens, layout, name)
        others |= strangers
        typical = float(np.median([blur for blur, _ in widths])) if widths else float("nan")
        if np.median([blur / min(largest_blur, max(_RESOLVED * cell, _SHARP)) for blur, cell in widths] or [0.0]) > 1.0:
            raise CalibrationRefused(
                f"{name} is blurred: the markers' edges are {typical:.1f} px wide. Is the camera in focus, and did it "
                "stand still?",
                f"at most {largest_blur:.1f} px, and a quarter of a cell",
                Reason.BLURRED,
            )
        measured_at_all = bool(widths) or any(each.square is None for each in here)
        if not measured_at_all and not strangers and (sharpness := sharpness_of(grey)) < blur_threshold:
            raise CalibrationRefused(
                f"{name} is blurred, or shows nothing at all. Is the camera in focus, the lens clean and the light on?",
                f"variance of the Laplacian {sharpness:.0f}, at least {blur_threshold:.0f}",
                Reason.BLURRED,
            )
        seen += here
        blurs += [blur for blur, _ in widths]
    if not seen:
        raise CalibrationRefused(_missing(layout, others), reason=Reason.NO_MARKER)
    return Sighting(seen, float(np.median(blurs)) if blurs else float("nan"))


def _in_picture(
    grey: Grey, picture: int, lens: Lens, layout: Layout, name: str
) -> tuple[list[Seen], list[tuple[float, float]], set[int]]:
    """Give what is seen in one picture, widths of markers' edges and cells, and numbers of markers not listed."""
    found: dict[MarkerDictionary, list[tuple[int, Array]]] = {}
    for dictionary in {layout.dictionary} | {board.dictionary for board in layout.boards}:
        own_boards = [board for board in layout.boards if board.dictionary == dictionary]
        enough = sum(board.columns * board.rows // 4 for board in own_boards)
        found[dictionary] = detect(grey, dictionary, enough or min(2, len(layout.markers)))
    listed = {marker.marker_id: marker for marker in layout.markers}
    own = [each for each in found[layout.dictionary] if each[0] in listed]
    numbers = [number for number, _ in own]
    for number in set(numbers):
        if numbers.count(number) > 1:
            raise CalibrationRefused(
                f"{name} shows marker {number} {numbers.count(number)} times: remove or cover the others.",
                reason=Reason.IMPLAUSIBLE,
            )
    seen: list[Seen] = []
    widths: list[tuple[float, float]] = []
    for each in measured(grey, lens, layout.dictionary, own):
        marker = listed[each.number]
        size = float(marker.size) if isinstance(marker.size, float | int) else layout.size
        seen.append(seen_marker(each, marker.pose.matrix(), size, picture))
        if np.isfinite(each.blur):
            widths.append((each.blur, each.cell))
    used = set(numbers)
    for index, board in enumerate(layout.boards):
        made = board_of(board)
        fine = measured_board(grey, lens, board, made, found[board.dictionary])
        if fine is not None:
            pixels, points, root = fine[0].corners, fine[1], root_of(fine[0])
        else:
            points, pixels = seen_of_board(grey, board, made, found[board.dictionary])
            root = np.eye(2 * len(points)) / CORNER_DEVIATION
        used |= set(range(board.first_id, board.first_id + board.columns * board.rows // 2))
        if len(points):
            origin_from_board = board.pose.matrix()
            seen.append(
                Seen(
                    f"board {index}",
                    ("board", index),
                    picture,
                    points @ origin_from_board[:3, :3].T + origin_from_board[:3, 3],
                    pixels,
                    root,
                    origin_from_board[:3, 2],
                    origin_from_board[:3, 3],
                )
            )
    return seen, widths, {number for each in found.values() for number, _ in each} - used


def root_of(each: Measured) -> Array:
    """Give the square root of the information of a measured marker."""
    return np.asarray(np.linalg.cholesky(each.information).T, dtype=np.float64)


def seen_marker(each: Measured, origin_from_marker: Array, size: float, picture: int) -> Seen:
    """Give a measured marker as part of a problem."""
    half = size / 2
    corners = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
    return Seen(
        f"marker {each.number}",
        ("marker", each.number),
        picture,
        corners @ origin_from_marker[:3, :3].T + origin_from_marker[:3, 3],
        each.corners,
        root_of(each),
        origin_from_marker[:3, 2],
        origin_from_marker[:3, 3],
        origin_from_marker,
        size,
    )


def _missing(layout: Layout, others: set[int]) -> str:
    """Say that nothing of a layout was seen, and what was seen instead."""
    wanted = [f"marker {marker.marker_id}" for marker in layout.markers[:8]]
    wanted += [f"a board of {board.columns} × {board.rows} squares" for board in layout.boards]
    text = f"None of what is configured is in sight: {', '.join(wanted)}."
    if others:
        text += f" There are markers that are not configured: {', '.join(map(str, sorted(others)[:8]))}."
    return text
