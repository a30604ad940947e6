"""Computes the pose of an object from points on it and their touched positions (least squares)."""

from collections.abc import Sequence
from typing import Final

from arcor2_hw.data.base import Data
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import InvalidData

MIN_POINTS: Final = 3
"""Minimum number of points that determine a pose. They must not be in one line."""
MIN_WIDTH_RATIO: Final = 0.02
"""Minimum ratio of width to length of the point set, so that the points are not in one line."""
MIN_DISTANCE: Final = 1e-4
"""Minimum extent of the point set, m."""


class Fit(Data, frozen=True):
    """The fitted pose, and the largest distance of a point from its fitted position, m."""

    pose: Pose
    worst: float


def check_points(points: Sequence[Position], name: str) -> None:
    """Raise InvalidData unless there are at least three points that are not in one line."""
    import numpy as np  # imported here, since it delays the start of the server by 0.1 s

    if len(points) < MIN_POINTS:
        raise InvalidData(
            "{what}: at least {fewest} points are needed, not {count}.", what=name, fewest=MIN_POINTS, count=len(points)
        )
    array = np.array([tuple(point) for point in points])
    if not np.isfinite(array).all():
        raise InvalidData("{what}: a coordinate is not a finite number.", what=name)
    extent = np.linalg.svd(array - array.mean(axis=0), compute_uv=False)
    if extent[0] < MIN_DISTANCE or extent[1] < max(MIN_DISTANCE, MIN_WIDTH_RATIO * extent[0]):
        raise InvalidData("{what}: the points are in one line or in one place and do not determine a pose.", what=name)


def fit(on_object: Sequence[Position], touched: Sequence[Position]) -> Fit:
    """Return the pose of an object in the world that fits its points best to the touched positions.

    Least squares (W. Kabsch, Acta Crystallographica A32 (1976) 922), with the sign of the smallest singular value
    chosen so that the result is a rotation and not a reflection.

    Args:
        on_object: Points in the frame of the object.
        touched: Their positions in the world, in the same order.

    Raises:
        InvalidData: The lists differ in length, or the points do not determine a pose.
    """
    import numpy as np

    if len(on_object) != len(touched):
        raise InvalidData(
            "There are {count} points on the object, but {other_count} were touched.",
            count=len(on_object),
            other_count=len(touched),
        )
    check_points(on_object, "Points on the object")
    check_points(touched, "Touched points")
    a, b = (np.array([tuple(point) for point in points]) for points in (on_object, touched))
    center_a, center_b = a.mean(axis=0), b.mean(axis=0)
    u, _, vt = np.linalg.svd((a - center_a).T @ (b - center_b))
    sign = np.sign(np.linalg.det(vt.T @ u.T))
    rotation = vt.T @ np.diag([1.0, 1.0, sign]) @ u.T
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = center_b - rotation @ center_a
    missed = a @ rotation.T + matrix[:3, 3] - b
    return Fit(Pose.from_matrix(matrix), float(np.linalg.norm(missed, axis=1).max()))
