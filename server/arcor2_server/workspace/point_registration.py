"""Computes the pose of an object from points on it and their touched positions (least squares)."""

from collections.abc import Sequence
from typing import Final

from arcor2_hw.data.base import Data
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import InvalidData

MIN_POINTS: Final = 3
"""Points that determine a pose, if they are not in one line."""
MIN_WIDTH_RATIO: Final = 0.02
"""Minimum extent of the points across their line, as a fraction of its length, to determine the roll."""
MIN_DISTANCE: Final = 1e-4
"""The least distance that is taken for one, m."""


class Fit(Data, frozen=True):
    """The fitted pose, and the largest distance of a point from its fitted position, m."""

    pose: Pose
    worst: float


def check_points(points: Sequence[Position], what: str) -> None:
    """Raise InvalidData unless the points determine a pose: three of them at least, and not in one line."""
    import numpy as np  # 0.1 s that the server's start does without

    if len(points) < MIN_POINTS:
        raise InvalidData(
            "{what}: at least {fewest} points are needed, not {count}.", what=what, fewest=MIN_POINTS, count=len(points)
        )
    array = np.array([tuple(point) for point in points])
    if not np.isfinite(array).all():
        raise InvalidData("{what}: a point is nowhere, and does not determine a pose.", what=what)
    extent = np.linalg.svd(array - array.mean(axis=0), compute_uv=False)
    if extent[0] < MIN_DISTANCE or extent[1] < max(MIN_DISTANCE, MIN_WIDTH_RATIO * extent[0]):
        raise InvalidData(
            "{what}: the points lie in one line, or in one place, and do not determine a pose.", what=what
        )


def fit(on_object: Sequence[Position], touched: Sequence[Position]) -> Fit:
    """Return the pose of an object in the world: that which moves its own points nearest to where they were touched.

    Least squares over the points (W. Kabsch, Acta Crystallographica A32 (1976) 922, with the sign of the smallest
    singular value that keeps a rotation from becoming a reflection). Raises InvalidData for lists of different length
    and for points that do not determine a pose.
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
