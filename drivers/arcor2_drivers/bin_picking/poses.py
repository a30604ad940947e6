"""Poses for gripping: the tool's z into the part, its x along the part."""

from typing import TYPE_CHECKING, Final

from arcor2_hw.data.geometry import Pose

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

UPRIGHT: Final = 0.3
"""Length of an axis seen from above below which it does not tell how the part is turned."""


def gripping(part: Pose, base: Pose, top: float, above: float) -> Pose:
    """Return the tool's pose over a part: z against the base's z, x along the part's x, or y where x stands upright.

    part, base: in the world. top: m by which the point to grip is higher than the part's origin. above: m above that.
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
    """Give, of the four ways in which a box looks the same, the one with z most upward and x most along x."""
    import numpy as np

    turns = [np.diag(signs) for signs in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))]
    return max(
        (rotation @ turn for turn in turns),
        key=lambda turned: round(2.0 * turned[2, 2], 3) + turned[0, 0] + 0.3 * turned[1, 0],
    )
