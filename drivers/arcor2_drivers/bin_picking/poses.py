"""Poses of the tool for gripping."""

from typing import TYPE_CHECKING, Final

from arcor2_hw.data.geometry import Pose

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

UPRIGHT: Final = 0.3
"""Smallest horizontal component of an axis of the part from which its rotation is derived."""


def grip_pose(part: Pose, base: Pose, top: float, above: float) -> Pose:
    """Return the pose of the tool at a part: z opposite to the base's, x along a horizontal axis of the part.

    Args:
        part: Pose of the part in the world.
        base: Pose of the crate or blister in the world.
        top: Height of the grip point above the origin of the part, m.
        above: Distance above the grip point, m.
    """
    import numpy as np

    axes, up = part.orientation.matrix(), base.orientation.matrix()[:, 2]
    flat = [axes[:, i] - (axes[:, i] @ up) * up for i in range(3)]
    x = next(each for each in flat if np.linalg.norm(each) > UPRIGHT)
    x = x / np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = x, np.cross(-up, x), -up
    matrix[:3, 3] = np.array(tuple(part.position)) + (top + above) * up
    return Pose.from_matrix(matrix)


def upright(rotation: "npt.NDArray[np.float64]") -> "npt.NDArray[np.float64]":
    """Return one of the four equivalent rotations of a box: z most upwards, then x closest to the crate's x."""
    import numpy as np

    turns = [np.diag(signs) for signs in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))]
    return max(
        (rotation @ turn for turn in turns),
        key=lambda turned: round(2.0 * turned[2, 2], 3) + turned[0, 0] + 0.3 * turned[1, 0],
    )
