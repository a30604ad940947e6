"""ChArUco boards: their corners, detection and measurement, and validation of their descriptions."""

import math
from dataclasses import replace
from typing import Any, Final

import cv2
import numpy as np

from arcor2_hw.calibration.edges import PLACES_PER_EDGE, Chart, Measured, measure
from arcor2_hw.calibration.layout import CharucoBoard, Layout
from arcor2_hw.calibration.lens import Array, Lens
from arcor2_hw.calibration.markers import TONES, dictionary_number, dictionary_size
from arcor2_hw.calibration.pictures import Grey
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import Conflict, InvalidData

CORNER_DEVIATION: Final = 0.05
"""Standard deviation of a measured corner between squares, px."""
_MARGIN: Final = 8
"""Margin around a board that is processed, px."""
_EDGE_FLOOR: Final = 0.03
"""Standard deviation of a corner of a board in addition to the scatter of its edges, px."""
MAX_BOARD: Final = 64
"""Maximum number of columns and rows."""
MIN_CORNERS: Final = 6
"""Number of corners below which a board counts as not detected."""


def board_of(board: CharucoBoard) -> cv2.aruco.CharucoBoard:
    """Return OpenCV's board.

    Raises:
        InvalidData: The description is invalid.
    """
    if not (2 <= board.columns <= MAX_BOARD and 2 <= board.rows <= MAX_BOARD):
        raise InvalidData(
            "a board of {columns} × {rows} squares: columns and rows must be 2 to {largest_board}",
            columns=board.columns,
            rows=board.rows,
            largest_board=MAX_BOARD,
        )
    if board.columns * board.rows < 6:
        raise InvalidData(
            "a board of {columns} × {rows} squares has too few corners", columns=board.columns, rows=board.rows
        )
    if not (math.isfinite(board.square) and 0 < board.marker < board.square):
        raise InvalidData(
            "the marker of a board ({marker} m) must be smaller than its square ({square} m)",
            marker=board.marker,
            square=board.square,
        )
    last = board.first_id + board.columns * board.rows // 2 - 1
    size = dictionary_size(board.dictionary)
    if board.first_id < 0 or last >= size:
        raise InvalidData(
            "the markers {first_id} to {last} of the board are not all in {dictionary} (0 to {size})",
            first_id=board.first_id,
            last=last,
            dictionary=board.dictionary,
            size=size - 1,
        )
    check_pose(board.pose, "the board's pose")
    numbers = np.arange(board.first_id, last + 1)
    family = cv2.aruco.getPredefinedDictionary(dictionary_number(board.dictionary))
    made = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square, board.marker, family, numbers)
    made.setLegacyPattern(board.legacy_pattern)
    return made


def board_points(board: CharucoBoard, made: cv2.aruco.CharucoBoard) -> Array:
    """Return the corners between squares in the frame of the board (origin in the middle, y up, z out), (n, 3), m."""
    points = np.asarray(made.getChessboardCorners(), dtype=np.float64)
    middle = np.array([board.columns, board.rows]) * board.square / 2
    return np.column_stack((points[:, 0] - middle[0], middle[1] - points[:, 1], np.zeros(len(points))))


def board_observations(
    grey: Grey, board: CharucoBoard, made: cv2.aruco.CharucoBoard, found: list[tuple[int, Array]]
) -> tuple[Array, Array]:
    """Return the corners of a board that are detected, (n, 3) in its frame, and their pixels, (n, 2)."""
    last = board.first_id + board.columns * board.rows // 2 - 1
    own = [(number, corners) for number, corners in found if board.first_id <= number <= last]
    nothing = np.zeros((0, 3)), np.zeros((0, 2))
    if len(own) < 2:
        return nothing
    numbers = np.array([[number] for number, _ in own], dtype=np.int32)
    corners = [np.asarray(each, dtype=np.float32).reshape(1, 4, 2) for _, each in own]
    detector = cv2.aruco.CharucoDetector(made)
    result: Any = detector.detectBoard(grey, markerCorners=corners, markerIds=numbers)
    pixels, ids = result[0], result[1]
    if ids is None or len(ids) < MIN_CORNERS:
        return nothing
    points = board_points(board, made)[np.ravel(ids)]
    # Corners on one line do not determine a rotation.
    if np.linalg.svd(points[:, :2] - points[:, :2].mean(axis=0), compute_uv=False)[1] < 0.5 * board.square:
        return nothing
    return points, np.asarray(pixels, dtype=np.float64).reshape(-1, 2)


def measured_board(
    grey: Grey, lens: Lens, board: CharucoBoard, made: cv2.aruco.CharucoBoard, found: list[tuple[int, Array]]
) -> tuple[Measured, Array] | None:
    """Measure a board by the edges of its squares, as if it was one large marker.

    Returns:
        The outermost corners between squares and their positions in the frame of the board, (4, 3), m. None when too
        few of its markers are detected, or its edges are not at the expected places.
    """
    last = board.first_id + board.columns * board.rows // 2 - 1
    own = [(number, corners) for number, corners in found if board.first_id <= number <= last]
    if len(own) < 2:
        return None
    half = np.array([board.columns, board.rows]) * board.square / 2
    placed = np.asarray(made.getObjPoints(), dtype=np.float64)[:, :, :2]
    unit = (board.square - board.marker) / 2
    model = np.concatenate([placed[number - board.first_id] for number, _ in own])
    model = np.column_stack((model[:, 0] - half[0], half[1] - model[:, 1])) / unit
    rays = lens.rays(np.concatenate([corners for _, corners in own]))
    matrix, _ = cv2.findHomography(model, rays, cv2.LMEDS)
    if matrix is None:
        return None
    chart = _chart(board, placed.mean(axis=1))
    outer = np.column_stack((chart.corners, np.ones(4))) @ np.asarray(matrix, dtype=np.float64).T
    if outer[:, 2].min() <= 0:
        return None
    start = lens.pixels(outer[:, :2] / outer[:, 2:])
    if not (np.all(np.isfinite(start)) and np.abs(start).max() < 4 * lens.width):
        return None
    (left, top), (right, bottom) = start.min(axis=0) - _MARGIN, start.max(axis=0) + _MARGIN
    left, top = max(int(left), 0), max(int(top), 0)
    light = cv2.LUT(grey[top : max(int(bottom), top + 1), left : max(int(right), left + 1)], TONES[0])
    result = measure(np.asarray(light, dtype=np.float32), (left, top), lens, chart, board.first_id, start)
    if result is None:
        return None
    # The border of a marker is as near to an edge as the margin is wide; in a small or blurred image it shifts the
    # edge.
    covariance = np.linalg.inv(result.information) + _EDGE_FLOOR**2 * np.eye(8)
    known = replace(result, information=np.asarray(np.linalg.inv(covariance), dtype=np.float64))
    return known, np.column_stack((chart.corners * unit, np.zeros(4)))


def _chart(board: CharucoBoard, white: Array) -> Chart:
    """Return the edges between squares, in units of the margin around markers, from the middle (x right, y up).

    Args:
        board: The board.
        white: Middles of the squares with markers, from the upper left corner (x right, y down), m.
    """
    side = 2 * board.square / (board.square - board.marker)
    light = np.zeros((board.rows, board.columns), dtype=bool)
    light[(white[:, 1] / board.square).astype(int), (white[:, 0] / board.square).astype(int)] = True
    fractions = (np.arange(PLACES_PER_EDGE) + 0.5) / PLACES_PER_EDGE
    points, across, towards = [], [], []
    for row in range(board.rows):
        for column in range(board.columns):
            if column:
                points.append(np.column_stack((np.full(PLACES_PER_EDGE, column), row + fractions)))
                across.append(0)
                towards.append(1.0 if light[row, column] else -1.0)
            if row:
                points.append(np.column_stack((column + fractions, np.full(PLACES_PER_EDGE, row))))
                across.append(1)
                towards.append(-1.0 if light[row, column] else 1.0)
    flat = np.concatenate(points)
    half = np.array([board.columns, board.rows]) / 2
    x, y = half - 1
    return Chart(
        np.column_stack((flat[:, 0] - half[0], half[1] - flat[:, 1])) * side,
        np.repeat(np.array(across, dtype=np.intp), PLACES_PER_EDGE),
        np.repeat(np.array(towards), PLACES_PER_EDGE),
        np.tile(np.minimum(fractions, 1 - fractions), len(points)) * side,
        np.array([[-x, y], [x, y], [x, -y], [-x, -y]]) * side,
    )


def check_layout(layout: Layout) -> None:
    """Require a valid layout.

    Raises:
        InvalidData: A marker is invalid; the message names it.
        Conflict: A marker is listed twice; the message names it.
    """
    listed: set[tuple[str, int]] = set()
    size = dictionary_size(layout.dictionary)
    for marker in layout.markers:
        number = marker.marker_id
        if not 0 <= number < size:
            raise InvalidData(
                "marker {number} is not in the dictionary {dictionary} (0 to {size})",
                number=number,
                dictionary=layout.dictionary,
                size=size - 1,
            )
        if (layout.dictionary, number) in listed:
            raise Conflict("marker {number} is listed twice", number=number)
        listed.add((layout.dictionary, number))
        side = layout.size if not isinstance(marker.size, float | int) else marker.size
        if not (math.isfinite(side) and 0 < side < 10):
            raise InvalidData(
                "the size of marker {number} must be positive, in m, not {side}", number=number, side=side
            )
        check_pose(marker.pose, f"the pose of marker {number}")
    for index, board in enumerate(layout.boards):
        board_of(board)
        for number in range(board.first_id, board.first_id + board.columns * board.rows // 2):
            if (board.dictionary, number) in listed:
                raise Conflict("marker {number} of board {index} is listed twice", number=number, index=index)
            listed.add((board.dictionary, number))


def check_pose(pose: Pose, name: str) -> None:
    """Require a finite pose of plausible size.

    Raises:
        InvalidData: A number is not finite or too large.
    """
    numbers = (*pose.position, *pose.orientation)
    if not all(map(math.isfinite, numbers)) or max(map(abs, pose.position)) > 1000:
        raise InvalidData("{name} must be finite, in m", str(numbers), name=name)
