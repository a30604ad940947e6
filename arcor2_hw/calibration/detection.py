"""Detection of a layout in images: from files to corners of known position, or a refusal with the reason."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from arcor2_hw.calibration.boards import CORNER_DEVIATION, board_observations, board_of, check_layout, measured_board
from arcor2_hw.calibration.diagnosis import check_not_mirrored, check_visible, glare_of, wanted_markers
from arcor2_hw.calibration.edges import Measured
from arcor2_hw.calibration.layout import CharucoBoard, Layout, MarkerDictionary, item_name
from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.markers import detect, measured
from arcor2_hw.calibration.pictures import Grey
from arcor2_hw.calibration.pose_problem import DetectedTarget
from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.messages import Message

_RESOLVED: Final = 0.25
"""Maximum width (standard deviation) of an edge as a fraction of a cell's width."""
_SHARP: Final = 1.4
"""Width that any edge may have, px."""


@dataclass(frozen=True)
class Detection:
    """Detected targets, and the blur: standard deviation of edges, px, 0 where it could not be measured."""

    seen: list[DetectedTarget]
    blur: float


@dataclass
class _ImageContent:
    """Content of one image.

    Attributes:
        widths: Widths of edges and cells of markers, px.
        blurs: Widths of all measured edges, px.
        pieces: Whether there are markers of boards.
        unclear: Numbers of markers that were detected but could not be measured.
        strangers: Numbers of markers that are not listed.
    """

    seen: list[DetectedTarget] = field(default_factory=list)
    widths: list[tuple[float, float]] = field(default_factory=list)
    blurs: list[float] = field(default_factory=list)
    pieces: bool = False
    unclear: set[int] = field(default_factory=set)
    strangers: set[int] = field(default_factory=set)


def detect_layout(
    greys: Sequence[Grey], lens: Lens, layout: Layout, blur_threshold: float, largest_blur: float
) -> Detection:
    """Find the targets of a layout in images.

    Raises:
        CalibrationRefused: No target is visible (NO_MARKER; MIRRORED, OVEREXPOSED or COVERED where that is the reason),
            images are blurred (BLURRED), or a marker appears twice (IMPLAUSIBLE).
        InvalidData: The layout is invalid.
        Conflict: A marker is listed twice.
    """
    check_layout(layout)
    if not layout.markers and not layout.boards:
        raise CalibrationRefused(
            "No marker is configured. Configure the markers and their poses.", reason=Reason.NO_MARKER
        )
    contents = []
    for picture, grey in enumerate(greys):
        name = Message.of("The picture") if len(greys) == 1 else Message.of("Picture {number}", number=picture)
        content = _in_picture(grey, picture, lens, layout, name)
        _check_sharp(grey, content, name, blur_threshold, largest_blur)
        contents.append(content)
    seen = [each for content in contents for each in content.seen]
    if not seen:
        raise _missing(greys, layout, contents)
    blurs = [blur for content in contents for blur in content.blurs]
    return Detection(seen, float(np.median(blurs)) if blurs else 0.0)


def _check_sharp(grey: Grey, content: _ImageContent, name: Message, blur_threshold: float, largest_blur: float) -> None:
    """Require a sharp image.

    Raises:
        CalibrationRefused: It is blurred.
    """
    relative = [blur / min(largest_blur, max(_RESOLVED * cell, _SHARP)) for blur, cell in content.widths]
    if relative and np.median(relative) > 1.0:
        raise CalibrationRefused(
            "{name} is blurred: the markers' edges are {widths:.1f} px wide."
            " Check the focus, and hold the camera still.",
            f"at most {largest_blur:.1f} px, and a quarter of a cell",
            Reason.BLURRED,
            name=name,
            widths=np.median([blur for blur, _ in content.widths]),
        )
    # Sharp edges were measured, or something was at least recognized: sharpness is not what is missing.
    if content.blurs or ((content.strangers or content.pieces) and not content.unclear):
        return
    check_visible(grey, name, blur_threshold, largest_blur)


def _in_picture(grey: Grey, picture: int, lens: Lens, layout: Layout, name: Message) -> _ImageContent:
    """Detect and measure the targets in one image."""
    found: dict[MarkerDictionary, list[tuple[int, Array]]] = {}
    for dictionary in {layout.dictionary} | {board.dictionary for board in layout.boards}:
        own_boards = [board for board in layout.boards if board.dictionary == dictionary]
        enough = sum(board.columns * board.rows // 4 for board in own_boards)
        found[dictionary] = detect(grey, dictionary, enough or min(2, len(layout.markers)))
    listed = {marker.marker_id: marker for marker in layout.markers}
    own = [each for each in found[layout.dictionary] if each[0] in listed]
    content = _ImageContent()
    for each in measured(grey, lens, layout.dictionary, own):
        marker = listed[each.number]
        if not np.isfinite(each.blur):
            content.unclear.add(each.number)
            continue
        size = float(marker.size) if isinstance(marker.size, float | int) else layout.size
        content.seen.append(_seen_marker(each, marker.pose.matrix(), size, picture))
        content.widths.append((each.blur, each.cell))
    numbers = [each.key[1] for each in content.seen]
    for number in set(numbers):
        if numbers.count(number) > 1:
            raise CalibrationRefused(
                "{name} shows marker {number} {count} times: remove or cover the others.",
                reason=Reason.IMPLAUSIBLE,
                name=name,
                number=number,
                count=numbers.count(number),
            )
    content.blurs = [blur for blur, _ in content.widths]
    known = {(layout.dictionary, number) for number, _ in own}
    for index, board in enumerate(layout.boards):
        own_numbers = {(board.dictionary, number) for number, _ in found[board.dictionary]} & _numbers_of(board)
        content.pieces |= bool(own_numbers)
        known |= own_numbers
        _detect_board(content, grey, lens, board, index, picture, found[board.dictionary])
    content.strangers = {n for dictionary, each in found.items() for n, _ in each if (dictionary, n) not in known}
    return content


def _numbers_of(board: CharucoBoard) -> set[tuple[MarkerDictionary, int]]:
    """Return the markers of a board."""
    count = board.columns * board.rows // 2
    return {(board.dictionary, number) for number in range(board.first_id, board.first_id + count)}


def _detect_board(
    content: _ImageContent,
    grey: Grey,
    lens: Lens,
    board: CharucoBoard,
    index: int,
    picture: int,
    found: list[tuple[int, Array]],
) -> None:
    """Measure a board if it is visible."""
    made = board_of(board)
    fine = measured_board(grey, lens, board, made, found)
    if fine is not None:
        pixels, points, root = fine[0].corners, fine[1], _root_of(fine[0])
        content.blurs.append(fine[0].blur)
    else:
        points, pixels = board_observations(grey, board, made, found)
        root = np.eye(2 * len(points)) / CORNER_DEVIATION
    if len(points):
        placed = board.pose.matrix()
        in_origin = points @ placed[:3, :3].T + placed[:3, 3]
        key = ("board", index)
        content.seen.append(
            DetectedTarget(f"board {index}", key, picture, in_origin, pixels, root, placed[:3, 2], placed[:3, 3])
        )


def _root_of(marker: Measured) -> Array:
    """Return the square root of the information of a measured marker."""
    return np.asarray(np.linalg.cholesky(marker.information).T, dtype=np.float64)


def _seen_marker(marker: Measured, origin_from_marker: Array, size: float, picture: int) -> DetectedTarget:
    """Return a measured marker as part of a problem."""
    half = size / 2
    corners = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
    return DetectedTarget(
        f"marker {marker.number}",
        ("marker", marker.number),
        picture,
        corners @ origin_from_marker[:3, :3].T + origin_from_marker[:3, 3],
        marker.corners,
        _root_of(marker),
        origin_from_marker[:3, 2],
        origin_from_marker[:3, 3],
        origin_from_marker,
        size,
    )


def _missing(greys: Sequence[Grey], layout: Layout, contents: Sequence[_ImageContent]) -> CalibrationRefused:
    """Return the refusal, with the reason why no target could be used, and the visible content.

    Raises:
        CalibrationRefused: The image is mirrored.
    """
    wanted = [item_name(f"marker {marker.marker_id}") for marker in layout.markers[:8]]
    wanted += [
        Message.of("a board of {columns} × {rows} squares", columns=board.columns, rows=board.rows)
        for board in layout.boards
    ]
    unclear = sorted({number for content in contents for number in content.unclear})
    others = sorted({number for content in contents for number in content.strangers})
    glare = glare_of(greys[0])
    if unclear:
        numbers = ", ".join(map(str, unclear))
        parts = [Message.of("Marker {numbers} was recognized, but its edges cannot be measured.", numbers=numbers)]
    elif any(content.pieces for content in contents):
        text = "Too little is visible of {wanted}: only some of its markers."
        parts = [Message.of(text, wanted=Message.listed(wanted))]
    else:
        check_not_mirrored(greys[0], wanted_markers(layout))
        text = "No configured marker or board is visible: {wanted}."
        parts = [Message.of(text, wanted=Message.listed(wanted))]
        if others:
            numbers = ", ".join(map(str, others[:8]))
            parts.append(Message.of("The image has markers that are not configured: {numbers}.", numbers=numbers))
    if glare:
        overexposed = "{share:.0%} of the image is overexposed: avoid glare, and reduce the light or the exposure time."
        parts.append(Message.of(overexposed, share=glare))
        return CalibrationRefused(Message.joined(parts), reason=Reason.OVEREXPOSED)
    if not others:
        text = (
            "The image is sharp. Check that the markers are not covered, are flat, have a white margin, and are "
            "large enough in the image."
        )
        parts.append(Message.of(text))
    return CalibrationRefused(Message.joined(parts), reason=Reason.NO_MARKER)
